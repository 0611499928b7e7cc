"""A robot, on which the master runs, and a laptop, with a cable between them that is pulled."""
import os
import subprocess

import pytest

from support.printed import check_client
from support.processes import Group, eventually, run

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
HEARTBEAT_TIMEOUT, SERVER_TIMEOUT = 3, 6  # s
SLACK = 4  # s: on a machine where others compute, too


class Computer(Group):
    """A network with an address and an /etc/hosts of its own, in namespaces that go when we go."""

    def __init__(self, name, ip, folder):
        super().__init__(ROS_MASTER_URI="http://192.0.2.1:11311", ROS_IP=ip)
        self.name, self.ip, self.hosts, self.enter = name, ip, folder / name, []
        self.hosts.write_text("127.0.0.1 localhost\n%s %s\n" % (ip, name))
        holder = self.start("setpriv", "--pdeathsig", "KILL", "unshare", "--net", "--mount", "sh", "-c",
                            'mount --bind "$0" /etc/hosts && echo there && exec sleep infinity', str(self.hosts))
        try:
            holder.expect("there")
        except AssertionError:
            pytest.skip("this needs the right to make network namespaces: %s" % holder.stderr)
        self.pid = str(holder.usage.pid)
        self.enter = ["nsenter", "--net", "--mount", "--target", self.pid]

    def start(self, *command, **options):
        return super().start(*self.enter, *command, **options)

    def knows(self, other):
        """Write the other's name into its /etc/hosts."""
        with self.hosts.open("a") as hosts:
            hosts.write("%s %s\n" % (other.ip, other.name))

    def ip_link(self, *words):
        run(*self.enter, "ip", "link", *words)


@pytest.fixture(scope="module")
def computers(workspace, tmp_path_factory):
    """Two computers joined by a cable, the first with a master. -> {name: Computer}"""
    folder = tmp_path_factory.mktemp("network")
    with Computer("robot", "192.0.2.1", folder) as robot, Computer("laptop", "192.0.2.2", folder) as laptop:
        robot.ip_link("add", "eth0", "type", "veth", "peer", "name", "eth0", "netns", laptop.pid)
        for computer in robot, laptop:
            run(*computer.enter, "ip", "address", "add", computer.ip + "/24", "dev", "eth0")
            computer.ip_link("set", "lo", "up")
            computer.ip_link("set", "eth0", "up")
        master = robot.start("rosmaster", "--core")
        eventually(lambda: not subprocess.call([*robot.enter, "rosparam", "list"], env=dict(os.environ, **robot.env),
                                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL),
                   "a master on the robot", master)
        yield {"robot": robot, "laptop": laptop}


@pytest.fixture
def start(computers):
    """Start a node on a computer. -> Process"""
    started = []

    def start(where, *node, **env):
        started.append(computers[where].node(*node, **env))
        return started[-1]

    yield start
    for process in started:
        process.signal(2)
        process.wait()
        print(process)  # shown with a failure


def client(bowls, server_timeout=60):
    return ["robust_action_client.py", str(bowls), "--heartbeat-timeout=%d" % HEARTBEAT_TIMEOUT,
            "--server-timeout=%d" % server_timeout]


@pytest.mark.parametrize("server, other", [("robot", "laptop"), ("laptop", "robot")])
def test_goal_is_lost_when_the_cable_is_pulled(computers, start, server, other):
    start(server, "robust_action_server.py")
    check_client(start(other, *client(2)), 0, 2)
    lost = start(other, *client(60))
    lost.expect("bowl-1")
    computers["laptop"].ip_link("set", "eth0", "down")
    try:
        lost.expect("goal LOST", timeout=HEARTBEAT_TIMEOUT + SLACK)
    finally:
        computers["laptop"].ip_link("set", "eth0", "up")
    assert lost.wait() == 1, str(lost)  # rospy itself waits for the master
    check_client(start(other, *client(2)), 0, 2)


@pytest.mark.parametrize("named, other", [("robot", "laptop"), ("laptop", "robot")])
def test_a_name_works_once_it_is_in_the_others_hosts(computers, start, named, other):
    # A name in place of the address
    env = {computer: dict(ROS_IP="", ROS_HOSTNAME=named) if computer == named else {} for computer in computers}
    start("robot", "robust_action_server.py", **env["robot"])
    waiting = start("laptop", *client(2, SERVER_TIMEOUT), **env["laptop"])
    assert waiting.wait() == 1, str(waiting)
    assert "bowl" not in waiting.stdout, str(waiting)
    computers[other].knows(computers[named])
    check_client(start("laptop", *client(2), **env["laptop"]), 0, 2)
