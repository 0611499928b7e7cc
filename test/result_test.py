#!/usr/bin/python3
"""The result lists the bowls that feedback named, all of them and no others, whatever the ending."""
import rostest

from probe import ABORTED, PREEMPTED, SUCCEEDED, bowls
from server_case import ServerCase


class TestResult(ServerCase):

    def test_result_lists_what_feedback_named(self):
        goal_id = self.probe.send(7)
        self.wash(goal_id, 7)
        self.clock.turn(1, self.probe)
        result = self.probe.wait_result(goal_id)
        self.assertEqual(self.probe.bowls_of(goal_id), result.result.dishes_washed)
        self.check_ending(goal_id, SUCCEEDED, bowls(7))

    def test_result_comes_when_the_last_second_is_over(self):
        begun = self.clock.now
        goal_id = self.probe.send(3)
        self.wash(goal_id, 3)
        self.clock.turn(1, self.probe)
        result = self.probe.wait_result(goal_id)
        self.assertEqual(3.0, (result.header.stamp - begun).to_sec(), "second of the result on the ROS clock")

    def test_nothing_of_an_earlier_goal_is_left(self):
        for minutes, washed, state in ((4, 3, PREEMPTED), (2, 1, PREEMPTED), (-3, 0, ABORTED), (0, 0, SUCCEEDED)):
            goal_id = self.probe.send(minutes)
            self.wash(goal_id, washed)
            if state == PREEMPTED:
                self.probe.cancel(goal_id)
            self.check_ending(goal_id, state, bowls(washed))

    def test_results_are_not_changed_by_later_goals(self):
        goals = []
        for washed in (3, 1):
            goals.append((self.probe.send(9), washed))
            self.wash(*goals[-1])
        self.probe.cancel()
        for goal_id, washed in goals:
            self.check_ending(goal_id, PREEMPTED, bowls(washed))

    def test_texts_say_why(self):
        cancelled = self.probe.send(5)
        self.wash(cancelled, 2)
        self.probe.cancel(cancelled)
        self.assertIn("cancelled", self.probe.wait_result(cancelled).status.text)
        refused = self.probe.send(-3)
        self.assertIn("-3", self.probe.wait_result(refused).status.text)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "result", TestResult)
