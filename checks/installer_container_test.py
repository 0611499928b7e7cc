"""The line of ./tutorial for every other system, with podman and an image of debootstrap's in place of debian:12."""
import os
import re
import resource
import shlex
import subprocess

import pytest

from machines import on_terminal
from support.printed import bowls, printed_bowls
from support.processes import Group, PACKAGE, run

pytestmark = pytest.mark.needs("root", "debootstrap", "podman", "runc", "script")
# Podman works in a container, too: without cgroups, a network, or limits above ours.
PODMAN = "podman --runtime=runc --cgroup-manager=cgroupfs --storage-driver=vfs --root={0}/images --runroot={0}/run"
RUN = " run --network=host --ulimit=nproc=1000:1000 --ulimit=nofile={0}:{0} ".format(
    resource.getrlimit(resource.RLIMIT_NOFILE)[1])


@pytest.fixture
def podman(debian, tmp_path_factory):
    """The command of a podman (str) that has the image "bare"."""
    podman = PODMAN.format(tmp_path_factory.mktemp("podman"))
    run("sh", "-c", 'tar -C "$0" --create . | %s import - bare' % podman, str(debian("bookworm")), timeout=300)
    if subprocess.call(shlex.split(podman + RUN + "--rm bare true")):
        pytest.skip("this needs containers")
    yield podman
    run(*podman.split(), "rmi", "--force", "--all")


def test_demo_and_second_terminal_in_a_container_with_a_home(podman):
    with open(os.path.join(PACKAGE, "tutorial"), encoding="utf-8") as file:
        options, command = re.search("^docker run (.*) debian:12 (.*)$", file.read(), re.M).groups()

    with Group() as group:
        def container(command):
            line = podman + RUN + "%s bare %s" % (options, command)
            return group.start(*on_terminal("sh", "-c", 'cd "$0" && ' + line, PACKAGE), stdin=subprocess.PIPE)

        terminal = container(command)
        terminal.expect("^  - bowl-6", 600)
        assert printed_bowls(terminal)[1] == bowls(7), str(terminal)
        terminal.type("echo the shell\n")
        terminal.expect("^the shell")
        in_it = podman.split() + ["exec", "dishes"]
        assert "share/rospy" in run(*in_it, "./tutorial", "ros", "rospack", "find", "rospy")
        run(*in_it, "sh", "-c", "nano --version && echo kept > ~/laundry")
        terminal.type("exit\n")
        assert terminal.wait(300) == 0, str(terminal)  # podman removes what it has copied
        again = container('sh -c "cat ~/laundry"')
        assert again.wait(300) == 0 and again.stdout == "kept\n", str(again)
