#!/usr/bin/python3
"""A cancel or a newer goal ends a goal at once, at any moment of it, with the bowls washed so far.

The clock stands still while these tests wait: a server that looks for a cancel now and then would never answer.
"""
import rostest
import rospy

from processes import bowls
from raw_client import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED
from scenes import ServerCase


class TestPreempt(ServerCase):

    def check_cancel(self, **cancel):
        goal_id = self.wash(5, 3)
        self.clock.turn(0.5, self.scene)
        self.scene.cancel(**cancel or {"goal_id": goal_id})
        self.assertIn("cancelled", self.scene.check_ending(goal_id, PREEMPTED, bowls(3)).status.text)

    def test_cancel_of_the_goal(self):
        self.check_cancel()

    def test_cancel_of_all_goals(self):
        self.check_cancel(goal_id="")

    def test_cancel_of_goals_before_a_stamp(self):
        self.check_cancel(stamp=self.clock.now + rospy.Duration(1))
        self.clock.turn(2, self.scene)  # goals up to that stamp stay cancelled

    def test_cancel_of_goals_before_an_earlier_stamp_leaves_the_goal_alone(self):
        goal_id = self.wash(2, 1)
        self.scene.cancel(stamp=self.clock.now - rospy.Duration(1))
        self.finish(goal_id, 2)

    def test_cancel_in_the_first_instant(self):
        goal_id = self.scene.send(5)
        self.scene.cancel(goal_id)
        result = self.scene.wait_result(goal_id)
        washed = result.result.dishes_washed
        self.assertIn((result.status.status, washed), [
            (RECALLED, []), (PREEMPTED, []), (PREEMPTED, bowls(1))], str(self.scene))
        self.scene.wait(lambda: self.scene.bowls_of(goal_id) == washed, "feedback of %s" % washed)

    def test_cancel_before_the_goal_itself_comes(self):
        goal_id = "early"
        self.scene.cancel(goal_id)
        self.scene.wait(lambda: self.clock.turn(0.25) or goal_id in self.scene.states, "the cancel to be kept")
        self.scene.send(5, goal_id)
        self.assertIn("cancelled", self.scene.check_ending(goal_id, RECALLED, []).status.text)
        self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])
        self.assertNotIn("ignored", self.scene.processes[0].stderr)

    def test_cancel_in_the_last_second(self):
        goal_id = self.wash(3, 3)
        self.clock.turn(0.999, self.scene)
        self.scene.cancel(goal_id)
        self.scene.check_ending(goal_id, PREEMPTED, bowls(3))

    def test_cancel_twice(self):
        goal_id = self.wash(3, 2)
        self.scene.cancel(goal_id)
        self.scene.cancel(goal_id)
        self.scene.check_ending(goal_id, PREEMPTED, bowls(2))
        self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])
        self.scene.check_ending(goal_id, PREEMPTED, bowls(2))

    def test_cancel_of_an_ended_or_unknown_goal_changes_nothing(self):
        ended = self.scene.send(0)
        self.scene.check_ending(ended, SUCCEEDED, [])
        goal_id = self.wash(2, 1)
        self.scene.cancel(ended)
        self.scene.cancel("nobody's")
        self.finish(goal_id, 2)
        self.scene.check_ending(ended, SUCCEEDED, [])

    def test_newer_goal_takes_over_at_once(self):
        older = self.wash(5, 2)
        newer = self.scene.send(1)
        self.scene.wait_bowls(newer, 1)  # with the clock standing still
        result = self.scene.check_ending(older, PREEMPTED, bowls(2))
        self.assertIn("newer goal", result.status.text)
        self.scene.wait(lambda: ACTIVE in self.scene.states.get(newer, []), "the newer goal ACTIVE")
        self.finish(newer, 1)
        self.assertEqual(1, self.scene.active_at_once, "goals ACTIVE at once")

    def test_newer_goal_in_the_last_second(self):
        older = self.wash(1, 1)
        self.clock.turn(0.999, self.scene)
        newer = self.scene.send(0)
        self.scene.check_ending(older, PREEMPTED, bowls(1))
        self.scene.check_ending(newer, SUCCEEDED, [])

    def test_newer_negative_goal_preempts_too(self):
        older = self.wash(5, 1)
        newer = self.scene.send(-3)
        self.scene.check_ending(older, PREEMPTED, bowls(1))
        self.scene.check_ending(newer, ABORTED, [])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "preempt", TestPreempt)
