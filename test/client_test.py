#!/usr/bin/env python3
"""action_client.py with action_server.py, as its user sees it: output, exit status, arguments, Ctrl-C."""
import contextlib
import os
import signal
import sys
import unittest

import rosnode
import rospy
import rostest

from support.printed import bowls, printed_bowls
from support.processes import PACKAGE, Group, eventually
from support.raw_client import RawClient
from support.states import SUCCEEDED


class ClientTests:
    """Tests of an action client and its server, two processes. client_script, server_script: their names in scripts/;
    preempted: what the client says of a goal that made way for a newer one; tries: see check()."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.servers = Group()
        cls.raw = RawClient().wait_connected(cls.servers.node(cls.server_script))

    @classmethod
    def tearDownClass(cls):
        cls.servers.stop()

    def setUp(self):
        self.nodes = Group()
        self.addCleanup(self.nodes.stop)

    def client(self, *arguments, **options):
        """Start the client. -> Process"""
        return self.nodes.node(self.client_script, *arguments, **options)

    def goal_of(self, client):
        """Wait until a client has printed two bowls. Returns the id of its goal."""
        client.expect("bowl-1")
        self.raw.wait(lambda: "bowl-1" in self.raw.bowls_of(list(self.raw.feedback)[-1]), "the same feedback")
        return list(self.raw.feedback)[-1]

    def check(self, arguments, status, stdout):
        """Run the client with arguments (list of str). Expect its exit status and its stdout. Returns the Process.

        On a busy machine actionlib's client may lose what comes before its send_goal returns (ros/actionlib #206), so
        it has more than one try."""
        for _ in range(self.tries):
            client = self.client(*arguments)
            with contextlib.suppress(AssertionError):
                client.wait(20)
            client.stop()
            if client.stdout == stdout:
                break
        self.assertEqual((status, stdout), (client.wait(), client.stdout), client)
        return client

    def check_refused(self, *wrong):
        """Start the client with arguments (list of str), and again with others. Expect that argparse refuses them."""
        for client in [self.client(*arguments) for arguments in wrong]:
            self.assertEqual((2, ""), (client.wait(), client.stdout), client)
            self.assertRegex(client.stderr, "(?m)error: .*%s" % client.command[-1], client)

    def test_output_is_that_of_the_posts(self):
        feedback = "".join('Feedback received: last_dish_washed: "%s"\n' % bowl for bowl in bowls(7))
        result = "".join("  - %s\n" % bowl for bowl in bowls(7))
        self.check([], 0, feedback + "The result is: dishes_washed: \n" + result)

    def test_each_feedback_is_printed_at_once(self):
        client = self.client("600")
        client.expect("bowl-2", timeout=20)  # what is not flushed comes later, when the pipe's buffer is full
        self.assertTrue(client.running(), client)

    def test_aborted_goal_says_why_and_exits_with_1(self):
        client = self.check(["-1"], 1, "The result is: dishes_washed: []\n")
        self.assertIn("ABORTED: number_of_minutes is -1, must be 0 or more", client.stderr, client)

    def test_preempted_goal_prints_its_bowls_and_exits_with_1(self):
        client = self.client("600")
        goal_id = self.goal_of(client)
        self.raw.send(0)
        self.assertEqual(1, client.wait(), client)
        self.assertEqual(self.raw.wait_result(goal_id).result.dishes_washed, printed_bowls(client)[1], client)
        self.assertIn(self.preempted, client.stderr, client)

    def test_client_waits_for_its_server(self):
        client = self.client("1", ROS_NAMESPACE="/later")
        self.nodes.node(self.server_script, ROS_NAMESPACE="/later")
        self.assertEqual(0, client.wait(), client)

    def test_help_needs_no_master(self):
        client = self.client("--help", ROS_MASTER_URI="http://localhost:1")
        self.assertEqual(0, client.wait(), client)
        self.assertIn("MINUTES", client.stdout)

    def test_wrong_arguments_are_refused(self):
        self.check_refused(["seven"], ["7", "eight"], ["--minutes"])

    def test_number_that_int32_cannot_hold_is_an_error(self):
        client = self.client(str(2**31))
        self.assertEqual(1, client.wait(), client)
        self.assertNotIn("The result is", client.stdout, client)


class TestActionClient(ClientTests, unittest.TestCase):

    client_script, server_script = "action_client.py", "action_server.py"
    preempted, tries = "PREEMPTED", 3

    def test_ctrl_c_lets_the_goal_go_on(self):
        client = self.client("6")
        goal_id = self.goal_of(client)
        client.signal(signal.SIGINT)
        self.assertEqual((1, ""), (client.wait(), client.stderr), client)
        self.assertNotIn("The result is", client.stdout, client)
        self.raw.check_outcome(goal_id, SUCCEEDED, bowls(6))

    def test_test_that_is_terminated_leaves_no_node(self):
        path = os.pathsep.join([PACKAGE + "/test", os.environ["PYTHONPATH"]])
        test = self.nodes.start(sys.executable, "-c", """if True:
            import rospy
            from support.processes import Group
            rospy.init_node("terminated", anonymous=True)
            Group().node("action_server.py", ROS_NAMESPACE="/terminated").wait(600)""", PYTHONPATH=path)

        def server_runs():
            return rosnode.rosnode_ping("/terminated/action_server", 1, verbose=False)

        eventually(server_runs, "a server", test)
        test.signal(signal.SIGTERM)
        test.wait()
        eventually(lambda: not server_runs(), "no server", test)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "client", TestActionClient)
