#!/usr/bin/env python3
"""Preempting: a cancel or a newer goal stops the goal, which keeps the bowls washed so far."""
import time

from actionlib_msgs.msg import GoalStatus
from actions_tutorial.msg import WashTheDishesGoal
import rospy
import rostest

from support.action_case import ActionTest
from support.processes import Group, eventually
from support.states import SUCCEEDED


class TestPreempt(ActionTest):

    def wash(self, minutes, until=1):
        """Send a goal, and wait until it is ACTIVE and has washed a number of bowls (int). Returns its bowls, a list of
        str to which later feedback is added."""
        washed = []
        self.start(WashTheDishesGoal(number_of_minutes=minutes),
                   feedback_cb=lambda feedback: washed.append(feedback.last_dish_washed))
        eventually(lambda: len(washed) >= until and self.client.get_state() == GoalStatus.ACTIVE,
                   "ACTIVE and %d bowls" % until, timeout=20)
        return washed

    def check_outcome(self, state, washed):
        """Wait until the goal is over. Expect a state (GoalStatus) and bowls (list of str) in its result."""
        self.assertTrue(self.client.wait_for_result(rospy.Duration(20)), "no outcome")
        self.assertEqual(GoalStatus.to_string(state), GoalStatus.to_string(self.client.get_state()))
        self.assertEqual(washed, self.client.get_result().dishes_washed)

    def test_cancelled_goal_is_preempted_with_its_bowls(self):
        washed = self.wash(5, until=2)
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, washed)

    def test_cancel_acts_within_the_servers_time(self):
        washed = self.wash(5)
        begun = time.monotonic()
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, washed)
        self.assertLess(time.monotonic() - begun, rospy.get_param("stops_within", 2))

    def test_cancel_in_the_last_second(self):
        self.wash(1)
        self.client.cancel_goal()
        outcome = rospy.get_param("cancel_in_last_second", "SUCCEEDED")
        self.check_outcome(getattr(GoalStatus, outcome), ["bowl-0"])

    def test_cancel_of_all_goals_preempts_it(self):
        washed = self.wash(5)
        self.client.cancel_all_goals()
        self.check_outcome(GoalStatus.PREEMPTED, washed)

    def test_cancel_up_to_now_preempts_it(self):
        washed = self.wash(5)
        self.client.cancel_goals_at_and_before_time(rospy.Time.now())
        self.check_outcome(GoalStatus.PREEMPTED, washed)

    def test_cancel_by_rostopic_pub_preempts_it(self):
        washed = self.wash(60)
        with Group() as group:
            group.start("rostopic", "pub", "--once", "/wash_dishes_as/cancel", "actionlib_msgs/GoalID", "{}")
            self.check_outcome(GoalStatus.PREEMPTED, washed)

    def test_cancel_up_to_a_time_before_it_changes_nothing(self):
        before = rospy.Time.now() - rospy.Duration(1)
        self.wash(2)
        self.client.cancel_goals_at_and_before_time(before)
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0", "bowl-1"])

    def test_cancel_of_another_goal_changes_nothing(self):
        self.wash(2)
        self.raw.cancel("another")
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0", "bowl-1"])

    def test_cancel_after_the_end_changes_nothing(self):
        over = self.raw.send(0)
        self.raw.wait_result(over)
        self.raw.cancel(over)
        self.raw.check_outcome(self.raw.send(1), SUCCEEDED, ["bowl-0"])
        self.raw.check_outcome(over, SUCCEEDED, [])

    def test_goal_after_a_cancelled_one_succeeds(self):
        washed = self.wash(5)
        self.client.cancel_goal()
        self.check_outcome(GoalStatus.PREEMPTED, washed)
        self.wash(1)
        self.check_outcome(GoalStatus.SUCCEEDED, ["bowl-0"])

    def test_newer_goal_preempts_the_older_with_its_bowls(self):
        washed = self.wash(5, until=2)
        newer = self.raw.send(0)
        self.check_outcome(GoalStatus.PREEMPTED, washed)
        self.raw.check_outcome(newer, SUCCEEDED, [])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "preempt", TestPreempt)
