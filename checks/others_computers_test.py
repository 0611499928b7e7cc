"""A robot, on which the master runs, and a laptop, with a cable between them that is pulled."""
import pytest

from machines import Namespaces
from support.printed import check_client
from support.processes import run

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
BOTH_WAYS = [("robot", "laptop"), ("laptop", "robot")]


class Computer(Namespaces):
    """A network with an address (str) and an /etc/hosts of its own, which is in a folder (pathlib.Path)."""

    def __init__(self, name, ip, folder):
        super().__init__("--net", "--mount", ROS_MASTER_URI="http://192.0.2.1:11311", ROS_IP=ip)
        self.name, self.ip, self.hosts = name, ip, folder / name
        self.hosts.write_text("127.0.0.1 localhost\n%s %s\n" % (ip, name))
        self.run("mount --bind %s /etc/hosts" % self.hosts)

    def run(self, script):
        run(*self.enter, "sh", "-ec", script, **self.env)

    def knows(self, other):
        """Write the other's name into its /etc/hosts."""
        with self.hosts.open("a") as hosts:
            hosts.write("%s %s\n" % (other.ip, other.name))


@pytest.fixture(scope="module")
def computers(workspace, tmp_path_factory):
    """Two computers joined by a cable, the first with a master. -> {name: Computer}"""
    folder = tmp_path_factory.mktemp("network")
    with Computer("robot", "192.0.2.1", folder) as robot, Computer("laptop", "192.0.2.2", folder) as laptop:
        robot.run("ip link add eth0 type veth peer name eth0 netns " + laptop.pid)
        for computer in robot, laptop:
            computer.run("ip address add %s/24 dev eth0; ip link set lo up; ip link set eth0 up" % computer.ip)
        robot.start("rosmaster", "--core")
        robot.run("until rosparam list; do sleep 0.1; done")
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
    return ["robust_action_client.py", str(bowls), "--heartbeat-timeout=3", "--server-timeout=%d" % server_timeout]


@pytest.mark.parametrize("server, other", BOTH_WAYS)
def test_goal_is_lost_when_the_cable_is_pulled(computers, start, server, other):
    start(server, "robust_action_server.py")
    check_client(start(other, *client(2)), 0, 2)
    lost = start(other, *client(60))
    lost.expect("bowl-1")
    computers["laptop"].run("ip link set eth0 down")
    try:
        lost.expect("goal LOST", timeout=3 + 4)  # of the heartbeat, and for a busy machine
    finally:
        computers["laptop"].run("ip link set eth0 up")
    assert lost.wait() == 1, str(lost)  # rospy itself waits for the master
    check_client(start(other, *client(2)), 0, 2)


@pytest.mark.parametrize("named, other", BOTH_WAYS)
def test_a_name_works_once_it_is_in_the_others_hosts(computers, start, named, other):
    # A name instead of the address
    env = {computer: dict(ROS_IP="", ROS_HOSTNAME=named) if computer == named else {} for computer in computers}
    start("robot", "robust_action_server.py", **env["robot"])
    waiting = start("laptop", *client(2, server_timeout=6), **env["laptop"])
    assert waiting.wait() == 1, str(waiting)
    assert "bowl" not in waiting.stdout, str(waiting)
    computers[other].knows(computers[named])
    check_client(start("laptop", *client(2), **env["laptop"]), 0, 2)
