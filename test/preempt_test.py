#!/usr/bin/env python3
"""Preempting: a cancel or a newer goal stops the goal, which keeps the bowls washed so far."""
import time
import unittest

from actionlib_msgs.msg import GoalID, GoalStatus
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy
import rostest

from harness import SUCCEEDED, RawClient, eventually, wait_connected


class TestPreempt(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("preempt_test")
        cls.client = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
        cls.cancel = rospy.Publisher("wash_dishes_as/cancel", GoalID, queue_size=10)
        wait_connected(cls.client)

    def wash(self, minutes, until=1):
        """Send a goal and wait for a number of feedbacks (int)."""
        feedback = []
        self.client.send_goal(WashTheDishesGoal(number_of_minutes=minutes), feedback_cb=feedback.append)
        eventually(lambda: len(feedback) >= until, "%d feedbacks" % until)

    def check_outcome(self, state, washed):
        """Wait until the goal is over. Expect a state (GoalStatus) and bowls (list of str) in its result."""
        self.assertTrue(self.client.wait_for_result(rospy.Duration(10)), "no outcome")
        self.assertEqual(GoalStatus.to_string(state), GoalStatus.to_string(self.client.get_state()))
        self.assertEqual(washed, self.client.get_result().dishes_washed)

    def test_cancelled_goal_is_preempted_with_its_bowls(self):
        self.wash(5, until=2)
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0", "bowl-1"])

    def test_cancel_acts_within_the_servers_time(self):
        self.wash(5)
        begun = time.monotonic()
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0"])
        self.assertLess(time.monotonic() - begun, rospy.get_param("stops_within", 2))

    def test_cancel_in_the_last_second(self):
        self.wash(1)
        self.client.cancel_goal()
        outcome = rospy.get_param("cancel_in_last_second", "SUCCEEDED")
        self.check_outcome(getattr(GoalStatus, outcome), ["bowl-0"])

    def test_cancel_of_all_goals_preempts_it(self):
        self.wash(5)
        self.client.cancel_all_goals()
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0"])

    def test_cancel_up_to_now_preempts_it(self):
        self.wash(5)
        self.client.cancel_goals_at_and_before_time(rospy.Time.now())
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0"])

    def test_cancel_up_to_a_time_before_it_changes_nothing(self):
        before = rospy.Time.now() - rospy.Duration(1)
        self.wash(2)
        self.client.cancel_goals_at_and_before_time(before)
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0", "bowl-1"])

    def test_cancel_of_another_goal_changes_nothing(self):
        self.wash(2)
        self.cancel.publish(GoalID(id="another"))
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0", "bowl-1"])

    def test_cancel_after_the_end_changes_nothing(self):
        raw = RawClient().wait_connected()  # since the client of robust does not send such a cancel
        self.addCleanup(raw.close)
        over = raw.send(0)
        raw.wait_result(over)
        raw.cancel(over)
        raw.check_outcome(raw.send(1), SUCCEEDED, ["bowl-0"])
        raw.check_outcome(over, SUCCEEDED, [])

    def test_goal_after_a_cancelled_one_succeeds(self):
        self.wash(5)
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0"])
        self.wash(1)
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0"])

    def test_newer_goal_preempts_the_older_with_its_bowls(self):
        newer = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
        wait_connected(newer)
        self.wash(5, until=2)
        newer.send_goal(WashTheDishesGoal(number_of_minutes=0))
        self.check_outcome(GoalStatus.PREEMPTED, ["bowl-0", "bowl-1"])
        self.assertTrue(newer.wait_for_result(rospy.Duration(10)))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "preempt", TestPreempt)
