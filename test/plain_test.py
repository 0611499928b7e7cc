#!/usr/bin/python3
"""The plain server does what the README shows of it: it washes, and looks once a second whether to stop."""
import rospy
import rostest

from processes import bowls
from raw_client import ABORTED, PENDING, PREEMPTED, PREEMPTING, SUCCEEDED
from scenes import ServerCase


class TestPlain(ServerCase):

    script = "plain_action_server.py"

    def cancel(self, goal_id):
        self.scene.cancel(goal_id)
        self.scene.wait(lambda: PREEMPTING in self.scene.states.get(goal_id, []), "%s asked to stop" % goal_id)

    def test_bowl_each_second_then_all_of_them_and_negative_minutes_are_aborted_with_the_reason(self):
        self.finish(self.wash(3, 1), 3)
        self.assertIn("0 or more", self.scene.check_ending(self.scene.send(-3), ABORTED, []).status.text)

    def test_cancel_waits_for_the_end_of_the_second(self):
        goal_id = self.wash(5, 2)
        self.cancel(goal_id)
        self.clock.turn(0.75, self.scene)
        self.assertNotIn(goal_id, self.scene.results)
        self.clock.turn(0.25)
        self.scene.check_ending(goal_id, PREEMPTED, bowls(2))

    def test_newer_goal_waits_for_the_end_of_the_second_and_a_cancel_in_the_last_one_is_ignored(self):
        older = self.wash(5, 2)
        newer = self.scene.send(1)
        self.scene.wait_result(self.scene.send(0, stamp=rospy.Time(1)))  # refused for its stamp, once newer is there
        self.clock.turn(0.75, self.scene)
        self.assertEqual([PENDING], self.scene.states[newer])
        self.clock.turn(0.25)
        self.scene.check_ending(older, PREEMPTED, bowls(2))
        self.scene.wait_bowls(newer, 1)  # with the clock standing still, or we may turn it on too early
        self.cancel(newer)
        self.clock.turn(1)
        self.scene.check_ending(newer, SUCCEEDED, bowls(1))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "plain", TestPlain)
