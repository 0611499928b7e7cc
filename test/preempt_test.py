#!/usr/bin/env python3
"""Cancels: of the goal that runs, which keeps the bowls washed so far; and those that change nothing."""
import time

from actionlib_msgs.msg import GoalStatus
from actions_tutorial.msg import WashTheDishesGoal
from parameterized import parameterized
import rospy
import rostest

from support.action_case import ActionTest
from support.printed import bowls
from support.processes import Group, eventually
from support.states import ACTIVE, PREEMPTED, SUCCEEDED


class TestPreempt(ActionTest):

    def wash(self, minutes, until=1):
        """Send a goal, and wait until it is ACTIVE and has washed a number of bowls (int). Returns its bowls, a list of
        str to which later feedback is added."""
        washed = []
        self.start(WashTheDishesGoal(number_of_minutes=minutes),
                   feedback_cb=lambda feedback: washed.append(feedback.last_dish_washed))
        eventually(lambda: len(washed) >= until and self.client.get_state() == ACTIVE,
                   "ACTIVE and %d bowls" % until, timeout=20)
        return washed

    def check_outcome(self, state, washed):
        """Wait until the goal is over. Expect a state (GoalStatus) and bowls (list of str) in its result."""
        self.assertTrue(self.client.wait_for_result(rospy.Duration(20)), "no outcome")
        self.assertEqual((state, washed), (self.client.get_state(), self.client.get_result().dishes_washed))

    # Two bowls, or a server that looks for a cancel at every other bowl would pass.
    @parameterized.expand([
        ("after_an_odd_bowl", 5, 1, lambda client: client.cancel_goal()),
        ("after_an_even_bowl", 5, 2, lambda client: client.cancel_goal()),
        ("before_the_last_bowl", 3, 2, lambda client: client.cancel_goal()),
        ("of_all_goals", 5, 1, lambda client: client.cancel_all_goals()),
        ("up_to_now", 5, 1, lambda client: client.cancel_goals_at_and_before_time(rospy.Time.now()))])
    def test_cancel_stops_the_goal_within_the_servers_time(self, _, minutes, until, cancel):
        washed = self.wash(minutes, until)
        begun = time.monotonic()
        cancel(self.client)
        self.check_outcome(PREEMPTED, washed)
        self.assertLess(time.monotonic() - begun, rospy.get_param("stops_within", 1.5))
        self.assertEqual(rospy.get_param("text_cancelled", ""), self.client.get_goal_status_text())

    def test_cancel_by_rostopic_pub_stops_the_goal(self):
        self.wash(60)
        with Group() as group:
            group.start("rostopic", "pub", "--once", "/wash_dishes_as/cancel", "actionlib_msgs/GoalID", "{}")
            self.client.wait_for_result(rospy.Duration(20))
        self.assertEqual(PREEMPTED, self.client.get_state())

    def test_cancel_in_the_last_second_has_the_servers_outcome(self):
        self.wash(1)
        self.client.cancel_goal()
        self.check_outcome(getattr(GoalStatus, rospy.get_param("cancel_in_last_second", "SUCCEEDED")), bowls(1))

    @parameterized.expand([
        ("of_another_goal", lambda self, _: self.raw.cancel("another")),
        ("up_to_a_time_before_it", lambda self, before: self.client.cancel_goals_at_and_before_time(before))])
    def test_cancel_changes_nothing(self, _, cancel):
        before = rospy.Time.now() - rospy.Duration(1)
        self.wash(2)
        cancel(self, before)
        self.check_outcome(SUCCEEDED, bowls(2))

    def test_cancel_after_the_end_changes_nothing(self):
        over = self.raw.send(0)
        self.raw.wait_result(over)
        self.raw.cancel(over)
        self.raw.check_outcome(self.raw.send(1), SUCCEEDED, bowls(1))
        self.raw.check_outcome(over, SUCCEEDED, [])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "preempt", TestPreempt)
