#!/usr/bin/env python3
"""The result: all bowls of its own goal, once, with a state and a text."""
from actions_tutorial.msg import WashTheDishesGoal
import rospy
import rostest

from support.action_case import ActionTest
from support.states import PREEMPTED, SUCCEEDED


class TestResult(ActionTest):

    def wash(self, minutes):
        """Send a goal and wait until it is over. Returns the bowls of its result."""
        self.send(WashTheDishesGoal(number_of_minutes=minutes))
        return self.client.get_result().dishes_washed

    def test_result_lists_all_bowls(self):
        self.assertEqual(["bowl-0", "bowl-1", "bowl-2"], self.wash(3))

    def test_result_of_no_minutes_is_empty(self):
        self.assertEqual([], self.wash(0))

    def test_result_of_an_aborted_goal_is_empty(self):
        self.wash(1)
        self.assertEqual([], self.wash(-1))

    def test_two_goals_share_nothing(self):
        self.assertEqual(["bowl-0"], self.wash(1))
        self.assertEqual(["bowl-0"], self.wash(1))

    def test_result_comes_once(self):
        goal_id = self.raw.send(0)
        self.raw.wait_result(goal_id)
        self.wash(0)  # what was sent twice would have come before its result
        self.assertEqual(1, len(self.raw.results[goal_id]))

    def test_result_and_status_agree(self):
        goal_id = self.raw.send(0)
        result = self.raw.wait_result(goal_id)
        listed, = [one for one in self.raw.status.status_list if one.goal_id.id == goal_id]
        self.assertEqual((result.status.status, result.status.text), (listed.status, listed.text))

    def test_text_of_a_goal_that_succeeded(self):
        self.wash(0)
        self.assertEqual(rospy.get_param("text_succeeded", ""), self.client.get_goal_status_text())

    def test_text_of_a_cancelled_goal(self):
        goal_id = self.raw.send(5)
        self.raw.wait_bowls(goal_id, 1)
        self.raw.cancel(goal_id)
        status = self.raw.wait_result(goal_id).status
        self.assertEqual((PREEMPTED, rospy.get_param("text_cancelled", "")), (status.status, status.text))

    def test_text_of_a_goal_that_made_way_for_a_newer_one(self):
        older = self.raw.send(5)
        self.raw.wait_bowls(older, 1)
        self.raw.check_outcome(self.raw.send(0), SUCCEEDED, [])
        status = self.raw.wait_result(older).status
        self.assertEqual((PREEMPTED, rospy.get_param("text_newer_goal", "")), (status.status, status.text))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "result", TestResult)
