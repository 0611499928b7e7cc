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
    failures has for its figure), ratio, ratio_to, target, at_least, met.
    """
    small, middle, large = plan["sizes"]
    median = statistics.median
    rows = []

    def row(key, label, unit, statistic, figure, scale=1.0, floor=None, ratio_to=None, target=None, at_least=False):
        """target: the highest ratio, or with at_least the lowest one, to ratio_to (a kind of server) where there
        is one, else the highest value of ours."""
        values = {"ours": samples.get((figure, "ours")), "plain": samples.get((figure, "plain")),
                  "floor": samples.get((floor, "floor"))}
        value = {kind: statistic(numbers) * scale if numbers else None for kind, numbers in values.items()}
        rows.append(dict(value, key=key, label=label, unit=unit, ratio_to=ratio_to, target=target, at_least=at_least,
                         n={kind: len(numbers) for kind, numbers in values.items() if numbers},
                         why=failures.get(figure)))
        judge(rows[-1], value["ours"], value.get(ratio_to))

    def judge(row, value, reference):
        """Add ratio and met."""
        row["ratio"] = value / reference if value is not None and reference else None
        judged = row["ratio"] if row["ratio_to"] else value
        row["met"] = None
        if row["target"] is not None and judged is not None:
            row["met"] = judged >= row["target"] if row["at_least"] else abs(judged) <= row["target"]

    for key, label, figure, limit, slowest in (("cancel_result", "cancel → result", "cancel", 1.7, 4),
                                               ("newer_active", "newer goal → ACTIVE", "newer", 2, None),
                                               ("goal_feedback", "goal → first feedback", "first feedback", 1.7, None)):
        row(key + "_median", label + ", median", "ms", median, figure, 1e3, "ping", "floor", limit)
        row(key + "_p99", label + ", p99", "ms", p99, figure, 1e3, "ping", target=slowest)
    row("bowl_error_p99", "error of a bowl's second, p99", "ms", p99, "bowl", 1e3, target=2)
    row("drift", "drift over %d bowls" % plan["bowls"], "ms", median, "drift", 1e3, target=2)
    row("idle_cpu", "idle, CPU", "%", median, "idle", ratio_to="plain", target=1.05)
    row("memory", "idle, resident memory", "MiB", median, "memory", ratio_to="plain", target=1.05)
    for key, size in ("small", small), ("middle", middle), ("large", large):
        row("cpu_bowl_" + key, "CPU a bowl, simulated time, n = %d" % size, "ms", median, "sim %d" % size, 1e3)
    rows[-1].update(ratio_to="n = %d" % small, target=1)
    judge(rows[-1], rows[-1]["ours"], rows[-3]["ours"])
    row("goals_a_second", "goals of no bowls in a row", "1/s", rate, "burst", floor="burst", ratio_to="plain", target=6,
        at_least=True)
    row("goals_paused", "… of them held up by actionlib for 100 ms", "%", pauses, "burst", floor="burst", target=0)
    row("start", "rosrun → first goal ACTIVE", "s", median, "start")
    for step, clients in enumerate(plan["clients"]):
        row("cancel_result_clients_%d" % step, "cancel → result, %d client%s" % (clients, "s" * (clients > 1)), "ms",
            median, "clients %d" % step, 1e3, "clients %d" % step, "floor")
    return rows


def table(rows):
    """Returns the rows as a Markdown table with aligned columns."""
    def number(value):
        return "" if value is None else "%.*f" % (max(0, 2 - len(str(int(abs(value)))) + (abs(value) < 10)), value)

    def target(row):
        if row["target"] is None:
            return ""
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
