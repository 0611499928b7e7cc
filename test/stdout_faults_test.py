#!/usr/bin/python3
"""A stdout that is closed, full or stopped: the server serves on, and a client that nobody reads cancels its goal."""
import contextlib
import os
import signal
import time

import rostest

from raw_client import ABORTED, PREEMPTED
from scenes import SLACK, NodeCase, Scene, check_quiet, concurrently


@concurrently(Scene)
class StdoutFaults(NodeCase):

    def serves_on(self, scene, redirection):
        """A server whose stdout is in this state serves, and says it in one line at most."""
        server = scene.start("bash", "-c", "rosrun actions_tutorial action_server.py " + redirection)
        scene.wait_connected(server)
        for _ in range(3):
            scene.serves()
        check_quiet(server)
        self.assertLessEqual(server.stderr.count("\n"), 1, "lines on stderr of %s" % server)

    def test_stdout_that_nobody_reads_any_more(self, scene):
        self.serves_on(scene, "| head -n 1")

    def test_stdout_that_is_full(self, scene):
        self.serves_on(scene, "> /dev/full")

    def test_stdout_that_is_closed(self, scene):
        self.serves_on(scene, ">&-")

    def test_stderr_that_is_closed(self, scene):
        self.serves_on(scene, "2>&-")

    def test_stdout_that_is_stopped_holds_up_no_goal_and_not_the_end(self, scene):
        read, write = os.pipe()
        os.set_blocking(write, False)
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(write, b"x")
        os.set_blocking(write, True)
        server = scene.node("action_server.py", stdout=write)
        scene.wait_connected(server)
        scene.serves()
        goal_id = scene.send(60)
        scene.wait_bowls(goal_id, 1)
        begun = time.monotonic()
        server.signal(signal.SIGINT)
        self.assertEqual(0, server.wait(), server)
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "s until the end of %s" % server)
        self.assertEqual(ABORTED, scene.wait_result(goal_id).status.status)
        check_quiet(server)
        for end in read, write:
            os.close(end)

    def test_stdout_of_the_client_that_is_full_cancels_the_goal(self, scene):
        scene.server()
        client = scene.start(
            "bash", "-c", "exec rosrun actions_tutorial action_client.py _number_of_minutes:=60 > /dev/full")
        self.assertEqual(1, client.wait(), client)
        self.assertIn("cannot write to stdout", client.stderr, client)
        check_quiet(client)
        self.assertEqual(PREEMPTED, scene.wait_result().status.status)

    def test_stdout_that_cannot_encode_is_no_wrong_parameter(self, scene):
        code = "from actions_tutorial import robust; robust.init_node('printer'); print('\\u2026 there')"
        code += "; import rospy; rospy.loginfo('\\u2026 logged')"
        printer = scene.start("/usr/bin/python3", "-c", code, PYTHONIOENCODING="ascii")
        self.assertEqual(0, printer.wait(), printer)
        self.assertIn("there", printer.stdout, printer)
        self.assertIn("logged", printer.stdout, printer)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "stdout_faults", StdoutFaults)
