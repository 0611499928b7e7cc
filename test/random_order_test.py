#!/usr/bin/python3
"""What clients do with goals, in orders that chance makes up: after each step the server keeps its word, and after all
nothing has piled up in it. The clock stands still: a server that looks for a stop now and then would never answer.

SEQUENCES (240) in the environment says how many; SEED (printed) repeats a run. The first third has a seed of its own,
so that what no other test notices is noticed in each run.
"""
import os
import random
import sys

import rospy
import rostest

from processes import bowls, eventually
from raw_client import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED
from scenes import ServerCase

SEQUENCES = int(os.environ.get("SEQUENCES", 240))
SEED = int(os.environ.get("SEED", random.randrange(2**32)))
STEPS = 12  # of a sequence; so few can be read as they are
GROWTH = 640  # KiB resident, from the end of the first third to the end of the last one: 320 were the most of 217 runs,
# and a server that forgets no goal has 900
WAYS = "cancel", "cancel all", "newer", "newer at once"


class Sequence:
    """Keeps the one goal that may be ACTIVE, and what each goal that has ended must have come to."""

    def __init__(self, scene, clock):
        self.scene, self.clock = scene, clock
        self.done = []  # steps (str)
        self.endings = {}  # goal id -> (state, bowls)
        self.active = None  # goal id
        self.minutes = self.begun = None  # of the active goal: int, rospy.Time
        self.cancelled_until = rospy.Time()  # a goal with such a stamp is RECALLED when it comes

    def play(self, choose):
        """Take STEPS steps, which choose (random.Random) chooses, and see that the server takes the next goal."""
        for _ in range(STEPS):
            step, values = choose.choice(self.possible())
            self.take(step, choose.choice(values))
        self.take(self.wait, 2)  # until no stamp to come is cancelled
        self.take(self.send, 0)

    def possible(self):
        """Returns the steps that may be taken now, each with the values that it takes."""
        steps = [(self.send, [-2**31, -2, -1, 0, 1, 2, 3, 4]), (self.wait, [0.25, 0.5, 0.999, 1, 2]),
                 (self.cancel, [[goal_id] for goal_id in [*self.endings, "nobody's"]])]
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
        for goal_id, ending in self.endings.items():
            self.scene.check_ending(goal_id, *ending)
        if self.active:
            self.scene.wait_bowls(self.active, self.washed())
            self.scene.wait(lambda: ACTIVE in self.scene.states.get(self.active, []), "%s ACTIVE" % self.active)
            assert self.scene.bowls_of(self.active) == bowls(self.washed()), "expected %d bowls of %s; came: %s" % (
                self.washed(), self.active, self.scene)
            assert self.active not in self.scene.results, "%s has ended too early: %s" % (self.active, self.scene)
        assert self.scene.active_at_once <= 1, "%d goals ACTIVE at once: %s" % (self.scene.active_at_once, self.scene)

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

    def wait(self, seconds):
        self.clock.turn(seconds, self.scene)
        if self.active and (self.clock.now - self.begun).to_sec() >= self.minutes:
            self.end(SUCCEEDED, "all done")

    def cancel(self, goal_ids):
        """Cancel the active goal, all goals, or one that has ended or is unknown."""
        for goal_id in goal_ids:
            self.scene.cancel(goal_id)
        if goal_ids[0] in (self.active, ""):
            self.end(PREEMPTED, "cancelled")

    def cancel_up_to_a_stamp(self, seconds):
        stamp = self.clock.now + rospy.Duration(seconds)
        self.scene.cancel(stamp=stamp)
        self.cancelled_until = max(self.cancelled_until, stamp)
        if self.begun <= stamp:
            self.end(PREEMPTED, "cancelled")

    def end_a_goal_in_its_first_second(self, way, fast=False):
        goal_id = self.scene.send(1000000)
        if "at once" not in way:
            self.scene.wait_bowls(goal_id, 1)
        if "newer" in way:
            self.check_ending(self.scene.send(int(fast)), SUCCEEDED, bowls(int(fast)))
        else:
            self.scene.cancel("" if way == "cancel all" else goal_id)
        result = self.scene.wait_result(goal_id)
        state, count = result.status.status, len(result.result.dishes_washed)
        assert state == PREEMPTED and (fast or count <= 1) or (state, count) == (RECALLED, 0) and "at once" in way, \
            "unexpected ending of %s: %s" % (goal_id, self.scene)
        self.check_ending(goal_id, state, bowls(count))

    def end_a_goal_while_the_clock_runs_fast(self, way):
        self.clock.run(0.5, 0.002)
        try:
            self.end_a_goal_in_its_first_second(way, fast=True)
        finally:
            self.clock.stop()
        self.clock.turn(0.25, self.scene)  # or the next goal may overtake the clock, and begin too early


class TestRandomOrder(ServerCase):

    def test_any_order_of_goals_cancels_and_waits(self):
        print("SEED=%d" % SEED, file=sys.__stdout__, flush=True)
        usage, taken = self.server.usage, []
        for seed in 1, SEED, SEED + 1:
            choose = random.Random(seed)
            for _ in range(SEQUENCES // 3):
                sequence = Sequence(self.scene, self.clock)
                try:
                    sequence.play(choose)
                except AssertionError as error:
                    what = str(error)
                    if len(what) > 8000:  # the server has said much by now
                        what = "%s\n  […]\n%s" % (what[:4000], what[-4000:])
                    raise AssertionError("SEED=%d repeats it. Steps: %s\n%s" % (
                        SEED, ", ".join(sequence.done), what)) from error
            taken.append((usage.memory_info().rss // 1024, usage.num_threads(), usage.num_fds()))
        what = "(KiB resident, threads, open files) after each third: %s" % taken
        print(what, file=sys.__stdout__, flush=True)
        self.assertLessEqual(taken[-1][0], taken[0][0] + GROWTH, what)
        _, threads, files = map(min, zip(*taken))
        # Eventually: a call of a peer's takes a thread and a file as long as it lasts.
        eventually(lambda: usage.num_threads() <= threads and usage.num_fds() <= files, "as few as at first, " + what,
                   self.server)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "random_order", TestRandomOrder)
