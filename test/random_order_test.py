#!/usr/bin/python3
"""Goals, newer goals, cancels and waits in orders that hypothesis makes up: after each step, the server keeps its word.

SEQUENCES (200) in the environment says how many; SEED (a new one each time, printed) repeats a run.
"""
import os
import random
import sys

import hypothesis
import hypothesis.strategies as st
import rostest
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from processes import bowls
from raw_client import ABORTED, PREEMPTED, SUCCEEDED
from scenes import ServerCase

SEQUENCES = int(os.environ.get("SEQUENCES", 200))
SEED = int(os.environ.get("SEED", random.randrange(2**32)))


class Sequences(RuleBasedStateMachine):
    """Keeps the one goal that may be ACTIVE, and what each goal that has ended must have come to."""

    scene = clock = None

    def __init__(self):
        super().__init__()
        self.endings = {}  # goal id -> (state, bowls)
        self.active = None  # goal id
        self.minutes = self.begun = None  # of the active goal: int, rospy.Time
        self.scene.active_at_once = 0

    def washed(self):
        return min(self.minutes, 1 + int((self.clock.now - self.begun).to_sec()))

    def end(self, state):
        if self.active:
            self.endings[self.active] = (state, bowls(self.washed()))
            self.scene.wait_result(self.active)
        self.active = None

    @rule(minutes=st.integers(-2, 4))
    def send(self, minutes):
        self.wait(0.25)  # a stamp of its own
        goal_id = self.scene.send(minutes)
        self.end(PREEMPTED)
        if minutes > 0:
            self.active, self.minutes, self.begun = goal_id, minutes, self.clock.now
        else:
            self.endings[goal_id] = (SUCCEEDED if minutes == 0 else ABORTED, [])
            self.scene.wait_result(goal_id)

    @rule(seconds=st.sampled_from([0.25, 0.5, 1.0, 2.0]))
    def wait(self, seconds):
        self.clock.turn(seconds, self.scene)
        if self.active:
            if (self.clock.now - self.begun).to_sec() >= self.minutes:
                self.end(SUCCEEDED)
            else:
                self.scene.wait_bowls(self.active, self.washed())

    @precondition(lambda self: self.active)
    @rule()
    def cancel_goal(self):
        self.scene.cancel(self.active)
        self.end(PREEMPTED)

    @precondition(lambda self: self.active)  # or it might overtake the next goal: each topic has its own connection
    @rule()
    def cancel_all(self):
        self.scene.cancel()
        self.end(PREEMPTED)

    @rule()
    def cancel_up_to_now(self):
        self.scene.cancel(stamp=self.clock.now)
        self.end(PREEMPTED)

    @precondition(lambda self: self.endings)
    @rule(data=st.data())
    def cancel_ended(self, data):
        self.scene.cancel(data.draw(st.sampled_from(sorted(self.endings))))

    @invariant()
    def every_goal_keeps_its_one_ending(self):
        for goal_id, expected in self.endings.items():
            self.scene.check_ending(goal_id, *expected)

    @invariant()
    def one_goal_is_active_at_most(self):
        assert self.scene.active_at_once <= 1, "%d goals ACTIVE at once: %s" % (self.scene.active_at_once, self.scene)
        if self.active:
            self.scene.wait_bowls(self.active, self.washed())
            assert self.scene.bowls_of(self.active) == bowls(self.washed()), "expected %d bowls of %s; came: %s" % (
                self.washed(), self.active, self.scene)
            assert self.active not in self.scene.results, "%s has ended too early: %s" % (self.active, self.scene)

    def teardown(self):
        """The server takes the next goal."""
        self.send(0)
        self.every_goal_keeps_its_one_ending()


class TestRandomOrder(ServerCase):

    def test_any_order_of_goals_cancels_and_waits(self):
        Sequences.scene, Sequences.clock = self.scene, self.clock
        print("SEED=%d" % SEED, file=sys.__stdout__, flush=True)
        settings = hypothesis.settings(
            max_examples=SEQUENCES, stateful_step_count=12, deadline=None, database=None, print_blob=False,
            suppress_health_check=list(hypothesis.HealthCheck))
        try:
            run_state_machine_as_test(hypothesis.seed(SEED)(Sequences), settings=settings)
        except AssertionError as error:
            raise AssertionError("SEED=%d repeats it: %s" % (SEED, error)) from error


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "random_order", TestRandomOrder)
