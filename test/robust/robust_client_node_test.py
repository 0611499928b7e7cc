#!/usr/bin/env python3
"""robust_action_client.py with robust_action_server.py, as its user sees it; and each with the plain one."""
import signal
import time
import unittest

from parameterized import parameterized
from rosgraph_msgs.msg import Log
import rospy
import rostest

from client_test import ClientTests
from support.printed import bowls, printed_bowls
from support.processes import eventually
from support.states import PREEMPTED


class TestRobustActionClient(ClientTests, unittest.TestCase):

    client_script, server_script = "robust_action_client.py", "robust_action_server.py"
    aborted = "goal ABORTED: number_of_minutes is -1, must be 0 or more"
    preempted, tries = "goal PREEMPTED: a newer goal came", 1

    def test_ctrl_c_cancels_the_goal_and_prints_its_bowls(self):
        client = self.client("600")
        goal_id = self.goal_of(client)
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        result = self.raw.wait_result(goal_id)
        self.assertEqual(PREEMPTED, result.status.status)
        self.assertIn("goal PREEMPTED: cancelled", client.stderr, client)
        self.assertEqual(result.result.dishes_washed, printed_bowls(client)[1], client)

    def test_ctrl_c_while_it_waits_for_a_server(self):
        log = []
        rospy.Subscriber("/rosout", Log, lambda line: log.append(line.msg))
        client = self.client(ROS_NAMESPACE="/nowhere")
        # Not earlier: a signal in the midst of a call to the master blocks a node of rospy's.
        eventually(lambda: "waiting for the server of /nowhere/wash_dishes_as for 5 s" in log, "it waits", client)
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        self.assertIn("interrupted while waiting for the server of /nowhere/wash_dishes_as", client.stderr, client)

    def test_no_server_within_the_server_timeout(self):
        client = self.client("--server-timeout", "1", ROS_NAMESPACE="/nowhere")
        self.assertEqual((1, ""), (client.wait(), client.stdout), client)
        self.assertIn("no server of /nowhere/wash_dishes_as within 1 s", client.stderr, client)

    @parameterized.expand([("killed", signal.SIGKILL, 5), ("frozen", signal.SIGSTOP, 1)])
    def test_server_is_lost_that_was(self, _, number, timeout):
        server = self.nodes.node(self.server_script, ROS_NAMESPACE="/lost")
        options = [] if timeout == 5 else ["--heartbeat-timeout", str(timeout)]  # 5 is the default
        client = self.client("600", *options, ROS_NAMESPACE="/lost")
        client.expect(r"bowl-\d")
        server.signal(number)
        begun = time.monotonic()
        self.assertEqual(1, client.wait(), client)
        self.assertLess(time.monotonic() - begun, timeout + 4, client)
        self.assertIn("goal LOST: server lost: silent for %d" % timeout, client.stderr, client)
        self.assertIsNone(printed_bowls(client)[1], client)

    def test_heartbeat_timeout_0_is_no_limit(self):
        client = self.client("1", "--heartbeat-timeout", "0")
        self.assertEqual((0, (bowls(1), bowls(1))), (client.wait(), printed_bowls(client)), client)

    def test_wrong_timeouts_are_refused(self):
        self.check_refused(["--server-timeout", "-1"], ["--heartbeat-timeout", "-1"], ["--heartbeat-timeout", "nan"])

    def test_plain_client_with_the_robust_server(self):
        client = self.nodes.node("action_client.py", "2")
        self.assertEqual((0, bowls(2)), (client.wait(), printed_bowls(client)[1]), client)

    def test_robust_client_with_the_plain_server(self):
        self.nodes.node("action_server.py", ROS_NAMESPACE="/plain")
        client = self.client("2", ROS_NAMESPACE="/plain")
        self.assertEqual((0, (bowls(2), bowls(2))), (client.wait(), printed_bowls(client)), client)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_client_node", TestRobustActionClient)
