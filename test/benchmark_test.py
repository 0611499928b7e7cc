#!/usr/bin/python3
"""The benchmark runs, has every figure, and shows a server that is slow on purpose; it judges no speed."""
import json
import os
import shutil
import subprocess
import tempfile
import unittest

import rostest

HERE = os.path.dirname(os.path.realpath(__file__))
SERVER = os.path.join(HERE, "..", "scripts", "action_server.py")
FIGURES = """
    cancel_result_median cancel_result_p99 newer_active_median newer_active_p99 goal_feedback_median goal_feedback_p99
    bowl_error_p99 drift idle_cpu memory cpu_bowl_small cpu_bowl_middle cpu_bowl_large goals_a_second goals_paused start
    cancel_result_clients_0 cancel_result_clients_1 cancel_result_clients_2""".split()
WITH_FLOOR = [name for name in FIGURES if name.startswith(("cancel", "newer", "goal"))]
SLEEP = 0.05  # s
SLOW_SERVER = """# our server, and a sleep before each result
import functools, runpy, time, actionlib

def slow(method):
    return functools.wraps(method)(lambda *args, **kwargs: (time.sleep(%g), method(*args, **kwargs)))

for name in "set_succeeded", "set_preempted", "set_aborted":
    setattr(actionlib.SimpleActionServer, name, slow(getattr(actionlib.SimpleActionServer, name)))
runpy.run_path(%r, run_name="__main__")
"""


class TestBenchmark(unittest.TestCase):

    def test_quick_run_has_every_figure_and_shows_a_slow_server(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        server, figures = os.path.join(folder, "slow_server.py"), os.path.join(folder, "figures.json")
        with open(server, "w") as file:
            file.write(SLOW_SERVER % (SLEEP, SERVER))
        run = subprocess.run(
            [os.path.join(HERE, "benchmark", "run.py"), "--quick", "--server", server, "--json", figures],
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=200)
        self.assertEqual(0, run.returncode, "exit status; the benchmark said:\n" + run.stdout)
        with open(figures) as file:
            rows = {row["key"]: row for row in json.load(file)["figures"]}
        self.assertEqual(sorted(FIGURES), sorted(rows))
        for name, row in rows.items():
            for kind in ("ours", "polling") + ("floor",) * (name in WITH_FLOOR):
                self.assertIsInstance(row[kind], float, "%s, %s" % (name, kind))
            self.assertIn(row["label"], run.stdout, "line of the table")
        for name in "cancel_result_median", "newer_active_median", "cancel_result_clients_2":
            self.assertGreaterEqual(rows[name]["ours"], 1e3 * SLEEP, "ms, %s of a server that sleeps" % name)
        self.assertIs(False, rows["drift"]["met"], "goal met by a server that is %g s late" % SLEEP)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "benchmark", TestBenchmark)
