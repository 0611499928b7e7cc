#!/usr/bin/env python3
"""Feedback: one for each bowl, once a second, and for its own goal only."""
import time
import unittest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy
import rostest

from harness import eventually, wait_connected


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


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "feedback", TestFeedback)
