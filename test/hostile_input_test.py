#!/usr/bin/python3
"""Bytes and connections that no client of good will sends: the server serves on."""
import itertools
import random
import socket
import struct
import xmlrpc.client

import rosgraph
import rospy
import rostest

from scenes import NodeCase, Scene, check_quiet, concurrently
from processes import check_client, eventually

AT_ONCE = 20  # connections of each kind to each port
SEED = 4  # of the random bytes


def connect(port, data):
    """Returns a socket on which data (bytes) was sent."""
    connection = socket.create_connection(("localhost", port), 30)
    try:
        connection.sendall(data)
    except ConnectionError:
        pass  # refused already, which is well
    return connection


@concurrently(Scene)
class HostileInput(NodeCase):

    def ports(self, scene):
        """Returns those of the server's two, for messages and for XML-RPC."""
        uri = rosgraph.Master(rospy.get_name()).lookupNode(scene.namespace + "/action_server")
        _, _, (_, _, tcpros) = xmlrpc.client.ServerProxy(uri).requestTopic(
            rospy.get_name(), scene.action + "status", [["TCPROS"]])
        return tcpros, int(uri.rstrip("/").rpartition(":")[2])

    def test_hostile_connections(self, scene):
        """Several hundred connections to both ports of the server."""
        noise = random.Random(SEED)
        server = scene.server()
        for _ in range(5):  # so that what the first goals need is there
            scene.serves()
        open_before = server.usage.num_fds()
        body = b"<methodCall><methodName>requestTopic</methodName><params><param>"
        post = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: %d\r\n\r\n%s"
        header = b"callerid=/evil"
        kinds = {
            "nothing, and stay": lambda: b"",
            "random bytes": lambda: bytes(noise.getrandbits(8) for _ in range(noise.randrange(1, 4096))),
            "an oversized header length": lambda: struct.pack("<I", 2**31 - 1) + b"x" * 100,
            "an oversized field length": lambda: struct.pack("<II", 20, 2**32 - 1) + b"x" * 16,
            "a header without a topic": lambda: struct.pack("<II", 4 + len(header), len(header)) + header,
            "broken XML-RPC": lambda: post % (len(body), body),
            "half a request": lambda: post % (10**9, body),
        }

        def connect_many(data):
            return [connect(port, data()) for port in self.ports(scene) for _ in range(AT_ONCE)]

        for data in kinds.values():  # and what the first peers need
            for connection in connect_many(data):
                connection.close()
        before = server.usage.memory_info().rss
        for kind, data in kinds.items():
            connections = connect_many(data)
            client = scene.client(1)
            self.assertEqual(0, client.wait(), "%s: %s" % (kind, client))
            check_client(client, 0, 1)
            for connection in connections:
                connection.close()
        eventually(lambda: server.usage.num_fds() <= open_before + 5,
                   "about %d files open as before, once the connections are closed" % open_before, server)
        self.assertLess(server.usage.memory_info().rss, before * 1.1, "bytes resident after the connections")
        check_quiet(server)
        scene.serves()

    def test_peers_that_use_up_the_files_and_go_away(self, scene):
        server = scene.start("bash", "-c", "ulimit -n 256; exec rosrun actions_tutorial action_server.py")
        scene.wait_connected(server)
        peers, ports = [], itertools.cycle(self.ports(scene))

        def are_used_up():
            for _ in range(4 if len(peers) < 900 else 0):  # at once, most would have to knock again, and again
                peers.append(socket.socket())
                peers[-1].setblocking(False)
                peers[-1].connect_ex(("localhost", next(ports)))
            return server.usage.num_fds() >= 255

        eventually(are_used_up, "no more files for the server", server)
        for peer in peers:
            peer.close()
        check_client(scene.client(1), 0, 1)

    def test_goal_topic_of_another_type(self, scene):
        scene.server()
        stranger = scene.start("rostopic", "pub", "wash_dishes_as/goal", "std_msgs/String", "wash!")
        stranger.expect("types do not match")  # it is the publisher that rospy tells
        scene.serves()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "hostile_input", HostileInput)
