#!/usr/bin/env python3
"""Measures the action servers of this package, and a node without actionlib to compare with: ./tutorial benchmark."""
import argparse
import os
import platform
import re
import statistics
import sys

from measure import Benchmark
import pictures
from support.processes import Master

COLUMNS = {"floor": "floor", "plain": "`action_server.py`", "hz20": "the same at 20 Hz",
           "robust": "`robust_action_server.py`"}
ROWS = (  # label, figure, and the server that robust is compared with
    ("cancel → result (ms)", "cancel", "floor"),
    ("newer goal → ACTIVE (ms)", "newer", "floor"),
    ("goal → first feedback (ms)", "feedback", "plain"),
    ("empty goals one after the other (1/s)", "empty", "plain"),
    ("idle, CPU (%)", "cpu", "plain"),
    ("idle, memory (MiB)", "memory", "plain"))


def table_of(samples):
    """Returns the medians as a Markdown table."""
    lines = [["median", *COLUMNS.values(), "robust is"], ["---"] + 5 * ["---:"]]
    for label, figure, base in ROWS:
        medians = {kind: statistics.median(samples[figure, kind]) for kind in COLUMNS}
        ratio = "%s × %s" % (number(medians["robust"] / medians[base]), base)
        lines.append([label, *map(number, medians.values()), ratio])
    return "".join("| %s |\n" % " | ".join(line) for line in lines)


def number(value):
    return "%.*f" % (2 if value < 10 else 0, value)


def machine():
    with open("/etc/os-release") as file:
        system = re.search(r'^PRETTY_NAME="?([^"\n]*)', file.read(), re.M).group(1)
    return "%d cores, %s, Python %s" % (os.cpu_count(), system, platform.python_version())


def write_page(folder, table):
    """Write doc/benchmark.md into folder, with a new table and machine."""
    with open(os.path.join(os.path.dirname(__file__), "..", "doc", "benchmark.md"), encoding="utf-8") as file:
        page = file.read()
    page = re.sub(r"(^\|.*\n)+", table, page, 1, re.M)
    page = re.sub(r"^Measured on .*", "Measured on %s." % machine(), page, 1, re.M)
    with open(os.path.join(folder, "benchmark.md"), "w", encoding="utf-8") as file:
        file.write(page)


def main():
    parser = argparse.ArgumentParser(prog="benchmark", description="Prints the table of doc/benchmark.md.")
    parser.add_argument("--doc", metavar="FOLDER", help="write the page with its pictures")
    parser.add_argument("--quick", action="store_true", help="takes a minute, as a trial: the figures mean nothing")
    args = parser.parse_args()

    rounds, windows, bursts = (2, 1, 1) if args.quick else (40, 6, 5)
    with Master() as master:
        benchmark = Benchmark(master)
        say("cancels, newer goals, first feedback: %d rounds of about 6 s" % rounds)
        benchmark.measure_reactions(rounds)
        say("idle servers: %d times 10 s" % windows)
        benchmark.measure_idle(windows)
        say("empty goals: %d rounds of about 8 s" % bursts)
        benchmark.measure_empty_goals(bursts)
        timelines = benchmark.timelines() if args.doc else None

    table = table_of(benchmark.samples)
    print("%s\n%s." % (table, machine()))
    if args.doc:
        os.makedirs(args.doc, exist_ok=True)
        write_page(args.doc, table)
        pictures.draw_cancels(benchmark.samples, os.path.join(args.doc, "benchmark.svg"))
        pictures.draw_timelines(timelines, os.path.join(args.doc, "timeline.svg"))


def say(what):
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit("benchmark: stopped")
