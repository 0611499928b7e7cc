"""The line of ./tutorial for every other system, with podman and an image of debootstrap's in place of debian:12."""
import os
import re
import resource
import subprocess

import pytest

from conftest import ROOT, on_terminal
from support.printed import bowls, printed_bowls
from support.processes import Group, run

pytestmark = pytest.mark.needs("root", "debootstrap", "podman", "runc", "script")
# Works in a container, too: there is no cgroup to be had, no network, and no limit above ours.
CONTAINERS = """[containers]
netns = "host"
default_ulimits = ["nofile=%d:%d", "nproc=1000:1000"]
[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
"""
STORAGE = """[storage]
driver = "vfs"
graphroot = "%s/images"
runroot = "%s/run"
"""


@pytest.fixture
def podman(debian, tmp_path):
    """Processes that find the image "bare"."""
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    (tmp_path / "containers.conf").write_text(CONTAINERS % (files, files))
    (tmp_path / "storage.conf").write_text(STORAGE % (tmp_path, tmp_path))
    with Group(CONTAINERS_CONF=str(tmp_path / "containers.conf"),
               CONTAINERS_STORAGE_CONF=str(tmp_path / "storage.conf")) as group:
        try:
            run("sh", "-c", 'tar -C "$0" --create . | podman import - bare', str(debian("bookworm")), timeout=300,
                **group.env)
            if group.start("podman", "run", "--rm", "bare", "true").wait(60):
                pytest.skip("this needs containers")
            yield group
        finally:
            run("podman", "rm", "--force", "--all", **group.env)


def test_demo_and_second_terminal_in_a_container_with_a_home(podman):
    with open(os.path.join(ROOT, "tutorial"), encoding="utf-8") as file:
        options, command = re.search("^docker (run .*) debian:12 (.*)$", file.read(), re.M).groups()

    def container(command):
        return podman.start(*on_terminal("sh", "-c", 'cd "$0" && podman %s bare %s' % (options, command), ROOT),
                            stdin=subprocess.PIPE)

    terminal = container(command)
    terminal.expect("^  - bowl-6", 600)
    assert printed_bowls(terminal)[1] == bowls(7), str(terminal)
    terminal.type("echo the shell\n")
    terminal.expect("^the shell")
    assert "share/rospy" in run("podman", "exec", "dishes", "./tutorial", "ros", "rospack", "find", "rospy",
                                **podman.env)
    run("podman", "exec", "dishes", "sh", "-c", "nano --version && echo kept > ~/laundry", **podman.env)
    terminal.type("exit\n")
    assert terminal.wait(300) == 0, str(terminal)  # podman removes what it has copied
    again = container('sh -c "cat ~/laundry"')
    assert again.wait(300) == 0 and again.stdout == "kept\n", str(again)
