"""The benchmark's figures: the rows made of its samples, as a table and JSON."""
import json
import math
import os
import platform
import re
from statistics import mean, median

KINDS = "ours", "plain", "floor"


def p99(values):
    return sorted(values)[math.ceil(0.99 * len(values)) - 1]


def rate(values):
    return 1 / mean(values)


def pauses(values):
    """The share, in %, of goals that met the 100 ms pause of actionlib's executeLoop."""
    usual = median(values)
    return 100 * sum(value > usual + 0.08 for value in values) / len(values)


def figures(samples, plan, failures):
    """Returns the rows of the table: dicts of key, label, unit, ours, plain, floor, ratio, ratio_to, target, met, why
    (it has no values: what failures has for its figure), n (kind -> how many samples)."""
    small, large = ("n = %d" % size for size in plan["sizes"])
    rows = []

    def row(key, label, unit, statistic, figure, floor=None, target=None, times=None, above=None, at_least=False):
        """target: the most (at_least: the least) that ours may have, in unit, or times what another kind has (or ours
        at the small size), or above that."""
        sources = {"ours": (figure, "ours"), "plain": (figure, "plain"), "floor": (floor, "floor"),
                   small: (small, "ours")}
        value = {kind: statistic(samples[source]) * (1e3 if unit == "ms" else 1)
                 for kind, source in sources.items() if source in samples}
        judged, other, wanted, met = value.get("ours"), value.get(times or above), "", None
        if judged is not None and (times or above):
            judged = None if not other else judged / other if times else judged - other
        if target is not None:
            wanted = "%g × %s" % (target, times) if times else "%g %s" % (target, unit)
            wanted = ("≥ " if at_least else "≤ ") + (above + " + " if above else "") + wanted
            if judged is not None:
                met = judged >= target if at_least else judged <= target
        rows.append({"key": key, "label": label, "unit": unit, **{kind: value.get(kind) for kind in KINDS},
                     "ratio": judged if times else None, "ratio_to": times, "target": wanted, "met": met,
                     "why": failures.get(figure),
                     "n": {kind: len(samples[sources[kind]]) for kind in KINDS if kind in value}})

    # The targets are those of the version after 1.1.0.
    row("cancel_result_median", "cancel → result, median", "ms", median, "cancel", "ping", 1.5, times="floor")
    row("cancel_result_p99", "cancel → result, p99", "ms", p99, "cancel", "ping", 4, above="floor")
    row("newer_active_median", "newer goal → ACTIVE, median", "ms", median, "newer", "ping", 1.8, times="floor")
    row("goal_feedback_median", "goal → first feedback, median", "ms", median, "first feedback", "ping", 1.05,
        times="plain")
    row("no_bowls_median", "goal of no bowls → result, median", "ms", median, "no bowls", "ping", 1.3, times="floor")
    row("bowl_error_p99", "error of a bowl's second, p99", "ms", p99, "bowl", None, 1, above="plain")
    row("drift", "drift over %d bowls" % plan["bowls"], "ms", lambda values: abs(median(values)), "drift", None, 1)
    row("idle_cpu", "idle, CPU", "%", median, "idle", None, 1.05, times="plain")
    row("memory", "idle, resident memory", "MiB", median, "memory", None, 1.05, times="plain")
    row("cpu_bowl_small", "CPU a bowl, simulated time, " + small, "ms", median, small)
    row("cpu_bowl_large", "CPU a bowl, simulated time, " + large, "ms", median, large, None, 1, times=small)
    row("goals_a_second", "goals of no bowls in a row", "1/s", rate, "burst", "burst", 5, times="plain", at_least=True)
    row("goals_paused", "… of them held up by actionlib for 100 ms", "%", pauses, "burst", "burst", 0)
    row("client", "whole client, no bowls, start to exit", "s", median, "client", None, 0.6, times="plain")
    return rows


def table(rows):
    """Returns the rows as a Markdown table with aligned columns."""
    lines = [["figure", "unit", *KINDS, "ratio", "target", "met"]]
    for row in rows:
        numbers = ["" if row[kind] is None else "%.*f" % (2 if abs(row[kind]) < 10 else 0, row[kind]) for kind in KINDS]
        ratio = "" if row["ratio"] is None else "%.2f × %s" % (row["ratio"], row["ratio_to"])
        met = row["why"] or {None: "", True: "yes", False: "no"}[row["met"]]
        lines.append([row["label"], row["unit"], *numbers, ratio, row["target"], met])
    widths = [max(map(len, column)) for column in zip(*lines)]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| %s |" % " | ".join(map(str.ljust, line, widths)) for line in lines)


def machine():
    with open("/etc/os-release") as file:
        system = re.findall(r'^PRETTY_NAME="?([^"\n]*)', file.read(), re.M)
    return ", ".join(["%d cores" % len(os.sched_getaffinity(0)), *system, "Python " + platform.python_version()])


def report(benchmark, seconds, args):
    """Print the table; write the files that args (argparse.Namespace) ask for."""
    rows = figures(benchmark.samples, benchmark.plan, benchmark.failures)
    if args.json:
        samples = {"%s, %s" % key: values for key, values in benchmark.samples.items()}
        with open(args.json, "w") as file:
            json.dump({"machine": machine(), "quick": args.quick, "server": args.server, "figures": rows,
                       "seconds": seconds, "samples": samples}, file, indent=1, ensure_ascii=False)
    print(table(rows))
    print("\n%s; %d s. n: %s" % (machine(), seconds, ", ".join(
        "%s %s" % (row["label"].split(",")[0], "/".join(map(str, row["n"].values())))
        for row in rows if row["key"].endswith("_median"))))
    if args.quick:
        print("--quick: too few samples to quote")
    if args.plot or args.timeline:
        import pictures  # not before all is measured: matplotlib takes its time, and memory
        server = os.path.basename(args.server or "action_server.py")
        if args.plot and "cancel" not in benchmark.failures:
            pictures.plot(benchmark.samples, server, args.plot)
        if args.timeline and "timeline" not in benchmark.failures:
            pictures.timeline({"A server that looks for a cancel once a second": benchmark.timeline["plain"],
                               server + ", woken by newer goal and cancel": benchmark.timeline["ours"]}, args.timeline)
