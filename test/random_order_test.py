#!/usr/bin/python3
"""What clients do with goals, in orders that hypothesis makes up: after each step the server keeps its word, and after
all of them nothing has piled up in it. The clock stands still while we wait: a server that looks for a cancel or a
newer goal now and then would never answer.

SEQUENCES (240) in the environment says how many; SEED (a new one each time, printed) repeats a run. The first third has
a seed of its own, so that what no other test notices is noticed in each run.
"""
import os
import random
import sys

import hypothesis
import hypothesis.strategies as st
import rospy
import rostest
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule, run_state_machine_as_test

from processes import bowls, eventually
from raw_client import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED
from scenes import ServerCase

SEQUENCES = int(os.environ.get("SEQUENCES", 240))
SEED = int(os.environ.get("SEED", random.randrange(2**32)))
GROWTH = 1.05  # of the resident memory, from the end of the first third to the end of the last one


class Sequences(RuleBasedStateMachine):
    """Keeps the one goal that may be ACTIVE, and what each goal that has ended must have come to."""

    scene = clock = None

    def __init__(self):
        super().__init__()
        self.endings = {}  # goal id -> (state, bowls)
        self.active = None  # goal id
        self.minutes = self.begun = None  # of the active goal: int, rospy.Time
        self.cancelled_until = rospy.Time()  # a goal with such a stamp is RECALLED when it comes

    def washed(self):
        return min(self.minutes, 1 + int((self.clock.now - self.begun).to_sec()))

    def check_ending(self, goal_id, state, washed, *words):
        """Expect this ending of a goal with words (str) in its text, now and after each further step."""
        self.endings[goal_id] = (state, washed)
        text = self.scene.check_ending(goal_id, state, washed).status.text
        assert all(word in text for word in words), "expected %s in the text of %s: %s" % (words, goal_id, self.scene)

    def end(self, state, words):
        if self.active:
            self.check_ending(self.active, state, bowls(self.washed()), words)
        self.active = None

    @rule(minutes=st.integers(-2, 4) | st.just(-2**31))
    def send(self, minutes):
        goal_id = self.scene.send(minutes)
        if self.clock.now <= self.cancelled_until:
            self.check_ending(goal_id, RECALLED, [])
            return
        self.end(PREEMPTED, "newer goal")
        if minutes > 0:
            self.active, self.minutes, self.begun = goal_id, minutes, self.clock.now
        elif minutes == 0:
            self.check_ending(goal_id, SUCCEEDED, [])
        else:
            self.check_ending(goal_id, ABORTED, [], str(minutes), "0 or more")

    @rule(seconds=st.sampled_from([0.25, 0.5, 0.999, 1.0, 2.0]))
    def wait(self, seconds):
        self.clock.turn(seconds, self.scene)
        if self.active and (self.clock.now - self.begun).to_sec() >= self.minutes:
            self.end(SUCCEEDED, "all done")

    @precondition(lambda self: self.active)
    @rule(times=st.integers(1, 2))
    def cancel_goal(self, times):
        for _ in range(times):
            self.scene.cancel(self.active)
        self.end(PREEMPTED, "cancelled")

    # Without an active goal, the next two might overtake the next one: each topic has its own connection.

    @precondition(lambda self: self.active)
    @rule()
    def cancel_all(self):
        self.scene.cancel()
        self.end(PREEMPTED, "cancelled")

    @precondition(lambda self: self.active)
    @rule(seconds=st.sampled_from([-1, 0, 1]))
    def cancel_up_to_a_stamp(self, seconds):
        stamp = self.clock.now + rospy.Duration(seconds)
        self.scene.cancel(stamp=stamp)
        self.cancelled_until = max(self.cancelled_until, stamp)
        if self.begun <= stamp:
            self.end(PREEMPTED, "cancelled")

    @rule(data=st.data())
    def cancel_an_ended_or_unknown_goal(self, data):
        self.scene.cancel(data.draw(st.sampled_from(sorted(self.endings) + ["nobody's"])))

    @precondition(lambda self: not self.active and self.clock.now > self.cancelled_until)
    @rule(how=st.sampled_from(["cancel", "cancel all", "newer", "cancel at once", "newer at once"]), fast=st.booleans())
    def end_a_goal_in_its_first_second_or_while_the_clock_runs_fast(self, how, fast):
        if fast:
            self.clock.run(0.5, 0.002)
        try:
            goal_id = self.scene.send(1000000)
            if "at once" not in how:
                self.scene.wait_bowls(goal_id, 1)
            if "newer" in how:
                newer = self.scene.send(int(fast))
                self.check_ending(newer, SUCCEEDED, bowls(int(fast)))
            else:
                self.scene.cancel("" if how == "cancel all" else goal_id)
            result = self.scene.wait_result(goal_id)
        finally:
            self.clock.stop()
        self.clock.turn(0.25, self.scene)  # or the next goal may overtake the clock, and begin too early
        state, count = result.status.status, len(result.result.dishes_washed)
        assert state == PREEMPTED and (fast or count <= 1) or (state, count) == (RECALLED, 0) and "at once" in how, \
            "unexpected ending of %s: %s" % (goal_id, self.scene)
        self.check_ending(goal_id, state, bowls(count))

    @invariant()
    def every_goal_keeps_its_one_ending(self):
        for goal_id, expected in self.endings.items():
            self.scene.check_ending(goal_id, *expected)

    @invariant()
    def one_goal_is_active_at_most(self):
        assert self.scene.active_at_once <= 1, "%d goals ACTIVE at once: %s" % (self.scene.active_at_once, self.scene)
        if self.active:
            self.scene.wait_bowls(self.active, self.washed())
            self.scene.wait(lambda: ACTIVE in self.scene.states.get(self.active, []), "%s ACTIVE" % self.active)
            assert self.scene.bowls_of(self.active) == bowls(self.washed()), "expected %d bowls of %s; came: %s" % (
                self.washed(), self.active, self.scene)
            assert self.active not in self.scene.results, "%s has ended too early: %s" % (self.active, self.scene)

    def teardown(self):
        """The server takes the next goal."""
        self.wait(2)  # until no stamp to come is cancelled
        self.send(0)
        self.every_goal_keeps_its_one_ending()


class TestRandomOrder(ServerCase):

    def test_any_order_of_goals_cancels_and_waits(self):
        Sequences.scene, Sequences.clock = self.scene, self.clock
        print("SEED=%d" % SEED, file=sys.__stdout__, flush=True)
        # Twelve steps can be read as they are; to look for fewer that fail would take 50 s for each try.
        settings = hypothesis.settings(
            max_examples=SEQUENCES // 3, stateful_step_count=12, deadline=None, database=None, print_blob=False,
            phases=[hypothesis.Phase.generate], suppress_health_check=list(hypothesis.HealthCheck))
        usage, taken = self.server.usage, []
        for seed in 1, SEED, SEED + 1:
            try:
                run_state_machine_as_test(hypothesis.seed(seed)(Sequences), settings=settings)
            except Exception as error:  # hypothesis has some of its own
                raise AssertionError("SEED=%d repeats it: %s" % (SEED, error)) from error
            taken.append((usage.memory_info().rss // 1024, usage.num_threads(), usage.num_fds()))
        what = "(KiB resident, threads, open files) after each third: %s" % taken
        print(what, file=sys.__stdout__, flush=True)
        self.assertLessEqual(taken[-1][0], taken[0][0] * GROWTH, what)
        _, threads, files = map(min, zip(*taken))
        # Eventually: a call of a peer's takes a thread and a file as long as it lasts.
        eventually(lambda: usage.num_threads() <= threads and usage.num_fds() <= files, "as few as at first, " + what,
                   self.server)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "random_order", TestRandomOrder)
