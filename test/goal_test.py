#!/usr/bin/python3
"""The life of a goal: accepted, washed, ended once, whoever sent it and however many minutes it asks for."""
import threading

import rostest
import rospy
from actionlib import SimpleActionClient
from actions_tutorial import steady
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

from probe import ABORTED, ACTIVE, RECALLED, SUCCEEDED, bowls
from server_case import ServerCase


class TestGoal(ServerCase):

    def test_no_minutes_succeed_at_once_with_no_bowls(self):
        goal_id = self.probe.send(0)
        self.check_ending(goal_id, SUCCEEDED, [])

    def test_minutes_are_as_many_bowls(self):
        for minutes in (1, 5):
            goal_id = self.probe.send(minutes)
            self.wash(goal_id, minutes)
            self.assertNotIn(goal_id, self.probe.results, "ended before its last second was over: %s" % self.probe)
            self.clock.turn(1, self.probe)
            self.check_ending(goal_id, SUCCEEDED, bowls(minutes))

    def test_states_are_active_then_succeeded(self):
        goal_id = self.probe.send(1)
        self.wash(goal_id, 1)  # ACTIVE alone does not tell that the server has looked at the clock
        self.clock.turn(1, self.probe)
        self.probe.wait_result(goal_id)
        states = [state for state in self.probe.states[goal_id] if state != 0]  # PENDING may be too short to be seen
        self.assertEqual([ACTIVE, SUCCEEDED], states, str(self.probe))

    def test_negative_minutes_are_aborted_with_the_reason(self):
        for minutes in (-1, -3, -2**31):
            goal_id = self.probe.send(minutes)
            result = self.check_ending(goal_id, ABORTED, [])
            self.assertIn(str(minutes), result.status.text)
            self.assertIn("0 or more", result.status.text)

    def test_goal_without_id_and_stamp_is_served(self):
        known = set(self.probe.states)
        self.probe.send(1, stamp=rospy.Time(), goal_id="")
        self.probe.wait(lambda: set(self.probe.feedback) - known, "feedback of a goal with an id of the server's")
        goal_id, = set(self.probe.feedback) - known
        self.clock.turn(1, self.probe)
        self.check_ending(goal_id, SUCCEEDED, bowls(1))

    def test_stamp_of_the_future_or_past_shuts_nobody_out(self):
        for stamp in (rospy.Time(2**31), rospy.Time(1)):
            strange = self.probe.send(0, stamp=stamp)
            self.probe.wait_result(strange)
            self.check_ending(self.probe.send(0), SUCCEEDED, [])

    def test_repeated_id_is_not_washed_twice(self):
        goal_id = self.probe.send(0)
        self.check_ending(goal_id, SUCCEEDED, [])
        self.probe.send(5, goal_id=goal_id)
        self.check_ending(self.probe.send(0), SUCCEEDED, [])  # the topic keeps its order: the repeated one was read
        self.check_ending(goal_id, SUCCEEDED, [])

    def test_each_of_two_clients_sees_its_own_goal(self):
        seen = {}
        clients = {}
        for name in ("first", "second"):
            clients[name] = SimpleActionClient("wash_dishes_as", WashTheDishesAction)
            self.assertTrue(clients[name].wait_for_server(), "no server for the %s client" % name)
            seen[name] = []
        done = {name: threading.Event() for name in clients}

        def send(name, minutes):
            steady.send_goal(  # SimpleActionClient alone may drop what comes at once
                clients[name], WashTheDishesGoal(number_of_minutes=minutes),
                feedback_cb=lambda msg: seen[name].append(msg), done_cb=lambda state, result: done[name].set())

        send("first", 2)
        self.probe.wait(lambda: len(seen["first"]) == 1, "feedback for the first client")
        self.clock.turn(1, self.probe)
        self.probe.wait(lambda: len(seen["first"]) == 2, "two bowls of feedback for the first client")
        send("second", 1)
        self.assertTrue(done["first"].wait(30), "the first client's goal goes on after the second's has come")
        self.probe.wait(lambda: len(seen["second"]) == 1, "feedback for the second client")
        self.clock.turn(1, self.probe)
        self.assertTrue(done["second"].wait(30), "the second client's goal has no ending")
        self.assertEqual(bowls(2), clients["first"].get_result().dishes_washed)
        self.assertEqual(bowls(1), clients["second"].get_result().dishes_washed)
        self.assertEqual((2, 1), (len(seen["first"]), len(seen["second"])), "feedback that each client saw")

    def test_burst_ends_every_goal_once(self):
        goals = [self.probe.send(3) for _ in range(20)]
        self.wash(goals[-1], 3)
        self.clock.turn(1, self.probe)
        self.check_ending(goals[-1], SUCCEEDED, bowls(3))
        for goal_id in goals[:-1]:
            state = self.probe.wait_result(goal_id).status.status
            self.assertNotIn(state, (SUCCEEDED, ABORTED), "%s of %s" % (goal_id, self.probe))
        self.assertLessEqual(self.probe.active_at_once, 1, "goals ACTIVE at once")
        self.assertNotIn(RECALLED, self.probe.states[goals[-1]])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "goal", TestGoal)
