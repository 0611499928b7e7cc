#!/usr/bin/python3
"""Without simulated time, a second is a second, and at once is at once."""
import statistics
import time

import rostest

from processes import bowls
from raw_client import PREEMPTED, SUCCEEDED
from scenes import NodeCase, Scene

# s, of a median: a hundred times what an idle machine needs, and less than the 100 ms that actionlib's own loop pauses
# between two goals, or than what a server needs that looks for a cancel five times a second or less often.
AT_ONCE = 0.08


class TestRealTime(NodeCase):

    def test_four_bowls_take_four_seconds_and_cancel_and_newer_goal_act_at_once(self):
        def since(begun, goal_id, event):
            """Wait for the event. Returns the seconds from begun (as of time.monotonic()) to it."""
            scene.wait(lambda: (goal_id, event) in scene.times, "%s of %s" % (event, goal_id))
            return scene.times[goal_id, event] - begun

        with Scene("") as scene:
            server, begun = scene.server(), time.monotonic()
            goal_id = scene.send(4)
            result = scene.check_ending(goal_id, SUCCEEDED, bowls(4))
            took = since(begun, goal_id, "result")
            stamps = [message.header.stamp for message in scene.feedback[goal_id] + [result]]
            seconds = [(stamp - stamps[0]).to_sec() for stamp in stamps]
            for i, second in enumerate(seconds):
                # Never early but by what the first one was late, and late by what a busy machine may take.
                self.assertTrue(i - 0.5 < second < i + 2, "expected second %d, came %s" % (i, seconds))
            self.assertTrue(3.9 < took < 15, "expected 4 s, took %.2f s" % took)
            server.expect("goal accepted: number_of_minutes 4$")
            server.expect("goal SUCCEEDED: all done$")

            cancelled, handed_over = [], []
            for _ in range(9):
                older = scene.send(30)
                since(0, older, "bowl-0")
                begun, newer = time.monotonic(), scene.send(30)
                handed_over.append(since(begun, newer, "bowl-0"))
                begun = time.monotonic()
                scene.cancel(newer)
                cancelled.append(since(begun, newer, "result"))
                for goal_id in older, newer:
                    scene.check_ending(goal_id, PREEMPTED, bowls(1))
            for what, took in ("newer goal to its first bowl", handed_over), ("cancel to result", cancelled):
                self.assertLess(statistics.median(took), AT_ONCE, "median of the seconds from %s: %s" % (what, took))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "real_time", TestRealTime)
