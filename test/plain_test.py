#!/usr/bin/python3
"""The plain server does what the README shows of it: it washes, and looks once a second whether to stop."""
import rospy
import rostest

from processes import bowls
from raw_client import ABORTED, PENDING, PREEMPTED, PREEMPTING, SUCCEEDED
from scenes import ServerCase


class TestPlain(ServerCase):

    script = "plain_action_server.py"

    def wait_asked_to_stop(self, goal_id):
        self.scene.wait(lambda: PREEMPTING in self.scene.states.get(goal_id, []), "%s asked to stop" % goal_id)

    def test_bowl_each_second_then_all_of_them(self):
        self.finish(self.wash(3, 1), 3)

    def test_negative_minutes_are_aborted_with_the_reason(self):
        self.assertIn("0 or more", self.scene.check_ending(self.scene.send(-3), ABORTED, []).status.text)

    def test_cancel_waits_for_the_end_of_the_second(self):
        goal_id = self.wash(5, 2)
        self.scene.cancel(goal_id)
        self.wait_asked_to_stop(goal_id)
        self.clock.turn(0.75, self.scene)
        self.assertNotIn(goal_id, self.scene.results)
        self.clock.turn(0.25)
        self.scene.check_ending(goal_id, PREEMPTED, bowls(2))

    def test_newer_goal_waits_for_the_end_of_the_second(self):
        older = self.wash(5, 2)
        newer = self.scene.send(1)
        self.scene.wait_result(self.scene.send(0, stamp=rospy.Time(1)))  # refused for its stamp, once newer is there
        self.clock.turn(0.75, self.scene)
        self.assertEqual([PENDING], self.scene.states[newer])
        self.clock.turn(0.25)
        self.scene.check_ending(older, PREEMPTED, bowls(2))
        self.scene.wait_bowls(newer, 1)  # with the clock standing still, or finish() may turn it on too early
        self.finish(newer, 1)

    def test_cancel_in_the_last_second_is_ignored(self):
        goal_id = self.wash(1, 1)
        self.scene.cancel(goal_id)
        self.wait_asked_to_stop(goal_id)
        self.clock.turn(1)
        self.scene.check_ending(goal_id, SUCCEEDED, bowls(1))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "plain", TestPlain)
