#!/usr/bin/env python3
"""A goal: when it is accepted, how long it takes, what comes of it, and when another one takes its place."""
import time

from actionlib_msgs.msg import GoalStatus
from actions_tutorial.msg import WashTheDishesGoal
from parameterized import parameterized
import rospy
import rostest

from support.action_case import ActionTest
from support.printed import bowls
from support.processes import Group
from support.raw_client import RawClient
from support.states import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED


class TestGoal(ActionTest):

    def wash(self, minutes):
        """Send a goal and wait until it is over. Returns its state and text, and the bowls of its result and of its
        feedback."""
        feedback = []
        self.send(WashTheDishesGoal(number_of_minutes=minutes), feedback_cb=feedback.append)
        return (self.client.get_state(), self.client.get_goal_status_text(), self.client.get_result().dishes_washed,
                [one.last_dish_washed for one in feedback])

    def test_goal_is_accepted_and_active(self):
        states = []
        self.send(WashTheDishesGoal(number_of_minutes=1), active_cb=lambda: states.append(self.client.get_state()))
        self.assertEqual([GoalStatus.ACTIVE], states)

    @parameterized.expand([("none", 0), ("one", 1), ("three", 3)])
    def test_minutes_take_as_many_seconds(self, _, minutes):
        begun, text = time.monotonic(), rospy.get_param("text_succeeded", "")
        self.assertEqual((SUCCEEDED, text, bowls(minutes), bowls(minutes)), self.wash(minutes))
        self.assertAlmostEqual(minutes, time.monotonic() - begun, delta=0.7)

    @parameterized.expand([("three", -3), ("least", -2**31)])
    def test_negative_minutes_are_aborted_and_named(self, _, minutes):
        text = "number_of_minutes is %d, must be 0 or more" % minutes
        self.assertEqual((ABORTED, text, [], []), self.wash(minutes))

    def test_goals_that_are_over_at_once_all_have_an_outcome(self):
        for minutes, state in (0, SUCCEEDED), (0, SUCCEEDED), (-1, ABORTED), (0, SUCCEEDED):
            self.raw.check_outcome(self.raw.send(minutes), state, [])

    def test_rostopic_pub_sends_a_goal(self):
        raw = RawClient().wait_connected()  # which has seen no goal yet
        self.addCleanup(raw.close)
        with Group() as group:
            group.start("rostopic", "pub", "--once", "/wash_dishes_as/goal", "actions_tutorial/WashTheDishesActionGoal",
                        "goal: {number_of_minutes: 5}")
            raw.wait(lambda: raw.results, "the result")
        (result,), = raw.results.values()
        self.assertIn("  status: 3\n", str(result))  # as rostopic echo prints it
        self.assertEqual(bowls(5), result.result.dishes_washed)

    def test_newer_goal_takes_over_within_the_servers_time(self):
        older = self.raw.send(5)
        self.raw.wait_bowls(older, 2)
        newer = self.raw.send(0)
        self.raw.check_outcome(newer, SUCCEEDED, [])
        status = self.raw.check_outcome(older, PREEMPTED, self.raw.bowls_of(older)).status
        self.assertEqual(rospy.get_param("text_newer_goal", ""), status.text)
        waited = self.raw.times[newer, "result"] - self.raw.times[newer, "sent"]
        self.assertLess(waited, rospy.get_param("stops_within", 1.5))

    def test_last_of_many_goals_wins(self):
        *older, newest = [self.raw.send(minutes) for minutes in [5] * 9 + [0]]
        self.assertEqual(SUCCEEDED, self.raw.wait_result(newest).status.status)
        for goal_id in older:
            self.assertIn(self.raw.wait_result(goal_id).status.status, [PREEMPTED, RECALLED])
        self.assertEqual(1, self.raw.active_at_once)

    def test_goal_cancelled_while_it_waits_washes_nothing(self):
        older = self.raw.send(5)
        self.raw.wait_bowls(older, 1)
        newer = self.raw.send(5)
        self.raw.wait(lambda: newer in self.raw.states, "the server has the newer goal")
        self.raw.cancel(newer)
        result = self.raw.wait_result(newer)
        self.assertIn(result.status.status, [PREEMPTED, RECALLED])
        # A server that starts a newer goal at once may have washed a bowl before the cancel comes.
        self.assertLessEqual(len(result.result.dishes_washed), ACTIVE in self.raw.states[newer])

    def test_goal_cancelled_before_it_comes_is_recalled(self):
        goal_id = self.raw.new_id()
        self.raw.cancel(goal_id)
        self.raw.wait(lambda: goal_id in self.raw.states, "the cancel has come")
        self.raw.send(1, goal_id)
        self.raw.check_outcome(goal_id, RECALLED, [])

    def test_goal_that_comes_twice_is_washed_once(self):
        goal_id = self.raw.send(1)
        self.raw.send(1, goal_id)
        self.raw.wait_result(goal_id)
        self.raw.wait_result(self.raw.send(-1))  # after it, nothing comes of the second any more
        self.raw.check_outcome(goal_id, SUCCEEDED, ["bowl-0"])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "goal", TestGoal)
