#!/usr/bin/python3
"""Endings on a clock that leaps or is set back; ended goals are forgotten after 0.1 s of it."""
import rostest

from raw_client import ABORTED, SUCCEEDED
from scenes import ServerCase, check_quiet


class TestEndingsSimulated(ServerCase):

    def test_each_ending_is_shown_by_a_status_while_the_clock_leaps(self):
        self.clock.run(10)
        for _ in range(20):
            self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])
            self.scene.check_ending(self.scene.send(-1), ABORTED, [])

    def test_ended_goal_is_forgotten_in_its_time_on_a_clock_set_back(self):
        goal_id = self.scene.send(0)
        self.scene.check_ending(goal_id, SUCCEEDED, [])
        self.set_back(300)
        self.clock.turn(0.5, self.scene)
        self.clock.turn(0.5, self.scene)
        check_quiet(self.scene.processes[0])
        self.assertNotIn(goal_id, [one.goal_id.id for one in self.scene.status.status_list], "ended goals")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "endings_simulated", TestEndingsSimulated)
