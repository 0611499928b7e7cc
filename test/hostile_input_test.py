#!/usr/bin/python3
"""Bytes and connections that no client of good will sends: the server serves on."""
import contextlib
import itertools
import random
import socket
import struct

import psutil
import rostest
from rosgraph.network import encode_ros_handshake_header

from scenes import NodeCase, Scene, check_quiet, concurrently
from processes import check_client, eventually

AT_ONCE = 20  # connections of each kind to each port
SEED = 4  # of the random bytes


def ports(server):
    """Returns those of a node (Process), for messages and for XML-RPC."""
    both = [one.laddr.port for one in psutil.net_connections("tcp")
            if (one.pid, one.status) == (server.usage.pid, psutil.CONN_LISTEN)]
    assert len(both) == 2, "expected two ports, not %s, of %s" % (both, server)
    return both


@contextlib.contextmanager
def connections(server, data):
    """Within it, there are AT_ONCE connections to each port, each with what data() (bytes) returns."""
    with contextlib.ExitStack() as peers:
        for port in ports(server) * AT_ONCE:
            peer = peers.enter_context(socket.create_connection(("localhost", port), 30))
            with contextlib.suppress(ConnectionError):  # refused already, which is well
                peer.sendall(data())
        yield


@concurrently(Scene)
class HostileInput(NodeCase):

    def test_hostile_connections_and_a_goal_topic_of_another_type(self, scene):
        noise = random.Random(SEED)
        server = scene.server()
        for _ in range(5):  # so that what the first goals need is there
            scene.serves()
        open_before = server.usage.num_fds()
        body = b"<methodCall><methodName>requestTopic</methodName><params><param>"
        post = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n%s"
        kinds = {
            "nothing, and stay": lambda: b"",
            "random bytes": lambda: bytes(noise.getrandbits(8) for _ in range(noise.randrange(1, 4096))),
            "an oversized header length": lambda: struct.pack("<I", 2**31 - 1) + b"x" * 100,
            "an oversized field length": lambda: struct.pack("<II", 20, 2**32 - 1) + b"x" * 16,
            "a header without a topic": lambda: encode_ros_handshake_header({"callerid": "/evil"}),
            "broken XML-RPC": lambda: post % (len(body), body),
            "half a request": lambda: post % (10**9, body),
        }
        for data in kinds.values():  # and what the first peers need
            with connections(server, data):
                pass
        before = server.usage.memory_info().rss
        for kind, data in kinds.items():
            with connections(server, data):
                client = scene.client(1)
                self.assertEqual(0, client.wait(), "%s: %s" % (kind, client))
                check_client(client, 0, 1)
        eventually(lambda: server.usage.num_fds() <= open_before + 5,
                   "about %d files open as before, once the connections are closed" % open_before, server)
        self.assertLess(server.usage.memory_info().rss, before * 1.1, "bytes resident after the connections")
        check_quiet(server)
        stranger = scene.start("rostopic", "pub", "wash_dishes_as/goal", "std_msgs/String", "wash!")
        stranger.expect("types do not match")  # it is the publisher that rospy tells
        scene.serves()

    def test_peers_that_use_up_the_files_and_go_away(self, scene):
        server = scene.start("bash", "-c", "ulimit -n 256; exec rosrun actions_tutorial action_server.py")
        scene.wait_connected(server)
        peers, both = [], itertools.cycle(ports(server))

        def are_used_up():
            full = server.usage.num_fds() >= 256  # so those that knock now have to wait
            for _ in range(4 if len(peers) < 900 else 0):  # at once, most would have to knock again, and again
                peers.append(socket.socket())
                peers[-1].setblocking(False)
                peers[-1].connect_ex(("localhost", next(both)))
            return full

        eventually(are_used_up, "no more files for the server", server)
        for peer in peers:
            peer.close()
        check_client(scene.client(1), 0, 1)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "hostile_input", HostileInput)
