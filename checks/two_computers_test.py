"""A robot, on which the master runs, and a laptop, with a cable between them that is pulled."""
import time

import pytest

from harness import Group, check_client, run

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
HEARTBEAT_TIMEOUT, SERVER_TIMEOUT = 3, 6  # s
SLACK = 4  # s: to start a process, or to end it, on a machine where others compute, too


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
        robot.start("rosmaster", "--core")
        yield {"robot": robot, "laptop": laptop}


@pytest.fixture
def start(computers):
    """Start a server on a computer, or a client with its goal and options. -> Process"""
    started = []

    def start(where, bowls=None, name=None, server_timeout=60):
        # A name in place of the address
        env = dict(ROS_IP="", ROS_HOSTNAME=name) if name else {}
        node = ["action_server.py"] if bowls is None else [
            "action_client.py", "_number_of_minutes:=%d" % bowls, "_heartbeat_timeout:=%d" % HEARTBEAT_TIMEOUT,
            "_server_timeout:=%d" % server_timeout]
        started.append(computers[where].node(*node, **env))
        return started[-1]

    yield start
    for process in started:
        process.signal(2)
        process.wait()
        print(process)  # shown with a failure


@pytest.mark.parametrize("server, client", [("robot", "laptop"), ("laptop", "robot")])
def test_a_client_is_served_and_ends_when_the_cable_is_pulled_and_the_next_one_is_served(
        computers, start, server, client):
    start(server)
    check_client(start(client, 2), 0, 2)
    lost = start(client, 60)
    lost.expect("bowl-1")
    computers["laptop"].ip_link("set", "eth0", "down")
    try:
        pulled = time.monotonic()
        assert lost.wait() == 1, str(lost)
        assert time.monotonic() < pulled + HEARTBEAT_TIMEOUT + 2 + SLACK, str(lost)
        assert "server lost" in lost.stderr, str(lost)
    finally:
        computers["laptop"].ip_link("set", "eth0", "up")
    check_client(start(client, 2), 0, 2)


@pytest.mark.parametrize("named, other", [("robot", "laptop"), ("laptop", "robot")])
def test_whose_name_the_other_does_not_know_is_not_heard_until_it_stands_in_its_hosts(computers, start, named, other):
    start("robot", name=named if named == "robot" else None)
    name, begun = named if named == "laptop" else None, time.monotonic()
    client = start("laptop", 2, name, SERVER_TIMEOUT)
    assert client.wait() == 1, str(client)
    assert time.monotonic() < begun + SERVER_TIMEOUT + 2 + 2 * SLACK, str(client)
    client.expect("waiting for the action /wash_dishes_as")
    client.expect("no action /wash_dishes_as")
    computers[other].knows(computers[named])
    check_client(start("laptop", 2, name), 0, 2)
