"""The benchmark's figures: the rows made of its samples, as a table and JSON."""
import json
import math
import os
import platform
import statistics

import pictures
from samples import TIMELINE


def p99(values):
    return sorted(values)[math.ceil(0.99 * len(values)) - 1]


def rate(values):
    return 1 / statistics.mean(values)


def pauses(values):
    """The share, in %, of goals that met the 100 ms pause of actionlib's executeLoop."""
    usual = statistics.median(values)
    return 100 * sum(value > usual + 0.08 for value in values) / len(values)


def figures(samples, plan, failures):
    """Returns the rows of the table: dicts of key, label, unit, ours, plain, floor, n, why (it has no values: what
    failures has for its figure), ratio, ratio_to, target, above, at_least, met.
    """
    small, large = plan["sizes"]
    median = statistics.median
    rows = []

    def row(key, label, unit, statistic, figure, scale=1.0, floor=None, ratio_to=None, target=None, above=False,
            at_least=False, **others):
        """target: the highest ratio (with at_least the lowest one, with above the largest difference) to ratio_to (a
        kind of server, or one of the others) where there is one, else the highest value of ours."""
        numbers = {"ours": samples.get((figure, "ours")), "plain": samples.get((figure, "plain")),
                   "floor": samples.get((floor, "floor"))}
        value = {kind: statistic(each) * scale if each else None for kind, each in numbers.items()}
        judged, reference, met = value["ours"], dict(value, **others).get(ratio_to), None
        if ratio_to and judged is not None:
            judged = None if not reference else judged - reference if above else judged / reference
        if target is not None and judged is not None:
            met = judged >= target if at_least else judged <= target
        rows.append(dict(value, key=key, label=label, unit=unit, ratio=judged if ratio_to and not above else None,
                         ratio_to=ratio_to, target=target, above=above, at_least=at_least, met=met,
                         why=failures.get(figure), n={kind: len(each) for kind, each in numbers.items() if each}))

    # The targets are those of the version after 1.1.0.
    row("cancel_result_median", "cancel → result, median", "ms", median, "cancel", 1e3, "ping", "floor", 1.5)
    row("cancel_result_p99", "cancel → result, p99", "ms", p99, "cancel", 1e3, "ping", "floor", 4, above=True)
    row("newer_active_median", "newer goal → ACTIVE, median", "ms", median, "newer", 1e3, "ping", "floor", 1.8)
    row("goal_feedback_median", "goal → first feedback, median", "ms", median, "first feedback", 1e3, "ping", "plain",
        1.05)
    row("no_bowls_median", "goal of no bowls → result, median", "ms", median, "no bowls", 1e3, "ping", "floor", 1.3)
    row("bowl_error_p99", "error of a bowl's second, p99", "ms", p99, "bowl", 1e3, ratio_to="plain", target=1,
        above=True)
    row("drift", "drift over %d bowls" % plan["bowls"], "ms", lambda values: abs(median(values)), "drift", 1e3,
        target=1)
    row("idle_cpu", "idle, CPU", "%", median, "idle", ratio_to="plain", target=1.05)
    row("memory", "idle, resident memory", "MiB", median, "memory", ratio_to="plain", target=1.05)
    row("cpu_bowl_small", "CPU a bowl, simulated time, n = %d" % small, "ms", median, "sim %d" % small, 1e3)
    name = "n = %d" % small
    row("cpu_bowl_large", "CPU a bowl, simulated time, n = %d" % large, "ms", median, "sim %d" % large, 1e3,
        ratio_to=name, target=1, **{name: rows[-1]["ours"]})
    row("goals_a_second", "goals of no bowls in a row", "1/s", rate, "burst", floor="burst", ratio_to="plain", target=5,
        at_least=True)
    row("goals_paused", "… of them held up by actionlib for 100 ms", "%", pauses, "burst", floor="burst", target=0)
    row("client", "whole client, no bowls, start to exit", "s", median, "client", ratio_to="plain", target=0.6)
    return rows


def table(rows):
    """Returns the rows as a Markdown table with aligned columns."""
    def number(value):
        return "" if value is None else "%.*f" % (max(0, 2 - len(str(int(abs(value)))) + (abs(value) < 10)), value)

    def target(row):
        if row["target"] is None:
            return ""
        if row["above"]:
            return "≤ %s + %g %s" % (row["ratio_to"], row["target"], row["unit"])
        return "%s %g %s" % ("≤≥"[row["at_least"]], row["target"],
                             "× " + row["ratio_to"] if row["ratio_to"] else row["unit"])

    lines = [["figure", "unit", "ours", "plain", "floor", "ratio", "target", "met"]]
    for row in rows:
        ratio = "" if row["ratio"] is None else "%.2f × %s" % (row["ratio"], row["ratio_to"])
        lines.append([row["label"], row["unit"], number(row["ours"]), number(row["plain"]), number(row["floor"]),
                      ratio, target(row), row["why"] or {None: "", True: "yes", False: "no"}[row["met"]]])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths)) + " |" for line in lines)


def machine():
    with open("/etc/os-release") as file:
        system = dict(line.rstrip().split("=", 1) for line in file if "=" in line).get("PRETTY_NAME", "").strip('"')
    return "%d cores, %s, Python %s" % (len(os.sched_getaffinity(0)), system, platform.python_version())


def report(benchmark, seconds, args):
    """Print the table; write the files that args (argparse.Namespace) ask for."""
    samples, server = benchmark.samples, os.path.basename(args.server or "action_server.py")
    rows = figures(samples, benchmark.plan, benchmark.failures)
    if args.json:
        with open(args.json, "w") as file:
            json.dump({"machine": machine(), "quick": args.quick, "server": args.server, "figures": rows,
                       "seconds": seconds,
                       "samples": {"%s, %s" % key: values for key, values in samples.items()}},
                      file, indent=1, ensure_ascii=False)
    if args.plot and not {"cancel"} & set(benchmark.failures):
        pictures.plot(samples, server, args.plot)
    if args.timeline and benchmark.timeline:
        pictures.timeline([("A server that looks for a cancel once a second", benchmark.timeline["plain"]),
                           (server + ", woken by newer goal and cancel", benchmark.timeline["ours"])],
                          list(zip(TIMELINE, ("a newer goal is sent", "it is cancelled"))), args.timeline)
    print(table(rows))
    print("\n%s; %d s. n: %s" % (machine(), seconds, ", ".join(
        "%s %s" % (row["label"].split(",")[0], "/".join(str(n) for n in row["n"].values()))
        for row in rows if row["key"].endswith("_median"))))
    if args.quick:
        print("--quick: too few samples to quote")
