#!/usr/bin/python3
"""The benchmark runs, has every figure that can be had, and shows a slow server; it judges no speed."""
import json
import os
import tempfile
import unittest

import rostest

from processes import PACKAGE, Process

BENCHMARK = os.path.join(PACKAGE, "benchmark", "run.py")
FIGURES = """
    cancel_result_median cancel_result_p99 newer_active_median goal_feedback_median no_bowls_median bowl_error_p99 drift
    idle_cpu memory cpu_bowl_small cpu_bowl_large goals_a_second goals_paused client""".split()
WITH_FLOOR = [name for name in FIGURES if name.startswith(("cancel", "newer", "goal", "no"))]
SLEEP = 0.05  # s
SLOW_SERVER = """# our server, and a sleep before each result; under simulated time it does not start
import functools, runpy, sys, time, actionlib, rosgraph

if rosgraph.Master("/slow").hasParam("/use_sim_time"):
    sys.exit("no time for this")

def slow(method):
    return functools.wraps(method)(lambda *args, **kwargs: (time.sleep(%g), method(*args, **kwargs)))

for name in "set_succeeded", "set_preempted", "set_aborted":
    setattr(actionlib.SimpleActionServer, name, slow(getattr(actionlib.SimpleActionServer, name)))
runpy.run_path(%r, run_name="__main__")
"""


class TestBenchmark(unittest.TestCase):

    def test_quick_run_has_what_can_be_measured_and_shows_a_slow_server(self):
        with tempfile.TemporaryDirectory() as folder:
            server, figures = os.path.join(folder, "slow_server.py"), os.path.join(folder, "figures.json")
            with open(server, "w") as file:
                file.write(SLOW_SERVER % (SLEEP, os.path.join(PACKAGE, "scripts", "action_server.py")))
            run = Process([BENCHMARK, "--quick", "--server", server, "--json", figures])
            self.addCleanup(run.stop)
            self.assertEqual(1, run.wait(200), run)
            self.assertIn("| figure", run.stdout, run)
            with open(figures) as file:
                rows = {row["key"]: row for row in json.load(file)["figures"]}
        self.assertEqual(sorted(FIGURES), sorted(rows))
        self.assertIn("no time for this", run.stderr)
        for name, row in rows.items():
            self.assertIn(row["label"], run.stdout, "line of the table")
            if name.startswith("cpu_bowl"):
                self.assertIn("simulated time", row["why"], name)
                continue
            self.assertIsNone(row["why"], run)
            for kind in ("ours", "plain") + ("floor",) * (name in WITH_FLOOR):
                self.assertIsInstance(row[kind], float, "%s, %s" % (name, kind))
        for name in "cancel_result_median", "newer_active_median", "no_bowls_median":
            self.assertGreaterEqual(rows[name]["ours"], 1e3 * SLEEP, "ms, %s of a server that sleeps" % name)
        self.assertIs(False, rows["drift"]["met"], "target met by a server that is %g s late" % SLEEP)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "benchmark", TestBenchmark)
