#!/usr/bin/python3
"""Without simulated time, a second is a second."""
import time
import unittest

import rospy
import rostest

from probe import PREEMPTED, SUCCEEDED, Probe, bowls


class TestRealTime(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("real_time_test")
        cls.probe = Probe()

    def test_four_bowls_take_four_seconds(self):
        begun = time.monotonic()
        goal_id = self.probe.send(4)
        result = self.probe.wait_result(goal_id)
        took = time.monotonic() - begun
        self.assertEqual((SUCCEEDED, bowls(4)), (result.status.status, result.result.dishes_washed), str(self.probe))
        stamps = [stamp for _, stamp in self.probe.feedback[goal_id]] + [result.header.stamp]
        seconds = [(stamp - stamps[0]).to_sec() for stamp in stamps]
        for i, second in enumerate(seconds):
            # Never early but by what the first one was late, and late by what a busy machine may take.
            self.assertTrue(i - 0.5 < second < i + 2, "expected second %d, came %s" % (i, seconds))
        self.assertTrue(3.9 < took < 15, "expected 4 s, took %.2f s" % took)

    def test_a_cancel_does_not_wait_for_the_next_bowl(self):
        waits = []
        for _ in range(5):
            goal_id = self.probe.send(30)
            self.probe.wait_bowls(goal_id, 1)
            begun = time.monotonic()
            self.probe.cancel(goal_id)
            result = self.probe.wait_result(goal_id)
            waits.append(time.monotonic() - begun)
            self.assertEqual(PREEMPTED, result.status.status, str(self.probe))
        # A server that looks once a second needs about 1 s each time; exact figures are the benchmark's.
        self.assertLess(min(waits), 0.5, "seconds from cancel to result: %s" % waits)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "real_time", TestRealTime)
