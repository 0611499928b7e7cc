#!/usr/bin/python3
"""Endings on a clock that leaps or is set back; ended goals are forgotten after 0.1 s of it."""
import rospy
import rostest

from processes import bowls
from raw_client import ABORTED, PREEMPTED, SUCCEEDED
from scenes import ServerCase, check_quiet


class TestEndingsSimulated(ServerCase):

    def set_back(self):
        """Set the clock back, and wait until the server has seen it."""
        before = self.clock.now
        self.clock.set(before - rospy.Duration(300))
        self.scene.wait(lambda: self.clock.turn(0.01) or self.scene.status.header.stamp < before, "a status after it")

    def test_each_ending_is_shown_by_a_status_while_the_clock_leaps(self):
        self.clock.run(10)
        for _ in range(20):
            self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])
            self.scene.check_ending(self.scene.send(-1), ABORTED, [])

    def test_cancel_up_to_now_and_a_clock_set_back_shut_nobody_out(self):
        goal_id = self.wash(5, 1)
        self.scene.cancel(stamp=self.clock.now)
        self.scene.check_ending(goal_id, PREEMPTED, bowls(1))
        self.set_back()
        self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])

    def test_newer_goal_takes_over_on_a_clock_set_back_during_the_older_one(self):
        older = self.wash(5, 2)
        self.set_back()
        newer = self.scene.send(0)
        self.assertIn("newer goal", self.scene.check_ending(older, PREEMPTED, bowls(2)).status.text)
        self.scene.check_ending(newer, SUCCEEDED, [])

    def test_ended_goal_is_forgotten_in_its_time_on_a_clock_set_back(self):
        goal_id = self.scene.send(0)
        self.scene.check_ending(goal_id, SUCCEEDED, [])
        self.set_back()
        self.clock.turn(0.5, self.scene)
        self.clock.turn(0.5, self.scene)
        check_quiet(self.scene.processes[0])
        self.assertNotIn(goal_id, [one.goal_id.id for one in self.scene.status.status_list], "ended goals")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "endings_simulated", TestEndingsSimulated)
