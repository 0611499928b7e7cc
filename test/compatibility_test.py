#!/usr/bin/python3
"""Servers and clients that were written for actionlib run on robust unchanged; the actions are actionlib's own."""
import threading
import time
import unittest
from unittest import mock

import actionlib
import rosgraph
import rospy
import rostest
from actionlib.action_client import CommStateMachine
from actionlib.msg import (
    TestAction, TestActionFeedback, TestActionGoal, TestActionResult, TestFeedback, TestGoal, TestResult)
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalStatus
from rospy.impl import masterslave

from actions_tutorial import robust
from processes import eventually

PATIENCE = rospy.Duration(50)
POLL = 0.1  # s that actionlib waits between two goals


class ByCallback:
    """A server without execute_cb: it takes goals up in a callback of its own, and ends them when told to."""

    def __init__(self, name):
        self.server = robust.SimpleActionServer(name, TestAction, auto_start=False)
        self.server.register_goal_callback(self.goal_cb)
        self.server.register_preempt_callback(self.preempt_cb)
        self.server.start()

    def goal_cb(self):
        goal = self.server.accept_new_goal()
        if goal.goal == 0:
            self.server.set_succeeded(TestResult(1))

    def preempt_cb(self):
        self.server.set_preempted(TestResult(2))


class BySubclass(robust.SimpleActionServer):
    """A server that is a SimpleActionServer and looks for a cancel itself; started by its constructor."""

    def __init__(self, name):
        super().__init__(name, TestAction, self.execute_cb, True)

    def execute_cb(self, goal):
        rate = rospy.Rate(50)
        if goal.goal == 1:
            raise RuntimeError("broken")
        if goal.goal == 2:
            return
        if goal.goal == 4:
            self.publish_feedback(TestFeedback(4))
        while goal.goal == 3:
            self.publish_feedback(TestFeedback(3))
            if self.is_preempt_requested():
                self.set_preempted()
                return
            rate.sleep()
        self.set_succeeded()


class Compatibility(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("compatibility", disable_signals=True)
        cls.by_callback, cls.by_subclass = ByCallback("by_callback"), BySubclass("by_subclass")

    def client(self, name, kind=robust.SimpleActionClient, **options):
        client = kind(name, TestAction, **options)
        self.assertTrue(client.wait_for_server(PATIENCE))
        return client

    def ending(self, client, goal):
        client.send_goal(TestGoal(goal))
        self.assertTrue(client.wait_for_result(PATIENCE))
        return client.get_state()

    def test_goal_callback_with_a_client_of_actionlib_and_of_ours(self):
        for kind in actionlib.SimpleActionClient, robust.SimpleActionClient:
            client = self.client("by_callback", kind)
            if kind is robust.SimpleActionClient:  # actionlib's can lose an ending that comes while it sends the goal
                self.assertEqual(GoalStatus.SUCCEEDED, self.ending(client, 0))
                self.assertEqual(1, client.get_result().result)
            client.send_goal(TestGoal(5))
            eventually(lambda: client.get_state() == GoalStatus.ACTIVE, "the goal ACTIVE")
            client.cancel_goal()
            self.assertTrue(client.wait_for_result(PATIENCE))
            self.assertEqual((GoalStatus.PREEMPTED, 2, "cancelled"), (
                client.get_state(), client.get_result().result, client.get_goal_status_text()))

    def test_server_by_inheritance_ends_each_goal(self):
        client = self.client("by_subclass")
        for goal, state in ((0, GoalStatus.SUCCEEDED), (1, GoalStatus.ABORTED), (2, GoalStatus.ABORTED)):
            self.assertEqual(state, self.ending(client, goal), goal)

    def test_last_feedback_has_a_start_before_the_result(self):
        stamps = {}
        for what, kind in ("feedback", TestActionFeedback), ("result", TestActionResult):
            topic = rospy.Subscriber("by_subclass/" + what, kind, lambda message, what=what: stamps.update(
                {(message.status.goal_id.id, what): message.header.stamp.to_sec()}))
            self.addCleanup(topic.unregister)
        client = self.client("by_subclass")

        def both():
            self.assertEqual(GoalStatus.SUCCEEDED, self.ending(client, 4))
            return [at - stamps[goal_id, "feedback"] for (goal_id, what), at in dict(stamps).items()
                    if what == "result" and (goal_id, "feedback") in stamps]

        self.assertGreater(eventually(both, "feedback and result of one goal")[0], 0.019, "s between the two")

    def test_poll_for_a_cancel_with_rospys_rate(self):
        client, heard = self.client("by_subclass"), threading.Event()
        client.send_goal(TestGoal(3), feedback_cb=lambda msg: heard.set())
        self.assertTrue(heard.wait(30))
        client.cancel_goal()
        self.assertTrue(client.wait_for_result(PATIENCE))
        self.assertEqual(GoalStatus.PREEMPTED, client.get_state())

    def test_no_goal_falls_into_a_pause_of_the_library(self):
        """Most of them would, and each then takes up to POLL; one that a busy machine makes late does not count."""
        client = self.client("by_subclass")
        waits = []
        for _ in range(50):
            begun = time.monotonic()
            self.assertEqual(GoalStatus.SUCCEEDED, self.ending(client, 0))
            waits.append(time.monotonic() - begun)
        self.assertLess(sorted(waits)[len(waits) // 2], POLL / 2, "median of the s a goal takes: %s" % waits)

    def test_answer_that_comes_before_send_goal_returns_is_not_lost(self):
        client = self.client("by_callback")
        for _ in range(100):
            endings = []
            client.send_goal(TestGoal(0), done_cb=lambda state, result: endings.append(state))
            self.assertTrue(client.wait_for_result(PATIENCE))
            self.assertEqual([GoalStatus.SUCCEEDED], endings)

    def test_server_of_actionlib_that_has_lost_sight_of_the_client(self):
        client = robust.SimpleActionClient("late", TestAction)
        for what in "goal", "cancel":  # so that the server does not hear of them
            rosgraph.Master(rospy.get_name()).unregisterPublisher("/late/" + what, rospy.get_node_uri())
        actionlib.SimpleActionServer("late", TestAction, lambda goal: None, True)
        self.assertTrue(client.wait_for_server(PATIENCE))
        self.assertEqual([1, 1], [topic.get_num_connections() for topic in (
            client.action_client.pub_goal, client.action_client.pub_cancel)])

    def test_server_whose_node_does_not_tell_of_its_connections(self):
        with mock.patch.object(masterslave.ROSHandler, "getBusInfo", lambda *_: (1, "", [])):
            self.client("by_subclass")

    def test_client_that_was_stopped_says_so_to_whoever_waits_for_its_server(self):
        client = self.client("by_subclass")
        client.action_client.stop()
        with self.assertRaises(AttributeError):  # as actionlib
            client.wait_for_server(PATIENCE)

    def test_callbacks_that_a_program_sets_later_count_and_it_sees_done_when_done_cb_is_through(self):
        client, heard = self.client("by_subclass"), []
        client.send_goal(TestGoal(3))
        client.feedback_cb = lambda feedback: heard.append("feedback")
        client.done_cb = lambda state, result: heard.append(client.simple_state)
        eventually(lambda: heard, "feedback")
        client.cancel_goal()
        self.assertTrue(client.wait_for_result(PATIENCE))
        self.assertEqual({"feedback", SimpleGoalState.ACTIVE}, set(heard))
        self.assertEqual(SimpleGoalState.DONE, client.simple_state)

    def test_client_that_makes_the_parts_or_the_handle_itself(self):
        class Own(robust.SimpleActionClient):
            def __init__(self, name):
                self.action_client = actionlib.ActionClient(name, TestAction)
                self.simple_state, self.gh, self.done_condition = SimpleGoalState.DONE, None, threading.Condition()

        client = Own("by_subclass")
        self.assertEqual(GoalStatus.SUCCEEDED, self.ending(client, 0))
        client.gh = actionlib.ClientGoalHandle(CommStateMachine(TestActionGoal(), None, None, None, print))
        client.cancel_goal()
        self.assertEqual(GoalStatus.PENDING, client.get_state())

    def test_silent_server_is_lost(self):
        client, done = self.client("by_callback", heartbeat_timeout=1.0), []
        client.send_goal(TestGoal(5), done_cb=lambda state, result: done.append(state))
        eventually(lambda: client.get_state() == GoalStatus.ACTIVE, "the goal ACTIVE")
        with self.by_callback.server.action_server.lock:  # no status comes while it is held
            self.assertFalse(client.wait_for_result(PATIENCE))
        self.assertEqual((GoalStatus.LOST, [GoalStatus.LOST]), (client.get_state(), done))
        self.assertIn("server lost: silent for", client.get_goal_status_text())

    def test_time_out_of_wait_for_server_and_result(self):
        nobody = robust.SimpleActionClient("nobody", TestAction)
        for timeout in rospy.Duration(0.2), 0.2:
            self.assertFalse(nobody.wait_for_server(timeout))
        client = self.client("by_callback")
        client.send_goal(TestGoal(5))
        self.assertFalse(client.wait_for_result(rospy.Duration(0.2)))
        self.assertEqual(GoalStatus.ACTIVE, client.get_state())
        client.cancel_goal()
        self.assertTrue(client.wait_for_result(PATIENCE))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "compatibility", Compatibility)
