#!/usr/bin/env python3
"""Feedback: at once and then once a second, for its own goal only, until the goal is over."""
import time

from actions_tutorial.msg import WashTheDishesGoal
from parameterized import parameterized
import rospy
import rostest

from support.action_case import ActionTest
from support.printed import bowls
from support.processes import Group, eventually
from support.raw_client import RawClient
from support.states import PREEMPTED, SUCCEEDED


class TestFeedback(ActionTest):

    @parameterized.expand([("at_first", 0), ("after_idle_seconds", 2)])
    def test_feedback_comes_at_once_and_then_once_a_second(self, _, idle):
        time.sleep(idle)
        times, begun = [], time.monotonic()
        self.send(WashTheDishesGoal(number_of_minutes=2), feedback_cb=lambda _: times.append(time.monotonic()))
        self.assertLess(times[0] - begun, 0.7)
        self.assertAlmostEqual(1, times[1] - times[0], delta=0.7)

    def test_feedback_is_for_its_own_goal_only(self):
        older = []
        self.start(WashTheDishesGoal(number_of_minutes=5), feedback_cb=older.append)
        eventually(lambda: older, "feedback for the older goal")
        self.raw.check_outcome(self.raw.send(2), SUCCEEDED, bowls(2))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(20)), "no outcome")
        self.assertEqual(self.client.get_result().dishes_washed, [one.last_dish_washed for one in older])

    def test_feedback_stops_after_a_cancel(self):
        cancelled = self.raw.send(5)  # by raw: actionlib's client drops feedback that comes after the result
        self.raw.wait_bowls(cancelled, 1)
        self.raw.cancel(cancelled)
        result = self.raw.wait_result(cancelled)
        self.assertEqual(PREEMPTED, result.status.status)
        self.raw.check_outcome(self.raw.send(2), SUCCEEDED, bowls(2))  # its feedback comes after any of the cancelled
        self.assertEqual(result.result.dishes_washed, self.raw.bowls_of(cancelled), "after the end: %s" % self.raw)

    def test_feedback_reaches_all_nodes(self):
        raw = RawClient().wait_connected()
        self.addCleanup(raw.close)
        with Group() as group:
            self.assertEqual(0, group.node("action_client.py", "3").wait())
        raw.wait(lambda: raw.results, "the result of the other node's goal")
        goal_id, = raw.results
        raw.check_outcome(goal_id, SUCCEEDED, bowls(3))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "feedback", TestFeedback)
