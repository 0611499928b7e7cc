#!/usr/bin/python3
"""Simulated time is the server's only time: running fast, standing still, beginning, set back."""
import time

import rostest
import rospy

from probe import PREEMPTED, SUCCEEDED, bowls
from server_case import ServerCase

LOOK = 2.5  # s of the wall clock in which a server that lived by it would wash two more bowls


class TestSimulatedTime(ServerCase):

    def expect_no_more_than(self, goal_id, count):
        """Watch for LOOK s that nothing more comes."""
        until = time.monotonic() + LOOK
        with self.probe.news:
            while time.monotonic() < until:
                self.probe.news.wait(until - time.monotonic())
        self.assertEqual(bowls(count), self.probe.bowls_of(goal_id), "bowls while the clock stood still")
        self.assertNotIn(goal_id, self.probe.results)

    def test_fifty_times_faster(self):
        begun = rospy.Time.now()
        goal_id = self.probe.send(60)
        self.clock.run(50)
        result = self.probe.wait_result(goal_id)
        self.assertEqual((SUCCEEDED, bowls(60)), (result.status.status, result.result.dishes_washed))
        for i, (_, stamp) in enumerate(self.probe.feedback[goal_id]):
            self.assertGreaterEqual((stamp - begun).to_sec(), i, "second of bowl-%d" % i)
        took = (result.header.stamp - begun).to_sec()
        # Exact figures are feedback_test's. By the wall clock it would take 60 * 50 s.
        self.assertTrue(60 <= took < 600, "expected 60 s of ROS time, took %.1f s" % took)

    def test_no_bowl_while_the_clock_stands_and_on_when_it_goes(self):
        goal_id = self.probe.send(3)
        self.wash(goal_id, 2)
        self.expect_no_more_than(goal_id, 2)
        self.clock.turn(1, self.probe)
        self.probe.wait_bowls(goal_id, 3)
        self.clock.turn(1, self.probe)
        self.check_ending(goal_id, SUCCEEDED, bowls(3))

    def test_cancel_while_the_clock_stands(self):
        goal_id = self.probe.send(5)
        self.wash(goal_id, 2)
        self.probe.cancel(goal_id)
        self.check_ending(goal_id, PREEMPTED, bowls(2))

    def test_stopped_and_started_again_on_the_run(self):
        goal_id = self.probe.send(20)
        self.clock.run(50)
        self.probe.wait_bowls(goal_id, 5)
        self.clock.stop()
        self.clock.run(50)
        result = self.probe.wait_result(goal_id)
        self.assertEqual((SUCCEEDED, bowls(20)), (result.status.status, result.result.dishes_washed))

    def test_clock_set_back_delays_no_bowl_and_repeats_none(self):
        goal_id = self.probe.send(4)
        self.wash(goal_id, 2)
        self.clock.turn(0.5, self.probe)
        before = self.clock.now
        self.clock.set(before - rospy.Duration(100))
        # In steps so small that no bowl is due by them: a status tells that the server has seen the jump.
        self.probe.wait(lambda: self.clock.turn(0.01) or self.probe.status_stamp < before, "a status after the jump")
        for washed in (3, 4):
            self.clock.turn(1, self.probe)
            self.probe.wait_bowls(goal_id, washed)
        self.clock.turn(1, self.probe)
        self.check_ending(goal_id, SUCCEEDED, bowls(4))
        self.check_ending(self.probe.send(0), SUCCEEDED, [])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "simulated_time", TestSimulatedTime)
