#!/usr/bin/python3
"""Servers and clients that were written for actionlib run on robust unchanged, and hear of a wrong parameter; the
actions are actionlib's own."""
import re
import sys
import threading
import unittest
from unittest import mock

import actionlib
import rosgraph
import rospy
import rostest
from actionlib.msg import TestAction, TestGoal, TestResult
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalStatus

from actions_tutorial import robust
from processes import eventually

PATIENCE = rospy.Duration(50)


class ByCallback:
    """A server without execute_cb: it takes goals up in a callback of its own, and ends them when told to."""

    def __init__(self, name):
        self.server = robust.SimpleActionServer(name, TestAction, auto_start=False)
        self.server.register_goal_callback(self.goal_cb)
        self.server.register_preempt_callback(self.preempt_cb)
        self.server.start()

    def goal_cb(self):
        self.before = self.server.current_goal.get_goal()
        goal = self.server.accept_new_goal()
        if goal.goal == 0:
            self.server.set_succeeded(TestResult(1))

    def preempt_cb(self):
        self.server.set_preempted(TestResult(2))


class Compatibility(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("compatibility", disable_signals=True)
        cls.by_callback = ByCallback("by_callback")

    def ends(self, client, state):
        self.assertTrue(client.wait_for_result(PATIENCE))
        self.assertEqual(state, client.get_state())

    def test_goal_callback_with_a_client_of_actionlib_and_of_ours(self):
        for kind in actionlib.SimpleActionClient, robust.SimpleActionClient:
            client = kind("by_callback", TestAction)
            self.assertTrue(client.wait_for_server(PATIENCE))
            if kind is robust.SimpleActionClient:  # actionlib's can lose an ending that comes while it sends the goal
                client.send_goal(TestGoal(0))
                self.ends(client, GoalStatus.SUCCEEDED)
                self.assertEqual(1, client.get_result().result)
            client.send_goal(TestGoal(5))
            eventually(lambda: client.get_state() == GoalStatus.ACTIVE, "the goal ACTIVE")
            client.cancel_goal()
            self.ends(client, GoalStatus.PREEMPTED)
            self.assertEqual((2, "cancelled"), (client.get_result().result, client.get_goal_status_text()))
        self.assertEqual(TestGoal(0), self.by_callback.before)

    def test_server_of_actionlib_that_has_lost_sight_of_the_client(self):
        client = robust.SimpleActionClient("late", TestAction)
        for what in "goal", "cancel":  # so that the server does not hear of them
            rosgraph.Master(rospy.get_name()).unregisterPublisher("/late/" + what, rospy.get_node_uri())
        actionlib.SimpleActionServer("late", TestAction, lambda goal: None, True)
        self.assertTrue(client.wait_for_server(PATIENCE))
        self.assertEqual([1, 1], [topic.get_num_connections() for topic in (
            client.action_client.pub_goal, client.action_client.pub_cancel)])

    def test_wrong_parameter_of_actionlib_is_named_with_its_value_and_what_is_allowed(self):
        client, server = robust.SimpleActionClient, robust.SimpleActionServer
        for kind, name, values in (
                (server, "/actionlib_status_frequency", (0, -1, float("nan"), float("inf"), 1e12, 1e6, "fast")),
                (server, rospy.get_name() + "/actionlib_status_frequency", [0]),  # actionlib looks in the node's, too
                (server, "work/status_frequency", [0]), (server, "work/status_list_timeout", ["long", -1]),
                *((kind, "actionlib_%s_%s_queue_size" % (side, way), ["long"]) for way in ("pub", "sub")
                  for side, kind in (("server", server), ("client", client)))):
            for value in values:
                rospy.set_param(name, value)
                words = r"^the \S.* cannot start: \S*{0} is {1}, must be .*`rosparam delete /\S*{0}`".format(
                    name.rpartition("/")[2], re.escape(repr(value)))
                with mock.patch.object(sys, "argv", []), self.assertRaisesRegex(rospy.ROSInitException, words):
                    kind("work", TestAction)
                rospy.delete_param(name)

    def test_client_that_makes_the_parts_itself(self):
        class Own(robust.SimpleActionClient):
            def __init__(self, name):
                self.action_client = actionlib.ActionClient(name, TestAction)
                self.simple_state, self.gh, self.done_condition = SimpleGoalState.DONE, None, threading.Condition()

        self.assertTrue(Own("by_callback").wait_for_server(PATIENCE))
        client = Own("by_callback")
        client.send_goal(TestGoal(0))
        self.ends(client, GoalStatus.SUCCEEDED)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "compatibility", Compatibility)
