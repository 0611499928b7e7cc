"""What the checks stand on: a workspace, a network of two computers; and what they need, or are skipped."""
import json
import os
import shutil
import signal
import sys

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "test"))
from processes import Group, Master, Process, run  # noqa: E402


def pytest_addoption(parser):
    parser.addoption("--runs", type=int, default=0, help="how often repeated_test.py runs all tests")
    parser.addoption("--busy", type=int, default=0, help="how many processes keep the cores busy meanwhile")


def pytest_configure():
    # Whoever stops us, also in the background: fixtures end what they have begun.
    for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
        signal.signal(number, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    for name in [name for mark in item.iter_markers("needs") for name in mark.args]:
        if os.geteuid() if name == "root" else not shutil.which(name):
            pytest.skip("this needs %s" % name)


@pytest.fixture(scope="session")
def workspace(tmp_path_factory):
    """A workspace with the package in it, thrown away, and all processes in its environment, as in ./tutorial shell."""
    folder, before = tmp_path_factory.mktemp("workspace"), dict(os.environ)
    for name in [name for name in before if name.startswith("ROS")]:
        del os.environ[name]
    try:
        os.environ.update(json.loads(run(
            os.path.join(ROOT, "tutorial"), "shell", "env", "-u", "TUTORIAL_WS", "/usr/bin/python3", "-c",
            "import json, os; print(json.dumps(dict(os.environ)))", TUTORIAL_WS=str(folder), timeout=600)))
        del os.environ["ROS_HOSTNAME"]  # it would go before ROS_IP
        yield folder
    finally:
        os.environ.clear()
        os.environ.update(before)
        shutil.rmtree(folder)


@pytest.fixture
def master():
    with Master() as master:
        yield master


class Computer(Group):
    """A network namespace with an address and an /etc/hosts of its own; what is started runs there."""

    def __init__(self, name, number, folder):
        self.name, self.namespace, self.hosts = name, "%s-%d" % (name, os.getpid()), folder / name
        self.ip = "192.0.2.%d" % number
        self.knows(self)
        super().__init__(ROS_MASTER_URI="http://192.0.2.1:11311", ROS_IP=self.ip)

    def knows(self, other):
        """Write the other's name, which may be its own, into its /etc/hosts."""
        with open(self.hosts, "a") as hosts:
            hosts.write("127.0.0.1 localhost\n%s %s\n" % (other.ip, other.name))

    def start(self, *command, **options):
        return super().start("ip", "netns", "exec", self.namespace, "sh", "-c",
                             'mount --bind "$0" /etc/hosts && exec "$@"', str(self.hosts), *command, **options)

    def link(self, state):
        """Pull out ("down") or plug in ("up") the cable."""
        run("ip", "-n", self.namespace, "link", "set", "eth0", state)


@pytest.fixture(scope="module")
def network(tmp_path_factory):
    """Two computers, robot and laptop, joined by a cable. -> (Computer, Computer)"""
    folder = tmp_path_factory.mktemp("network")
    computers = [Computer(name, number, folder) for number, name in enumerate(("robot", "laptop"), 1)]
    made = []
    try:
        for computer in computers:
            added = Process(["ip", "netns", "add", computer.namespace])
            if added.wait():
                pytest.skip("this needs the right to make network namespaces: %s" % added.stderr)
            made.append(computer)
        robot, laptop = computers
        run("ip", "link", "add", "eth0", "netns", robot.namespace, "type", "veth",
            "peer", "name", "eth0", "netns", laptop.namespace)
        for computer in computers:
            run("ip", "-n", computer.namespace, "address", "add", computer.ip + "/24", "dev", "eth0")
            run("ip", "-n", computer.namespace, "link", "set", "lo", "up")
            computer.link("up")
        yield computers
    finally:
        for computer in made:
            computer.stop()
            run("ip", "netns", "del", computer.namespace)
