#!/usr/bin/env python3
"""Every goal ends as it should, in any order of goals, cancels and waits, on robust_action_server.py.

After each step every goal has the state and the bowls that it should have. The clock stands still, so a server that
polls would never answer. SEED (1) and SEQUENCES (80) in the environment choose which orders, and how many.
"""
import contextlib
import os
import random
import threading
import unittest

import rospy
import rostest

from support.printed import bowls
from support.raw_client import RawClient
from support.simulated_clock import SimulatedClock
from support.states import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED

SEED = int(os.environ.get("SEED", 1))
SEQUENCES = int(os.environ.get("SEQUENCES", 80))
STEPS = 12  # of a sequence; so few can be read as they are
WAYS = "cancel", "cancel all", "newer", "newer at once"


class Sequence:
    """Keeps the one goal that may be ACTIVE, and what each goal that is over must have come to."""

    def __init__(self, raw, clock):
        self.raw, self.clock = raw, clock
        self.done = []  # steps (str)
        self.outcomes = {}  # goal id -> (state, bowls)
        self.active = None  # goal id
        self.minutes = self.begun = None  # of the active goal: int, rospy.Time
        self.cancelled_until = rospy.Time()  # a goal with such a stamp is RECALLED when it comes

    def play(self, choose):
        """Take STEPS steps, which choose (random.Random) chooses, and see that the server takes the next goal."""
        for _ in range(STEPS):
            step, values = choose.choice(self.possible())
            self.take(step, choose.choice(values))
        self.take(self.wait, 0.25)  # until it is later than each cancel
        self.take(self.send, 0)

    def possible(self):
        """Returns the steps that may be taken now, each with the values that it takes."""
        steps = [(self.send, [-2**31, -2, -1, 0, 1, 2, 3, 4]), (self.wait, [0.25, 0.5, 0.999, 1, 2]),
                 (self.cancel, [[goal_id] for goal_id in [*self.outcomes, "nobody's"]])]
        if self.active:  # or the last two might overtake the next goal: each topic has its own connection
            steps += [(self.cancel, [[self.active], [self.active] * 2]), (self.cancel, [[""]]),
                      (self.cancel_up_to_a_stamp, [-1, 0, 1])]
        elif self.clock.now > self.cancelled_until:
            # Only on a clock that stands: a cancel that overtakes its goal is kept for 5 s, which are soon over else.
            steps += [(self.end_a_goal_in_its_first_second, [*WAYS, "cancel at once"]),
                      (self.end_a_goal_while_the_clock_runs_fast, WAYS)]
        return steps

    def take(self, step, value):
        """Take a step, and expect that all goals have come to what they should, and nothing else."""
        self.done.append("%s(%r)" % (step.__name__, value))
        step(value)
        for goal_id, outcome in self.outcomes.items():
            self.raw.check_outcome(goal_id, *outcome)
        if self.active:
            self.raw.wait_bowls(self.active, self.washed())
            self.raw.wait(lambda: ACTIVE in self.raw.states.get(self.active, []), "%s ACTIVE" % self.active)
            assert self.raw.bowls_of(self.active) == bowls(self.washed()), "expected %d bowls of %s: %s" % (
                self.washed(), self.active, self.raw)
            assert self.active not in self.raw.results, "%s is over too early: %s" % (self.active, self.raw)
        assert self.raw.active_at_once <= 1, "%d goals ACTIVE at once: %s" % (self.raw.active_at_once, self.raw)

    def washed(self):
        return min(self.minutes, 1 + int((self.clock.now - self.begun).to_sec()))

    def check_outcome(self, goal_id, state, washed, text):
        """Expect this outcome of a goal, now and after each further step."""
        self.outcomes[goal_id] = (state, washed)
        result = self.raw.check_outcome(goal_id, state, washed)
        assert text in result.status.text, "expected the text %r of %s: %s" % (text, goal_id, self.raw)

    def end(self, state, text):
        if self.active:
            self.check_outcome(self.active, state, bowls(self.washed()), text)
        self.active = None

    def send(self, minutes):
        goal_id = self.raw.send(minutes)
        if self.clock.now <= self.cancelled_until:
            self.check_outcome(goal_id, RECALLED, [], "cancel")
            return
        self.end(PREEMPTED, "a newer goal came")
        if minutes > 0:
            self.active, self.minutes, self.begun = goal_id, minutes, self.clock.now
        elif minutes == 0:
            self.check_outcome(goal_id, SUCCEEDED, [], "all done")
        else:
            self.check_outcome(goal_id, ABORTED, [], "number_of_minutes is %d, must be 0 or more" % minutes)

    def wait(self, seconds):
        self.clock.turn(seconds, self.raw)
        if self.active and (self.clock.now - self.begun).to_sec() >= self.minutes:
            self.end(SUCCEEDED, "all done")

    def cancel(self, goal_ids):
        """Cancel the active goal, all goals, or one that is over or unknown."""
        for goal_id in goal_ids:
            self.raw.cancel(goal_id)
        if goal_ids[0] in (self.active, ""):
            self.end(PREEMPTED, "cancelled")

    def cancel_up_to_a_stamp(self, seconds):
        stamp = self.clock.now + rospy.Duration(seconds)
        self.raw.cancel(stamp=stamp)
        self.cancelled_until = max(self.cancelled_until, min(stamp, self.clock.now))
        if self.begun <= stamp:
            self.end(PREEMPTED, "cancelled")

    def end_a_goal_in_its_first_second(self, way, fast=False):
        goal_id = self.raw.send(1000000)
        if "at once" not in way:
            self.raw.wait_bowls(goal_id, 1)
        if "newer" in way:
            self.check_outcome(self.raw.send(int(fast)), SUCCEEDED, bowls(int(fast)), "all done")
        else:
            self.raw.cancel("" if way == "cancel all" else goal_id)
        result = self.raw.wait_result(goal_id)
        state, count = result.status.status, len(result.result.dishes_washed)
        assert state == PREEMPTED and (fast or count <= 1) or (state, count) == (RECALLED, 0) and "at once" in way, \
            "unexpected outcome of %s: %s" % (goal_id, self.raw)
        self.check_outcome(goal_id, state, bowls(count), "")

    def end_a_goal_while_the_clock_runs_fast(self, way):
        with running(self.clock):
            self.end_a_goal_in_its_first_second(way, fast=True)
        self.clock.turn_until_status_follows(self.raw)  # or the next goal may overtake the clock, and begin too early


@contextlib.contextmanager
def running(clock):
    """Let a clock run, by half a second every 2 ms or so."""
    def turn():
        while not stopped.wait(0.002):
            clock.turn(0.5)

    stopped, thread = threading.Event(), threading.Thread(target=turn, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopped.set()
        thread.join()


class TestRandomOrder(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("random_order_test")
        cls.clock = SimulatedClock()
        cls.raw = RawClient().wait_connected()
        cls.clock.turn_until_status_follows(cls.raw)

    def test_any_order_of_goals_cancels_and_waits(self):
        for number in range(SEQUENCES):
            sequence = Sequence(self.raw, self.clock)
            try:
                sequence.play(random.Random(SEED + number))
            except AssertionError as error:
                raise AssertionError("SEED=%d SEQUENCES=1 repeats it. Steps: %s\n%s" % (
                    SEED + number, ", ".join(sequence.done), error)) from error
        self.clock.turn(1000, self.raw)
        self.clock.turn(1000, self.raw)
        self.assertEqual([], self.raw.status.status_list, "goals that the server has not forgotten")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "random_order", TestRandomOrder)
