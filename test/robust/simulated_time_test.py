#!/usr/bin/env python3
"""Both servers, robust's client and rate, on a clock in the test's hand: it stands still unless the test turns it."""
import os
import sys
import threading
import time
import unittest

from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy
import rostest

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.printed import bowls
from support.processes import eventually, run
from support.raw_client import RawClient, wait_connected
from support.simulated_clock import SimulatedClock
from support.states import PREEMPTED, PREEMPTING, SUCCEEDED

PAUSE = 1.5  # s, real time, for what must not happen on a paused clock


class ServerTests:
    """What both servers promise."""

    namespace = None

    @classmethod
    def setUpClass(cls):
        if not rospy.core.is_initialized():
            rospy.init_node("simulated_time_test")
            ServerTests.clock = SimulatedClock()
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
        client = robust.SimpleActionClient(
            self.namespace + "/wash_dishes_as", WashTheDishesAction, heartbeat_timeout=0.5)
        wait_connected(client, self.namespace + "/wash_dishes_as")
        client.send_goal(WashTheDishesGoal(number_of_minutes=1))
        goal_id, = self.raw.wait(lambda: [one.goal_id.id for one in self.raw.status.status_list
                                          if one.status == GoalStatus.ACTIVE], "the goal is active")
        self.raw.wait_bowls(goal_id, 1)
        time.sleep(PAUSE)
        self.assertEqual(GoalStatus.ACTIVE, client.get_state(), client.get_failure())
        self.clock.turn(1)
        self.assertTrue(client.wait_for_result())
        self.assertIsNone(client.get_failure())


class TestActionServer(ServerTests, unittest.TestCase):

    namespace = "/plain"

    def test_cancel_acts_when_the_second_is_over(self):
        goal_id = self.wash(60, until=2)
        self.raw.cancel(goal_id)
        self.raw.wait(lambda: PREEMPTING in self.raw.states[goal_id], "the cancel has come")
        self.clock.turn(0.75, self.raw)
        self.assertNotIn(goal_id, self.raw.results)
        self.clock.turn(0.25)
        self.raw.check_outcome(goal_id, PREEMPTED, bowls(2))


class TestRobustActionServer(ServerTests, unittest.TestCase):

    namespace = "/robust"

    def test_goal_goes_on_when_the_clock_is_set_back(self):
        goal_id = self.wash(60, until=2)
        self.clock.turn(-500)
        self.clock.turn_until_status_follows(self.raw)
        self.clock.turn(1, self.raw)
        self.raw.wait_bowls(goal_id, 3)
        self.raw.cancel(goal_id)
        self.raw.wait_result(goal_id)

    def send_to_nobody(self, heartbeat_timeout=None):
        """Send a goal for which there is no server. Returns the client, whose watch has begun."""
        client = robust.SimpleActionClient("nobody", WashTheDishesAction, heartbeat_timeout=heartbeat_timeout)
        client.send_goal(WashTheDishesGoal())
        time.sleep(0.2)
        return client

    def test_clock_that_jumps_ahead_is_no_silence_for_the_client(self):
        client = self.send_to_nobody(heartbeat_timeout=4)
        for _ in range(3):
            self.clock.turn(100)
            time.sleep(0.6)  # it looks every half second
        self.assertEqual(GoalStatus.PENDING, client.get_state(), client.get_failure())

    def test_client_notices_silence_when_the_clock_was_set_back(self):
        client = self.send_to_nobody(heartbeat_timeout=0.5)
        self.clock.turn(-500)
        eventually(lambda: self.clock.turn(0.1) or client.get_state() == GoalStatus.LOST, "LOST", timeout=10, pause=0.1)

    def test_wait_for_result_ends_in_time_after_clock_was_set_back(self):
        client, ended = self.send_to_nobody(), threading.Event()
        threading.Thread(target=lambda: client.wait_for_result(2) or ended.set()).start()
        time.sleep(0.2)
        for seconds in -500, 1, 0.75:
            self.clock.turn(seconds)
            self.assertFalse(ended.wait(0.3))
        self.clock.turn(0.5)
        self.assertTrue(ended.wait(5))


class TestRate(unittest.TestCase):
    """The rate of a server in this process."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("simulated_time_test")
        cls.server = robust.SimpleActionServer("rate", WashTheDishesAction, auto_start=False)
        cls.early = cls.server.rate(1)
        cls.clock = SimulatedClock()

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

    def turn_until(self, seconds, slept):
        """Turn the clock on by seconds, in two steps. Expect that sleep() returns after the second one."""
        self.clock.turn(seconds / 2)
        time.sleep(PAUSE / 5)
        self.assertEqual([], slept)
        self.clock.turn(seconds / 2)
        eventually(lambda: slept == [True], "the end of the period", timeout=10)

    def test_rate_made_before_the_clock_sleeps_its_period(self):
        slept = self.sleep(self.early)
        self.turn_until(1, slept)

    def test_clock_set_back_begins_one_period_anew(self):
        rate = self.server.rate(1)
        slept = self.sleep(rate)
        self.clock.turn(-500)
        self.assertEqual(1, rate.remaining().to_sec())
        self.turn_until(1, slept)
        self.clock.turn(0.5)  # work
        self.assertEqual(0.5, rate.remaining().to_sec())

    def test_late_rate_catches_up_as_rospys_does(self):
        self.check_as_rospys(1.5, 0.25, 0.25)

    def test_rate_that_is_too_late_gives_up_as_rospys_does(self):
        self.check_as_rospys(5.25, 1)

    def test_clock_that_jumps_during_a_sleep_is_as_with_rospys(self):
        rates = self.server.rate(1), rospy.Rate(1)
        slept = self.sleep(*rates)
        self.clock.turn(5.25)
        eventually(lambda: len(slept) == 2, "the end of the period", timeout=10)
        self.check_as_rospys(0, 1, rates=rates)

    def check_as_rospys(self, *turns, rates=None):
        """Turn the clock on by each of turns, and sleep as often as a rate is late: as often as rospy's, and both have
        the same time left."""
        ours, rospys = rates or (self.server.rate(1), rospy.Rate(1))
        for seconds in turns:
            self.clock.turn(seconds)
            while rospys.remaining() <= rospy.Duration():
                self.assertEqual(rospys.remaining(), ours.remaining())
                rospys.sleep()
                self.assertTrue(ours.sleep())
            self.assertEqual(rospys.remaining(), ours.remaining())

    def test_sleep_after_a_shutdown_raises(self):
        output = run(sys.executable, "-c", """if True:
            from actions_tutorial import msg, robust
            import rospy
            rospy.init_node("interrupted")
            rate = robust.SimpleActionServer("interrupted", msg.WashTheDishesAction, auto_start=False).rate(1)
            rospy.signal_shutdown("done")
            print(rate.sleep())
            try:
                rate.sleep()
            except rospy.ROSInterruptException:
                print("interrupted")""", timeout=30)
        self.assertEqual("False\ninterrupted\n", output)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "simulated_time", "simulated_time_test." + rospy.myargv()[1])
