#!/usr/bin/env python3
"""action_client.py with action_server.py, as its user sees it: output, exit status, arguments, Ctrl-C."""
import contextlib
import itertools
import os
import signal
import subprocess
import sys
import unittest

from rosgraph_msgs.msg import Clock
import rosnode
import rospy
import rostest

from support.printed import bowls, printed_bowls, without_noise
from support.processes import PACKAGE, Group, eventually
from support.raw_client import RawClient
from support.states import SUCCEEDED


class ClientTests:
    """Tests of an action client and its server, two processes. client_script, server_script: their names in scripts/;
    aborted, preempted: what the client says of a goal of -1 minutes, and of one that made way for a newer one; tries:
    see check()."""

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

    def check(self, arguments, status, stdout, **options):
        """Run the client with arguments (list of str) and options of Group.start. Expect its exit status and stdout.

        On a busy machine actionlib's client may lose what comes before its send_goal returns (ros/actionlib #206), so
        it has more than one try."""
        for _ in range(self.tries):
            client = self.client(*arguments, **options)
            with contextlib.suppress(AssertionError):
                client.wait(20)
            client.stop()
            if without_noise(client.stdout) == stdout:
                break
        self.assertEqual((status, stdout), (client.wait(), without_noise(client.stdout)), client)

    def check_refused(self, *wrong):
        """Start the client with arguments (list of str), and again with others. Expect that argparse refuses them."""
        for client in [self.client(*arguments) for arguments in wrong]:
            self.assertEqual((2, ""), (client.wait(), client.stdout), client)
            self.assertRegex(client.stderr, "(?m)error: .*%s" % client.command[-1], client)

    def test_output_is_that_of_the_posts(self):
        feedback = "".join('Feedback received: last_dish_washed: "%s"\n' % bowl for bowl in bowls(7))
        result = "".join("  - %s\n" % bowl for bowl in bowls(7))
        self.check([], 0, feedback + "The result is: dishes_washed: \n" + result)

    def test_nodes_are_called_as_their_scripts(self):
        self.client("600").expect("bowl-1")
        names = {"/" + script[:-len(".py")] for script in (self.client_script, self.server_script)}
        self.assertEqual(names, names & set(rosnode.get_node_names()))

    def test_each_feedback_is_printed_at_once(self):
        client = self.client("600")
        client.expect("bowl-2", timeout=20)  # what is not flushed comes later, when the pipe's buffer is full
        self.assertTrue(client.running(), client)

    def test_aborted_goal_says_why_and_exits_with_1(self):
        self.check(["-1"], 1, "The result is: dishes_washed: []\n" + self.aborted + "\n", stderr=subprocess.STDOUT)

    def test_preempted_goal_prints_its_bowls_and_exits_with_1(self):
        client = self.client("600")
        goal_id = self.goal_of(client)
        self.raw.send(0)
        self.assertEqual(1, client.wait(), client)
        self.assertEqual(self.raw.wait_result(goal_id).result.dishes_washed, printed_bowls(client)[1], client)
        self.assertEqual(self.preempted + "\n", without_noise(client.stderr), client)

    def test_client_waits_for_server_and_outcome_without_limit(self):
        rospy.set_param("/use_sim_time", True)  # for nodes that start now, so not for this one
        self.addCleanup(rospy.delete_param, "/use_sim_time")
        clock, minutes = rospy.Publisher("/clock", Clock, queue_size=10), itertools.count(1)
        client = self.client("120", ROS_NAMESPACE="/later")

        def turn_until(condition, what):
            eventually(lambda: clock.publish(rospy.Time(60 * next(minutes))) or condition(), what, client)

        eventually(clock.get_num_connections, "the client has the clock", client)
        turn_until(lambda: next(minutes) > 120, "two hours")
        self.nodes.node(self.server_script, ROS_NAMESPACE="/later")
        turn_until(lambda: not client.running(), "two hours of washing")
        self.assertEqual((0, bowls(120)), (client.wait(), printed_bowls(client)[1]), client)

    def test_help_needs_no_master(self):
        client = self.client("--help", ROS_MASTER_URI="http://localhost:1", COLUMNS="120")
        self.assertEqual(0, client.wait(), client)
        self.assertRegex(client.stdout, r"(?s)^usage: .*\[MINUTES\]\n\n(?!positional)"  # a description
                                        r".*  MINUTES  .*wash.* \(default: 7\)\n")

    def test_wrong_arguments_are_refused(self):
        self.check_refused(["seven"], ["7", "eight"], ["--minutes"])

    def test_number_that_int32_cannot_hold_is_an_error(self):
        client = self.client(str(2**31))
        self.assertEqual(1, client.wait(), client)
        self.assertNotIn("The result is", client.stdout, client)


class TestActionClient(ClientTests, unittest.TestCase):

    client_script, server_script = "action_client.py", "action_server.py"
    aborted, preempted, tries = "ABORTED: number_of_minutes is -1, must be 0 or more", "PREEMPTED", 3

    def test_ctrl_c_lets_the_goal_go_on(self):
        client = self.client("6")
        goal_id = self.goal_of(client)
        client.signal(signal.SIGINT)
        self.assertEqual((1, ""), (client.wait(), without_noise(client.stderr)), client)
        self.assertNotIn("The result is", client.stdout, client)
        self.raw.check_outcome(goal_id, SUCCEEDED, bowls(6))

    def test_recalled_goal_exits_with_1(self):
        raw = RawClient("/recalls").wait_connected(self.nodes.node(self.server_script, ROS_NAMESPACE="/recalls"))
        self.addCleanup(raw.close)
        raw.cancel("another", rospy.Time.now() + rospy.Duration(100))  # this server then refuses goals until that time
        raw.wait(lambda: "another" in raw.states, "the cancel has come")
        client = self.client("3", ROS_NAMESPACE="/recalls")
        self.assertEqual(1, client.wait(), client)
        self.assertIn("RECALLED: ", client.stderr, client)

    def test_goal_is_lost_with_a_server_that_starts_again(self):
        server = self.nodes.node(self.server_script, ROS_NAMESPACE="/again")
        client = self.client("600", ROS_NAMESPACE="/again")
        client.expect("bowl-1")
        text = "This goal has been accepted by the simple action server"  # the last that came of it
        server.stop()
        self.nodes.node(self.server_script, ROS_NAMESPACE="/again")
        self.assertEqual((1, "LOST: %s\n" % text), (client.wait(), without_noise(client.stderr)), client)
        self.assertNotIn("The result is", client.stdout, client)

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
