#!/usr/bin/python3
"""Goals of mixed length and ending through one server, under fast simulated time: no ending lost, nothing piles up.

The long one: ./tutorial shell rostest --text actions_tutorial many_goals.test goals:=10000
"""
import random
import time
import unittest

import rospy
import rostest

from raw_client import ABORTED, PREEMPTED, RECALLED, SUCCEEDED
from scenes import Scene
from processes import bowls, eventually
from simulated_clock import SimulatedClock

GROWTH = 1.05  # of the resident memory, from the end of the first part to the end of the last one
PART = 1000  # goals
ENDINGS = {"wait": {SUCCEEDED}, "refuse": {ABORTED}, "newer at once": {PREEMPTED, RECALLED}}  # the others PREEMPTED


def one_goal(scene, choose):
    """Send a goal, and end it in one of the ways there are; sometimes by a newer goal, which is then one more.

    Returns how many were sent. AssertionError if an ending is missing or wrong.
    """
    way = choose.choice(["wait", "wait", "refuse", "cancel", "cancel all", "newer", "newer at once"])
    minutes = {"wait": choose.randrange(0, 5), "refuse": -choose.randrange(1, 100)}.get(way, 1000000)
    goal_id = scene.send(minutes)
    if way in ("cancel", "cancel all", "newer"):
        scene.wait_bowls(goal_id, 1)
    if way.startswith("cancel"):
        scene.cancel(goal_id if way == "cancel" else "")
    newer = scene.send(1) if way.startswith("newer") else None
    result = scene.wait_result(goal_id)
    washed = minutes if way == "wait" else len(result.result.dishes_washed)
    assert result.status.status in ENDINGS.get(way, {PREEMPTED}), "'%s' of %d minutes:\n%s" % (way, minutes, result)
    scene.check_ending(goal_id, result.status.status, bowls(washed))
    if newer:
        scene.check_ending(newer, SUCCEEDED, bowls(1))
    return 2 if newer else 1


class ManyGoals(unittest.TestCase):

    def test_no_ending_is_lost_and_nothing_piles_up(self):
        rospy.init_node("many_goals")
        goals, choose = rospy.get_param("~goals"), random.Random(rospy.get_param("~seed", 1))
        part, taken, sent, counted, begun = min(PART, goals // 3), [], 0, 0, time.monotonic()
        clock = SimulatedClock()
        self.addCleanup(clock.stop)
        with Scene("/many_goals") as scene:
            server = scene.server()
            clock.run(0.5, 0.002)
            while sent < goals:
                sent += one_goal(scene, choose)
                if sent >= part * (len(taken) + 1) or sent >= goals:
                    self.assertEqual([len(results) for results in scene.results.values()], [1] * (sent - counted),
                                     "one result for each goal: %s" % scene)
                    usage, counted = server.usage, sent
                    taken.append((usage.memory_info().rss // 1024, usage.num_threads(), usage.num_fds()))
                    print("%6d goals, %4.0f s: %d KiB resident, %d threads, %d open files" % (
                        (sent, time.monotonic() - begun) + taken[-1]), flush=True)
                    scene.forget()
            _, threads, files = map(min, zip(*taken))
            # Eventually: a call of a peer's takes a thread and a file as long as it lasts.
            eventually(lambda: server.usage.num_threads() <= threads and server.usage.num_fds() <= files,
                       "no more threads and open files at the end than after a part, of %s" % taken, scene)
        self.assertLessEqual(taken[-1][0], taken[0][0] * GROWTH, "KiB at the end, after one part, of %s" % taken)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "many_goals", ManyGoals)
