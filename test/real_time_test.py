#!/usr/bin/python3
"""Without simulated time, at once is at once; client_test.py sees that a second is a second."""
import statistics
import time

import rostest

from processes import bowls
from raw_client import PREEMPTED
from scenes import NodeCase, Scene

# s, of a median: a hundred times what an idle machine needs, and less than the 100 ms that actionlib's own loop pauses
# between two goals, or than what a server needs that looks for a cancel five times a second or less often.
AT_ONCE = 0.08


class TestRealTime(NodeCase):

    def test_cancel_and_newer_goal_act_at_once(self):
        with Scene("") as scene:
            scene.server()
            cancelled, handed_over = [], []
            for _ in range(9):
                older = scene.send(30)
                scene.wait_bowls(older, 1)
                newer = scene.send(30)
                scene.wait_bowls(newer, 1)
                begun = time.monotonic()
                scene.cancel(newer)
                for goal_id in older, newer:
                    scene.check_ending(goal_id, PREEMPTED, bowls(1))
                handed_over.append(scene.times[newer, "bowl-0"] - scene.times[newer, "sent"])
                cancelled.append(scene.times[newer, "result"] - begun)
            for what, took in ("newer goal to its first bowl", handed_over), ("cancel to result", cancelled):
                self.assertLess(statistics.median(took), AT_ONCE, "median of the seconds from %s: %s" % (what, took))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "real_time", TestRealTime)
