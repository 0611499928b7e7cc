"""The benchmark runs, and has all figures and pictures; its speed is not judged."""
import os
import re

from support.processes import PACKAGE, run


def test_quick_run_has_all_figures_and_pictures(tmp_path):
    output = run(os.path.join(PACKAGE, "tutorial"), "benchmark", "--quick", "--doc", str(tmp_path), timeout=600)
    table = re.search(r"(^\|.*\n)+", output, re.M).group()
    _, _, *rows = [line.strip("| ").split(" | ") for line in table.splitlines()]
    assert len(rows) == 6
    for _, *figures, ratio in rows:
        assert len(figures) == 4 and all(float(figure) > 0 for figure in figures)
        assert re.match(r"\d+(\.\d+)? × (floor|plain)$", ratio)
    assert table in (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    for name in "benchmark.svg", "timeline.svg":
        assert (tmp_path / name).exists(), name
