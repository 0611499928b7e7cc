"""The benchmark runs, and has all figures and pictures; its speed is not judged."""
import os
import re

from harness import PACKAGE, run

RUN = os.path.join(PACKAGE, "benchmark", "run.py")
COLUMNS = ["median", "floor", "`action_server.py`", "the same at 20 Hz", "`robust_action_server.py`", "robust is"]
ROWS = ["cancel → result (ms)", "newer goal → ACTIVE (ms)", "goal → first feedback (ms)",
        "empty goals one after the other (1/s)", "idle, CPU (%)", "idle, memory (MiB)"]


def test_quick_run_has_all_figures_and_pictures(workspace, tmp_path):
    output = run("/usr/bin/python3", RUN, "--quick", "--doc", str(tmp_path), timeout=200)
    table = re.search(r"(^\|.*\n)+", output, re.M).group()
    columns, _, *rows = [line.strip("| ").split(" | ") for line in table.splitlines()]
    assert columns == COLUMNS
    assert [row[0] for row in rows] == ROWS
    for _, *figures, ratio in rows:
        assert all(float(figure) > 0 for figure in figures)
        assert re.match(r"\d+(\.\d+)? × (floor|plain)$", ratio)
    assert table in (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    for name in "benchmark.svg", "timeline.svg", "demo.svg":
        assert (tmp_path / name).read_text(encoding="utf-8").rstrip().endswith("</svg>"), name
    assert "- bowl-6<" in (tmp_path / "demo.svg").read_text(encoding="utf-8")
