#!/usr/bin/env python3
"""The result: the bowls of its own goal only, with the state and the text of the status."""
from actions_tutorial.msg import WashTheDishesGoal
from parameterized import parameterized
import rostest

from support.action_case import ActionTest
from support.printed import bowls


class TestResult(ActionTest):

    @parameterized.expand([("washed", 1), ("aborted", -1)])
    def test_next_goal_has_a_result_of_its_own(self, _, minutes):
        for number in 1, minutes:
            self.send(WashTheDishesGoal(number_of_minutes=number))
            self.assertEqual(bowls(number), self.client.get_result().dishes_washed)

    def test_result_and_status_agree(self):
        goal_id = self.raw.send(0)
        result = self.raw.wait_result(goal_id)
        listed, = [one for one in self.raw.status.status_list if one.goal_id.id == goal_id]
        self.assertEqual((result.status.status, result.status.text), (listed.status, listed.text))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "result", TestResult)
