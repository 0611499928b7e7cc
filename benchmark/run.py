#!/usr/bin/env python3
"""Measures the action servers of this package beside a node without actionlib: ./tutorial benchmark."""
import argparse
import gc
import os
import platform
import re
import signal
import subprocess
import sys
import time

COLUMNS = {"floor": "floor", "plain": "`action_server.py`", "hz20": "the same at 20 Hz",
           "robust": "`robust_action_server.py`"}
ROWS = (  # label, figure, factor, and what robust is compared with
    ("cancel → result (ms)", "cancel", 1e3, "floor"),
    ("newer goal → ACTIVE (ms)", "newer", 1e3, "floor"),
    ("goal → first feedback (ms)", "feedback", 1e3, "plain"),
    ("empty goals one after the other (1/s)", "empty", 1, "plain"),
    ("idle, CPU (%)", "cpu", 1, "plain"),
    ("idle, memory (MiB)", "memory", 1, "plain"))


def arguments():
    parser = argparse.ArgumentParser(prog="benchmark", description="Prints the table of doc/benchmark.md.")
    parser.add_argument("--doc", metavar="FOLDER", help="write the page with its pictures")
    parser.add_argument("--quick", action="store_true", help="takes a minute, as a trial: the figures mean nothing")
    return parser.parse_args()


def table(benchmark):
    """Returns the medians as a Markdown table."""
    lines = [["median", *COLUMNS.values(), "robust is"], ["---", *["---:"] * 5]]
    for label, figure, factor, base in ROWS:
        values = {kind: factor * benchmark.median(figure, kind) for kind in COLUMNS}
        lines.append([label, *(number(value) for value in values.values()),
                      "%s × %s" % (number(values["robust"] / values[base]), base)])
    return "".join("| %s |\n" % " | ".join(line) for line in lines)


def number(value):
    return "%.*f" % (2 if value < 10 else 0, value)


def machine():
    with open("/etc/os-release") as file:
        system = re.search(r'^PRETTY_NAME="?([^"\n]*)', file.read(), re.M).group(1)
    return "%d cores, %s, Python %s" % (len(os.sched_getaffinity(0)), system, platform.python_version())


def write(folder, benchmark, timeline):
    """Write doc/benchmark.md with the new table and machine, and the pictures, into folder."""
    import pictures  # after all measurements: matplotlib takes memory
    from support.processes import PACKAGE
    with open(os.path.join(PACKAGE, "doc", "benchmark.md"), encoding="utf-8") as file:
        page = file.read()
    page = re.sub(r"(^\|.*\n)+", lambda _: table(benchmark), page, 1, re.M)
    page = re.sub(r"^Measured on .*", lambda _: "Measured on %s." % machine(), page, 1, re.M)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, "benchmark.md"), "w", encoding="utf-8") as file:
        file.write(page)
    pictures.plot(benchmark, os.path.join(folder, "benchmark.svg"))
    pictures.timeline(timeline, os.path.join(folder, "timeline.svg"))


def main(args):
    # Not at the top: --help needs no ROS.
    from samples import FULL, QUICK, Benchmark
    from support.processes import Master
    import rospy
    begun, plan = time.monotonic(), QUICK if args.quick else FULL
    gc.disable()  # or it may add up to 0.2 s to a sample
    with Master() as master:
        os.environ.update(master.env)
        master.start("rosrun", "rosout", "rosout", stdout=subprocess.DEVNULL)  # as roscore does
        rospy.init_node("benchmark", disable_signals=True)
        try:
            say("starting the servers")
            benchmark = Benchmark(master, plan)
            say("cancels, newer goals, first feedback: %d rounds of about 5 s" % plan["rounds"])
            benchmark.measure_reactions()
            say("idle servers: %d s" % (plan["windows"] * plan["seconds"]))
            benchmark.measure_idle()
            say("empty goals: %d rounds of about 8 s" % plan["bursts"])
            benchmark.measure_bursts()
            if args.doc:
                say("the pictures: 20 s")
                write(args.doc, benchmark, benchmark.timeline())
        finally:
            rospy.signal_shutdown("done")
    print("%s\n%s. %d s." % (table(benchmark), machine(), time.monotonic() - begun))


def say(what):
    print(what, file=sys.stderr, flush=True)


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        sys.exit(main(arguments()))
    except KeyboardInterrupt:
        sys.exit("benchmark: stopped")
    except (AssertionError, OSError) as error:
        sys.exit("benchmark: %s" % error)
