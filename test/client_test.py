#!/usr/bin/env python3
"""action_client.py and robust_action_client.py as their user sees them: output, exit status, arguments, Ctrl-C."""
import signal
import time
import unittest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
from rosgraph_msgs.msg import Log
import rospy
import rostest

from harness import SHUTDOWN_RAISES, Group, bowls, eventually, printed_bowls


class Server:
    """Serves wash_dishes_as in this process, ten bowls a second; a negative goal is ABORTED after one bowl. outcomes:
    of the goals so far (str)."""

    def __init__(self):
        self.outcomes = []
        self.a_server = robust.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()

    def execute_cb(self, goal):
        # Until the client is connected; and actionlib's client can miss what comes while it sends.
        self.a_server.rate(2).sleep()
        result, rate = WashTheDishesResult(), self.a_server.rate(10)
        for bowl in bowls(abs(goal.number_of_minutes)):
            result.dishes_washed.append(bowl)
            self.a_server.publish_feedback(WashTheDishesFeedback(bowl))
            if not rate.sleep():
                self.a_server.set_preempted(result)
                self.outcomes.append("PREEMPTED")
                return
            if goal.number_of_minutes < 0:
                self.a_server.set_aborted(result, "out of water")
                self.outcomes.append("ABORTED")
                return
        self.a_server.set_succeeded(result)
        self.outcomes.append("SUCCEEDED")


class ClientTests:
    """What both clients promise."""

    script = None

    @classmethod
    def setUpClass(cls):
        if not rospy.core.is_initialized():
            rospy.init_node("client_test")
            ClientTests.server = Server()

    def setUp(self):
        self.nodes = Group()
        self.addCleanup(self.nodes.stop)
        del self.server.outcomes[:]

    def client(self, *arguments, **options):
        """Start the client. -> Process"""
        return self.nodes.node(self.script, *arguments, **options)

    def check(self, client, status, stdout, stderr=""):
        """Wait for the end of a client. Expect its exit status, stdout and a regex in stderr."""
        self.assertEqual((status, stdout), (client.wait(), client.stdout), client)
        if stderr:
            self.assertRegex(client.stderr, stderr, client)

    def check_refused(self, *wrong):
        """Start the client with arguments (list of str), and again with others. Expect that argparse refuses them."""
        for client in [self.client(*arguments) for arguments in wrong]:
            self.check(client, 2, "", "(?m)error: .*%s" % client.command[-1])

    def test_output_is_that_of_the_posts(self):
        feedback = "".join('Feedback received: last_dish_washed: "%s"\n' % bowl for bowl in bowls(7))
        result = "".join("  - %s\n" % bowl for bowl in bowls(7))
        self.check(self.client(), 0, feedback + "The result is: dishes_washed: \n" + result)

    def test_minutes_are_an_argument(self):
        client = self.client("1")
        self.assertEqual((0, (bowls(1), bowls(1))), (client.wait(), printed_bowls(client)), client)

    def test_each_feedback_is_printed_at_once(self):
        client = self.client("600")
        client.expect("bowl-2", timeout=10)  # what is not flushed comes later, when the pipe's buffer is full
        self.assertTrue(client.running(), client)

    def test_aborted_goal_says_why_and_exits_with_1(self):
        self.check(self.client("-1"), 1, 'Feedback received: last_dish_washed: "bowl-0"\n'
                   'The result is: dishes_washed: \n  - bowl-0\n', "ABORTED: out of water")

    def test_preempted_goal_prints_its_bowls_and_exits_with_1(self):
        client = self.client("600")
        client.expect("bowl-2")
        newer = self.client("0", "__name:=newer")
        self.assertEqual((1, 0), (client.wait(), newer.wait()), client)
        _, result = printed_bowls(client)
        self.assertEqual(bowls(max(3, len(result))), result, client)
        self.assertIn("PREEMPTED: a newer goal came", client.stderr, client)

    def test_client_waits_for_its_server(self):
        client = self.client("1", ROS_NAMESPACE="/later")
        self.nodes.node("action_server.py", ROS_NAMESPACE="/later")
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

    script = "action_client.py"

    def test_ctrl_c_lets_the_goal_go_on(self):
        client = self.client("15")
        client.expect("bowl-1")
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        self.assertNotIn("The result is", client.stdout, client)
        eventually(lambda: self.server.outcomes == ["SUCCEEDED"], "the goal succeeds")


class TestRobustActionClient(ClientTests, unittest.TestCase):

    script = "robust_action_client.py"

    def test_ctrl_c_cancels_the_goal_and_prints_its_bowls(self):
        client = self.client("600")
        client.expect("bowl-1")
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        self.assertEqual(["PREEMPTED"], self.server.outcomes, client)
        if not SHUTDOWN_RAISES:
            self.assertIn("goal PREEMPTED: cancelled", client.stderr, client)
            self.assertEqual(bowls(2), printed_bowls(client)[1][:2], client)

    def test_ctrl_c_while_it_waits_for_a_server(self):
        log = []
        rospy.Subscriber("/rosout", Log, lambda line: log.append(line.msg))
        client = self.client(ROS_NAMESPACE="/nowhere")
        # Not earlier: a signal in the midst of a call to the master blocks a node of rospy's.
        eventually(lambda: "waiting for the server of /nowhere/wash_dishes_as for 5 s" in log, "it waits", client)
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        if not SHUTDOWN_RAISES:
            self.assertIn("interrupted while waiting for the server of /nowhere/wash_dishes_as", client.stderr, client)

    def test_no_server_within_the_server_timeout(self):
        client = self.client("--server-timeout", "1", ROS_NAMESPACE="/nowhere")
        self.check(client, 1, "", "no server of /nowhere/wash_dishes_as within 1 s")

    def test_killed_server_is_lost(self):
        self.check_lost(signal.SIGKILL)

    def test_frozen_server_is_lost(self):
        self.check_lost(signal.SIGSTOP)

    def check_lost(self, number):
        """Send a server a signal in the midst of a goal. Expect its client to give up soon."""
        server = self.nodes.node("action_server.py", ROS_NAMESPACE="/lost")
        client = self.client("600", "--heartbeat-timeout", "1", ROS_NAMESPACE="/lost")
        client.expect(r"bowl-\d")
        server.signal(number)
        begun = time.monotonic()
        self.assertEqual(1, client.wait(), client)
        self.assertLess(time.monotonic() - begun, 5, client)
        self.assertIn("goal LOST: server lost: silent for 1", client.stderr, client)
        self.assertIsNone(printed_bowls(client)[1], client)

    def test_heartbeat_timeout_0_is_no_limit(self):
        client = self.client("1", "--heartbeat-timeout", "0")
        self.assertEqual((0, (bowls(1), bowls(1))), (client.wait(), printed_bowls(client)), client)

    def test_wrong_timeouts_are_refused(self):
        self.check_refused(["--server-timeout", "-1"], ["--heartbeat-timeout", "-1"], ["--heartbeat-timeout", "nan"])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "client", "client_test")
