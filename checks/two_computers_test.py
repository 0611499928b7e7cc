"""A robot, on which the master runs, and a laptop, with a cable between them that is pulled."""
import time

import pytest

from processes import check_client

pytestmark = pytest.mark.needs("root", "ip")
HEARTBEAT_TIMEOUT, SERVER_TIMEOUT = 3, 6  # s
SLACK = 4  # s: to start a process and to end it on a machine where others compute, too


@pytest.fixture(scope="module")
def computers(workspace, network):
    network[0].start("rosmaster", "--core")
    return dict(zip(("robot", "laptop"), network))


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
    computers["laptop"].link("down")
    try:
        pulled = time.monotonic()
        assert lost.wait() == 1, str(lost)
        assert time.monotonic() < pulled + HEARTBEAT_TIMEOUT + 2 + SLACK, str(lost)
        assert "server lost" in lost.stderr, str(lost)
    finally:
        computers["laptop"].link("up")
    check_client(start(client, 2), 0, 2)


@pytest.mark.parametrize("named, other", [("robot", "laptop"), ("laptop", "robot")])
def test_whose_name_the_other_does_not_know_is_not_heard_until_it_stands_in_its_hosts(computers, start, named, other):
    start("robot", name=named if named == "robot" else None)
    name, begun = named if named == "laptop" else None, time.monotonic()
    client = start("laptop", 2, name, SERVER_TIMEOUT)
    assert client.wait() == 1, str(client)
    assert time.monotonic() < begun + SERVER_TIMEOUT + 2 + SLACK, str(client)
    client.expect("waiting for the action /wash_dishes_as")
    client.expect("no action /wash_dishes_as")
    computers[other].knows(computers[named])
    check_client(start("laptop", 2, name), 0, 2)
