#!/usr/bin/env python3
"""Feedback: one for each bowl, once a second, and for its own goal only."""
import time
import unittest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy
import rostest

from harness import NAMES, SUCCEEDED, Group, RawClient, bowls, check_client, eventually, wait_connected


class TestFeedback(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("feedback_test")
        cls.client = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
        wait_connected(cls.client)

    def test_three_minutes_give_three_feedbacks(self):
        feedback = []
        self.client.send_goal(WashTheDishesGoal(number_of_minutes=3), feedback_cb=feedback.append)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)))
        self.assertEqual(["bowl-0", "bowl-1", "bowl-2"], [one.last_dish_washed for one in feedback])

    def test_no_minutes_give_no_feedback(self):
        feedback = []
        self.client.send_goal(WashTheDishesGoal(number_of_minutes=0), feedback_cb=feedback.append)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)))
        self.assertEqual([], feedback)

    def test_negative_minutes_give_no_feedback(self):
        feedback = []
        self.client.send_goal(WashTheDishesGoal(number_of_minutes=-3), feedback_cb=feedback.append)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)))
        self.assertEqual([], feedback)

    def test_feedback_comes_once_a_second(self):
        times = []
        self.client.send_goal(
            WashTheDishesGoal(number_of_minutes=2), feedback_cb=lambda _: times.append(time.monotonic()))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)))
        self.assertAlmostEqual(1, times[1] - times[0], delta=0.7)

    def test_first_feedback_comes_at_once(self):
        times, begun = [], time.monotonic()
        self.client.send_goal(
            WashTheDishesGoal(number_of_minutes=1), feedback_cb=lambda _: times.append(time.monotonic()))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)))
        self.assertLess(times[0] - begun, 0.7)

    def test_feedback_is_for_its_own_goal_only(self):
        newer, of_older, of_newer = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction), [], []
        wait_connected(newer)
        self.client.send_goal(WashTheDishesGoal(number_of_minutes=5), feedback_cb=of_older.append)
        eventually(lambda: of_older, "feedback for the older goal")
        newer.send_goal(WashTheDishesGoal(number_of_minutes=2), feedback_cb=of_newer.append)
        self.assertTrue(newer.wait_for_result(rospy.Duration(10)))
        self.assertEqual(["bowl-0"], [one.last_dish_washed for one in of_older])
        self.assertEqual(["bowl-0", "bowl-1"], [one.last_dish_washed for one in of_newer])

    def test_feedback_stops_after_a_cancel(self):
        raw = RawClient().wait_connected()  # SimpleActionClient of actionlib drops feedback that comes after the result
        self.addCleanup(raw.close)
        cancelled = raw.send(5)
        raw.wait_bowls(cancelled, 1)
        raw.cancel(cancelled)
        result = raw.wait_result(cancelled)
        self.assertEqual("PREEMPTED", NAMES[result.status.status])
        raw.check_outcome(raw.send(2), SUCCEEDED, bowls(2))  # 2 s, and its feedback comes after any of the cancelled
        self.assertEqual(result.result.dishes_washed, raw.bowls_of(cancelled), "feedback after the end: %s" % raw)

    def test_two_clients_receive_the_same_feedback(self):
        raw = RawClient().wait_connected()
        self.addCleanup(raw.close)
        with Group() as group:
            check_client(group.node("robust_action_client.py", "3"), 0, 3)
        raw.wait(lambda: raw.results, "the result of the other node's goal")
        goal_id, = raw.results
        raw.check_outcome(goal_id, SUCCEEDED, bowls(3))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "feedback", TestFeedback)
