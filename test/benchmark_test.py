#!/usr/bin/python3
"""The benchmark runs, and has every figure; it judges no speed."""
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


class TestBenchmark(unittest.TestCase):

    def test_quick_run_has_every_figure(self):
        with tempfile.NamedTemporaryFile("r") as figures:
            run = Process([BENCHMARK, "--quick", "--json", figures.name])
            self.addCleanup(run.stop)
            self.assertEqual(0, run.wait(200), run)
            rows = {row["key"]: row for row in json.load(figures)["figures"]}
        self.assertIn("| figure", run.stdout, run)
        self.assertEqual(sorted(FIGURES), sorted(rows))
        for name, row in rows.items():
            self.assertIn(row["label"], run.stdout, "line of the table")
            for kind in ("ours", "plain") + ("floor",) * (name in WITH_FLOOR):
                self.assertIsInstance(row[kind], float, "%s, %s" % (name, kind))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "benchmark", TestBenchmark)
