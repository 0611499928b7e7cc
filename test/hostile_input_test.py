#!/usr/bin/python3
"""Bytes, connections and goals that no client of good will sends: the server serves on."""
import os
import random
import socket
import struct
import xmlrpc.client

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from fault_case import STATE, FaultCase, Scene, bowls, concurrently
from harness import eventually

AT_ONCE = 20  # connections of each kind to each port
SEED = 4  # of the random bytes


def resident(process):
    """Returns the resident memory of process (Process) in MiB."""
    with open("/proc/%d/status" % process.pid) as status:
        return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024


def connect(port, data):
    """Returns a socket on which data (bytes) was sent."""
    connection = socket.create_connection(("localhost", port), 30)
    try:
        connection.sendall(data)
    except ConnectionError:
        pass  # refused already, which is well
    return connection


@concurrently
class HostileInput(FaultCase):

    def test_hostile_connections(self):
        """Several hundred connections to both ports of the server."""
        noise = random.Random(SEED)
        with Scene(self.master, "bytes") as scene:
            server = scene.server()
            for number in range(5):  # so that what the first goals need is there
                scene.serves("warm-%d" % number)
            uri = self.master.api.lookupNode("/bytes/action_server")
            _, _, (_, _, tcpros) = xmlrpc.client.ServerProxy(uri).requestTopic(
                "/watcher", "/bytes/wash_dishes_as/status", [["TCPROS"]])
            xmlrpc_port = int(uri.rstrip("/").rpartition(":")[2])
            files = "/proc/%d/fd" % server.pid
            before, open_before = resident(server), len(os.listdir(files))
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
            for kind, data in kinds.items():
                connections = [connect(port, data()) for port in (tcpros, xmlrpc_port) for _ in range(AT_ONCE)]
                client = scene.client(1)
                self.assertEqual(client.wait(), 0, "with %d times %s: %s" % (len(connections), kind, client))
                for connection in connections:
                    connection.close()
            eventually(lambda: len(os.listdir(files)) <= open_before + 5,
                       "about %d files open as before, once the connections are closed" % open_before)
            self.assertLess(resident(server), before * 1.1, "MiB resident after %d connections" % (
                len(kinds) * len(connections)))
            self.assertNotIn("Traceback", server.stdout + server.stderr, server)
            scene.serves("last")

    def test_burst_of_500_goals(self):
        with Scene(self.master, "burst") as scene:
            scene.server()
            ids = ["burst-%d" % number for number in range(500)]
            for goal_id in ids:
                scene.send(2, goal_id)
            _, last = scene.ending(ids[-1])
            self.assertEqual((last.status.status, last.result.dishes_washed), (STATE["SUCCEEDED"], bowls(2)))
            eventually(lambda: len(scene.ended) >= 500, "an ending for each of 500 goals")
            self.assertEqual(sorted(scene.ended), sorted(ids), "each goal once in the status")
            washed = [result for _, result in scene.results if result.status.status == STATE["SUCCEEDED"]]
            self.assertEqual(len(washed), 1, "the last goal alone is washed to its end")
            scene.serves()

    def test_goal_topic_of_another_type(self):
        with Scene(self.master, "md5sum") as scene:
            scene.server()
            stranger = scene.start("rostopic", "pub", "wash_dishes_as/goal", "std_msgs/String", "wash!")
            stranger.expect("types do not match", stream="stderr")  # it is the publisher that rospy tells
            scene.serves()

    def test_strange_ids(self):
        with Scene(self.master, "ids") as scene:
            server = scene.server()
            scene.send(60, "twice")
            eventually(lambda: scene.feedback, "a first bowl")
            scene.send(60, "twice")
            server.expect("ignored.*twice", stream=None)
            scene.serves("in between")
            scene.send(60, "twice")  # ended a moment ago
            eventually(lambda: server.stderr.count("ignored") == 2, "a second line of log on the repeat")
            scene.serves("after it")
            endings = [result for _, result in scene.results if result.status.goal_id.id == "twice"]
            self.assertEqual([ending.status.status for ending in endings], [STATE["PREEMPTED"]], "one ending")
            for number in range(3):
                scene.send(0)
                eventually(lambda: len(scene.results) == 4 + number, "an ending for empty id %d" % number)
            scene.serves("long " * 200000)
            scene.serves()

    def test_strange_stamps(self):
        with Scene(self.master, "stamps") as scene:
            scene.server()
            for name, stamp in (("past", 1), ("future", 4e9), ("present", rospy.get_time()), ("past again", 2)):
                scene.send(1, name, rospy.Time.from_sec(stamp))
                _, result = scene.ending(name)
                self.assertEqual(result.status.status, GoalStatus.SUCCEEDED, "%s:\n%s" % (name, result))
            scene.serves()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "hostile_input", HostileInput)
