#!/usr/bin/env python3
"""Servers, robust's client and its rate on a clock that moves only when the test turns it.

simulated_time.test sets /use_sim_time and starts the two nodes. TestOwnServer needs no node, and ACTIONLIB=plain in the
environment has it try actionlib.
"""
import os
import threading
import time
import unittest

import actionlib
from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
from parameterized import parameterized
import rospy
import rostest

from support.printed import bowls
from support.processes import eventually
from support.raw_client import RawClient, wait_connected
from support.server_case import ServerCase
from support.simulated_clock import SimulatedClock
from support.states import PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED

PAUSE = 1.5  # s, real time, for what must not happen on a paused clock


class NodeTests:
    """What both nodes promise."""

    namespace = None

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.clock = SimulatedClock()
        cls.raw = RawClient(cls.namespace).wait_connected()
        cls.clock.turn_until_status_follows(cls.raw)

    def wash(self, minutes, until):
        """Send a goal and turn the clock on until a number of bowls (int) is washed. Returns its id."""
        goal_id = self.raw.send(minutes)
        for count in range(1, until + 1):
            self.raw.wait_bowls(goal_id, count)
            if count < until:
                self.clock.turn(1, self.raw)
        return goal_id

    def test_bowls_and_result_come_on_their_second_without_drift(self):
        begun = self.clock.now
        goal_id = self.raw.send(60)
        for count in range(1, 61):
            self.raw.wait_bowls(goal_id, count)
            self.clock.turn(0.75, self.raw)  # too early
            self.clock.turn(0.25)
        result = self.raw.check_outcome(goal_id, SUCCEEDED, bowls(60))
        stamps = [message.header.stamp for message in self.raw.feedback[goal_id] + [result]]
        self.assertEqual([float(second) for second in range(61)], [(stamp - begun).to_sec() for stamp in stamps])

    def test_paused_clock_is_no_silence_for_robusts_client(self):
        client = robust.SimpleActionClient(f"{self.namespace}/wash_dishes_as", WashTheDishesAction,
                                           heartbeat_timeout=0.5)
        wait_connected(client, f"{self.namespace}/wash_dishes_as")
        client.send_goal(WashTheDishesGoal(number_of_minutes=1))
        goal_id, = self.raw.wait(lambda: [one.goal_id.id for one in self.raw.status.status_list
                                          if one.status == GoalStatus.ACTIVE], "the goal is active")
        self.raw.wait_bowls(goal_id, 1)
        time.sleep(PAUSE)
        self.assertEqual(GoalStatus.ACTIVE, client.get_state(), client.get_failure())
        self.clock.turn(1)
        self.assertTrue(client.wait_for_result())
        self.assertIsNone(client.get_failure())


class TestActionServer(NodeTests, unittest.TestCase):

    namespace = "/plain"

    def test_cancel_acts_when_the_second_is_over(self):
        goal_id = self.wash(60, until=2)
        self.raw.cancel(goal_id)
        self.raw.wait(lambda: PREEMPTING in self.raw.states[goal_id], "the cancel has come")
        self.clock.turn(0.75, self.raw)
        self.assertNotIn(goal_id, self.raw.results)
        self.clock.turn(0.25)
        self.raw.check_outcome(goal_id, PREEMPTED, bowls(2))


class TestRobustActionServer(NodeTests, unittest.TestCase):

    namespace = "/robust"

    def test_goal_goes_on_when_the_clock_is_set_back(self):
        goal_id = self.wash(60, until=2)
        self.clock.turn(-500)
        self.clock.turn_until_status_follows(self.raw)
        self.clock.turn(1, self.raw)
        self.raw.wait_bowls(goal_id, 3)
        self.raw.cancel(goal_id)
        self.raw.wait_result(goal_id)

    def test_clock_that_jumps_ahead_is_no_silence_for_the_client(self):
        client = robust.SimpleActionClient("nobody", WashTheDishesAction, heartbeat_timeout=4)
        client.send_goal(WashTheDishesGoal())
        for _ in range(3):
            time.sleep(0.6)  # it looks every half second
            self.clock.turn(100)
        self.assertEqual(GoalStatus.PENDING, client.get_state(), client.get_failure())


class TestOwnServer(ServerCase):
    """A server in this process, and its rate."""

    library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.clock = SimulatedClock()

    # A clock that is set back

    def test_goal_after_a_cancel_and_a_clock_set_back_is_served(self):
        self.free.set()
        self.serve(self.work_until_free)
        self.client.cancel(stamp=self.clock.now)
        self.expect(self.client.send(0, stamp=self.clock.now), RECALLED)
        self.clock.turn(-200)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_status_goes_on_when_the_clock_is_set_back(self):
        self.serve(self.work_until_free)
        self.clock.turn_until_status_follows(self.client)
        self.clock.turn(-200)
        later = self.clock.now + rospy.Duration(1)
        self.client.wait(lambda: self.clock.turn(0.1) or later < self.client.status.header.stamp <= self.clock.now,
                         "a status", timeout=10)

    # rate

    def sleep(self, *rates):
        """Have a thread for each rate sleep on it, and wait until they do. Returns a list that gets what sleep()
        returns."""
        def sleep(rate):
            begun.wait()
            slept.append(rate.sleep())

        begun, slept = threading.Barrier(len(rates) + 1), []
        for rate in rates:
            threading.Thread(target=sleep, args=[rate], daemon=True).start()
        begun.wait()
        time.sleep(PAUSE / 5)
        return slept

    def test_clock_set_back_begins_one_period_anew(self):
        self.serve(self.work_until_free)
        rate = self.server.rate(1)
        slept = self.sleep(rate)
        self.clock.turn(-500)
        self.assertEqual(1, rate.remaining().to_sec())
        self.clock.turn(0.5)
        time.sleep(PAUSE / 5)
        self.assertEqual([], slept)
        self.clock.turn(0.5)
        eventually(lambda: slept == [True], "the end of the period", timeout=10)
        self.clock.turn(0.5)  # work
        self.assertEqual(0.5, rate.remaining().to_sec())

    @parameterized.expand([("catches_up", [1.5, 0.25, 0.25]), ("gives_up", [5.25, 1])])
    def test_late_rate_does_as_rospys(self, _, turns):
        self.serve(self.work_until_free)
        self.check_as_rospys(self.server.rate(1), rospy.Rate(1), turns)

    def test_clock_that_jumps_during_a_sleep_is_as_with_rospys(self):
        self.serve(self.work_until_free)
        rates = self.server.rate(1), rospy.Rate(1)
        slept = self.sleep(*rates)
        self.clock.turn(5.25)
        eventually(lambda: len(slept) == 2, "the end of the period", timeout=10)
        self.check_as_rospys(*rates, [0, 1])

    def check_as_rospys(self, ours, rospys, turns):
        """Turn the clock on by each of turns (s), and sleep as often as a rate is late: as often as rospy's, and both
        have the same time left."""
        for seconds in turns:
            self.clock.turn(seconds)
            while rospys.remaining() <= rospy.Duration():
                self.assertEqual(rospys.remaining(), ours.remaining())
                rospys.sleep()
                self.assertTrue(ours.sleep())
            self.assertEqual(rospys.remaining(), ours.remaining())


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "simulated_time", "simulated_time_test." + rospy.myargv()[1])
