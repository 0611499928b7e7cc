#!/usr/bin/python3
"""Measures scripts/action_server.py beside a server that polls and beside bare ROS, in one run on one master.

The floor is a bare node that answers a message with a message. Its figure is taken by this same process, with the same
pauses between two samples, so that a ratio to it says what action and server add to ROS. The times are those of
time.monotonic() in plain publishers and subscribers: SimpleActionClient would add its own locks and threads.
"""
import argparse
import contextlib
import json
import math
import os
import platform
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

try:
    import rosgraph
    import rospy
    from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
    from rosgraph_msgs.msg import Clock

    from actions_tutorial.msg import (
        WashTheDishesActionFeedback, WashTheDishesActionGoal, WashTheDishesActionResult, WashTheDishesGoal)
except ImportError as error:
    sys.exit("benchmark: %s; run it as ./tutorial benchmark, which sources the workspace" % error)

HERE = os.path.dirname(os.path.realpath(__file__))
SERVERS = {"ours": os.path.join(HERE, "..", "..", "scripts", "action_server.py"),
           "polling": os.path.join(HERE, "polling_server.py"), "floor": os.path.join(HERE, "floor.py")}
# instances: servers that take samples side by side; a sample is mostly waiting, and a polling server's the longest.
# Then: samples of each of them for a figure, starts, bowls to time, sizes under simulated time, clients connected and
# their samples, goals in a row, and ended goals that may still be listed when something is measured.
FULL = {"instances": {"ours": 3, "polling": 6, "floor": 1},
        "samples": {"ours": 52, "polling": 26, "floor": 200},
        "starts": 7, "bowls": 60, "sizes": (100, 1000, 10000),
        "clients": (1, 10, 50), "client_samples": {"ours": 24, "polling": 12, "floor": 48}, "burst": 100,
        "listed": 2}
QUICK = {"instances": {"ours": 2, "polling": 2, "floor": 1},
         "samples": {"ours": 3, "polling": 2, "floor": 12},
         "starts": 1, "bowls": 3, "sizes": (5, 10, 20),
         "clients": (1, 2, 4), "client_samples": {"ours": 4, "polling": 2, "floor": 8}, "burst": 10,
         "listed": 30}
TIMEOUT = 60  # s, for anything that takes a second or two


class Failed(Exception):
    """The measurement could not be made; the text says why in a line."""


class Peer:
    """This process's end of the server, or the floor, in a namespace."""

    def __init__(self, kind, namespace):
        self.is_floor = kind == "floor"
        self.namespace = namespace
        self.process = None
        self.count = 0
        self.listed = 0  # goals in the last status message: the library keeps an ended one for 5 s
        self.times = {}  # (goal id, event): time.monotonic() of the first message that shows it
        self.shown_by = {"status": 0, "feedback": 0}  # what showed a goal ACTIVE first
        self.on_feedback = None
        self.changed = threading.Condition()
        topic = namespace + "/wash_dishes_as/"
        rospy.Subscriber(topic + "feedback", WashTheDishesActionFeedback, self.feedback_cb)
        rospy.Subscriber(topic + "result", WashTheDishesActionResult, self.result_cb)
        rospy.Subscriber(topic + "status", GoalStatusArray, self.status_cb)
        self.goal = rospy.Publisher(topic + "goal", WashTheDishesActionGoal, queue_size=10)
        self.cancel = rospy.Publisher(topic + "cancel", GoalID, queue_size=10)

    def saw(self, goal_id, event, now, source=None):
        with self.changed:
            if (goal_id, event) not in self.times:
                self.times[goal_id, event] = now
                if source:
                    self.shown_by[source] += 1
                self.changed.notify_all()

    def status_cb(self, msg):
        now = time.monotonic()
        with self.changed:
            self.listed = len(msg.status_list)
            self.times[None, "status"] = now
            self.changed.notify_all()
        for status in msg.status_list:
            if status.status == GoalStatus.ACTIVE:
                self.saw(status.goal_id.id, "active", now, "status")

    def feedback_cb(self, msg):
        now = time.monotonic()
        self.saw(msg.status.goal_id.id, "active", now, "feedback")
        self.saw(msg.status.goal_id.id, msg.feedback.last_dish_washed, now)
        if self.on_feedback:
            self.on_feedback()

    def result_cb(self, msg):
        self.saw(msg.status.goal_id.id, "result", time.monotonic())

    def wait(self, what, condition, timeout=TIMEOUT):
        limit = time.monotonic() + timeout
        with self.changed:
            while not self.changed.wait_for(condition, 1):
                if self.process.poll() is not None:
                    raise Failed("%s ended with status %d, before %s" % (self.namespace, self.process.poll(), what))
                if time.monotonic() > limit:
                    raise Failed("%s: no %s in %d s" % (self.namespace, what, timeout))

    def wait_until_up(self):
        """Wait until a goal sent now is served: a server publishes its first status when it takes goals."""
        if not self.is_floor:
            self.wait("first status", lambda: (None, "status") in self.times)
        limit = time.monotonic() + TIMEOUT
        while not self.goal.get_num_connections():
            if time.monotonic() > limit or self.process.poll() is not None:
                raise Failed("%s does not connect" % self.namespace)
            time.sleep(0.001)

    def wait_until_answered(self):
        """Wait until results come back, too: rospy loses what a node publishes while it is being connected."""
        self.wait_until_up()
        limit = time.monotonic() + TIMEOUT
        answered = False
        while not answered:
            goal_id, _ = self.send(0)
            with self.changed:
                answered = self.changed.wait_for(lambda: (goal_id, "result") in self.times, 1)
            if time.monotonic() > limit:
                raise Failed("%s does not answer" % self.namespace)

    def send(self, bowls):
        """Send a goal. Returns its id and the time just before."""
        self.count += 1
        goal_id = "%s-%d" % (self.namespace, self.count)
        msg = WashTheDishesActionGoal(goal_id=GoalID(rospy.Time.now(), goal_id), goal=WashTheDishesGoal(bowls))
        sent = time.monotonic()
        self.goal.publish(msg)
        return goal_id, sent

    def send_cancel(self, goal_id):
        sent = time.monotonic()
        self.cancel.publish(GoalID(id=goal_id))
        return sent

    def since(self, sent, goal_id, event, timeout=TIMEOUT):
        """Wait for the event. Returns the seconds from sent to it."""
        self.wait("%s of %s" % (event, goal_id), lambda: (goal_id, event) in self.times, timeout)
        return self.times[goal_id, event] - sent

    def wait_until_quiet(self, most):
        """Wait until the ended goals, but for some, have left the status message: they make each publication slower."""
        self.wait("short status message", lambda: self.listed <= most)

    def cpu(self):
        """CPU seconds of the process so far, all its threads, ended ones too, to the nanosecond: see
        clock_getcpuclockid(3)."""
        return time.clock_gettime((~self.process.pid << 3) | 2)

    def memory(self):
        """Resident memory, MiB."""
        with open("/proc/%d/status" % self.process.pid) as file:
            return next(int(line.split()[1]) for line in file if line.startswith("VmRSS")) / 1024


class Processes:
    """Starts processes, each in a group of its own, and stops them all."""

    def __init__(self, folder):
        self.running = []
        self.log = open(os.path.join(folder, "stderr.log"), "w")

    def start(self, command, stdout=subprocess.DEVNULL):
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=self.log,
                                   start_new_session=True)
        self.running.append(process)
        return process

    def stop(self, *processes):
        for process in processes:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
        for process in processes:
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                pass
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)  # also what the process itself has left behind
            process.wait()
            self.running.remove(process)


class Benchmark:
    """One run: its methods fill self.samples, a list of numbers for each (figure, kind of server)."""

    def __init__(self, server, sizes, processes):
        self.server = server
        self.plan = sizes
        self.processes = processes
        self.stage = "starting"
        self.samples = {}
        self.lock = threading.Lock()
        self.turn = threading.Lock()  # held while something short is timed: one thing at a time
        self.peers = {}
        self.now = rospy.Time()  # simulated
        self.clock = rospy.Publisher("/clock", Clock, latch=True, queue_size=10)
        self.random = random.Random(6)

    def add(self, figure, kind, value):
        with self.lock:
            self.samples.setdefault((figure, kind), []).append(value)

    def command(self, kind):
        return [sys.executable, self.server if kind == "ours" and self.server else SERVERS[kind]]

    def start(self, kind, number, command=None):
        namespace = "/%s_%s" % (kind, number)
        peer = Peer(kind, namespace)
        peer.started = time.monotonic()
        peer.process = self.processes.start((command or self.command(kind)) + ["__ns:=" + namespace])
        return peer

    def phases(self, count):
        """Times spread evenly over a second, in an order made up."""
        return self.random.sample([(i + self.random.random()) / count for i in range(count)], count)

    def run(self):
        steps = [self.measure_starts, self.start_all, self.measure_bursts, self.measure_simulated_time,
                 self.measure_reactions, self.measure_bursts, self.measure_idle_minute, self.measure_bursts,
                 self.measure_with_clients]
        for step in steps:
            step()

    def measure_starts(self):
        for turn in range(self.plan["starts"]):
            for kind in ("ours", "polling") if turn % 2 else ("polling", "ours"):
                self.stage = "start, %d of %d" % (turn + 1, self.plan["starts"])
                rosrun = ["rosrun", "actions_tutorial", os.path.basename(SERVERS[kind])]
                peer = self.start(kind, "start_%d" % turn, None if self.server else rosrun)
                peer.wait_until_up()
                goal_id, _ = peer.send(1)
                self.add("start", kind, peer.since(peer.started, goal_id, "active"))
                self.processes.stop(peer.process)

    def start_all(self):
        self.stage = "starting the servers"
        self.peers = {
            kind: [self.start(kind, i) for i in range(count)] for kind, count in self.plan["instances"].items()}
        for peers in self.peers.values():
            for peer in peers:
                peer.wait_until_answered()

    def quiet(self):
        self.stage = "waiting until the ended goals are forgotten"
        for peer in self.peers["ours"] + self.peers["polling"]:
            peer.wait_until_quiet(self.plan["listed"])

    def measure_bursts(self):
        """Goals of no bowls, each sent when the result of the one before is here."""
        self.quiet()
        for i in range(3):
            for kind in random.Random(i).sample(sorted(self.peers), 3):
                self.stage = "goals of no bowls, one after the other: %s" % kind
                peer = self.peers[kind][i % len(self.peers[kind])]
                begun, done = time.monotonic(), 0
                while done < self.plan["burst"] and time.monotonic() < begun + 2:
                    goal_id, sent = peer.send(0)
                    took = peer.since(sent, goal_id, "result")
                    self.add("burst", kind, took)
                    done += 1

    def measure_reactions(self):
        """Every server runs through the same cycle on its own: goal, newer goal, cancel, at any phase of a second."""
        self.quiet()
        samples = self.plan["samples"]
        total = sum(samples[kind] * len(peers) for kind, peers in self.peers.items())
        self.in_parallel([(self.cycle, kind, peer, samples[kind]) for kind in self.peers for peer in self.peers[kind]],
                         lambda done: "goal, newer goal, cancel: %d of %d" % (done, total))

    def in_parallel(self, jobs, stage):
        """Run the jobs (function, arguments …), each in a thread; a job yields after each sample."""
        failures, done = [], []

        def work(function, *arguments):
            try:
                for _ in function(*arguments):
                    done.append(None)
                    self.stage = stage(len(done))
                    if failures:
                        return
            except Exception as error:  # goes on in the main thread
                failures.append(error)

        threads = [threading.Thread(target=work, args=job, daemon=True) for job in jobs]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        if failures:
            raise failures[0]

    def cycle(self, kind, peer, count):
        for before, first, second in zip(self.phases(count), self.phases(count), self.phases(count)):
            if kind == "floor":
                self.ping(peer, first, "ping")
            else:
                # An idle server's slowest clock is its status, every 0.2 s: the goal comes at any time within that.
                time.sleep(before / 5)
                with self.turn:
                    old_id, sent = peer.send(1000)
                    self.add("first feedback", kind, peer.since(sent, old_id, "bowl-0"))
                time.sleep(first)
                with self.turn_of(kind):
                    goal_id, sent = peer.send(1000)
                    self.add("newer", kind, peer.since(sent, goal_id, "active"))
                peer.since(sent, goal_id, "bowl-0")
                time.sleep(second)
                with self.turn_of(kind):
                    sent = peer.send_cancel(goal_id)
                    self.add("cancel", kind, peer.since(sent, goal_id, "result"))
            yield

    def ping(self, peer, phase, figure):
        time.sleep(phase / 2)
        with self.turn:
            goal_id, sent = peer.send(1)
            self.add(figure, "floor", peer.since(sent, goal_id, "result"))

    def turn_of(self, kind):
        """A polling server may take a second, for which nobody else is held up."""
        return contextlib.nullcontext() if kind == "polling" else self.turn

    def cancels(self, kind, peer, count, figure):
        for phase in self.phases(count):
            if kind == "floor":
                self.ping(peer, phase, figure)
            else:
                goal_id, sent = peer.send(1000)
                peer.since(sent, goal_id, "bowl-0")
                time.sleep(phase)
                with self.turn_of(kind):
                    sent = peer.send_cancel(goal_id)
                    self.add(figure, kind, peer.since(sent, goal_id, "result"))
            yield

    def measure_with_clients(self):
        """This process is the first client of each server; the others only listen, as idle clients do."""
        connected = 1
        for step, clients in enumerate(self.plan["clients"]):
            if clients > connected:
                self.stage = "connecting %d clients" % clients
                command = [sys.executable, os.path.join(HERE, "clients.py"), str(clients - connected)]
                process = self.processes.start(command + ["/ours_0", "/polling_0"], subprocess.PIPE)
                for _ in range(clients - connected):
                    if process.stdout.readline() != b"connected\n":
                        raise Failed("one of %d clients did not connect" % clients)
                connected = clients
            self.quiet()
            self.in_parallel([(self.cancels, kind, self.peers[kind][0], count, "clients %d" % step)
                              for kind, count in self.plan["client_samples"].items()],
                             lambda done: "cancel with %d clients connected: sample %d" % (clients, done))

    def measure_idle_minute(self):
        """The last server of each kind washes, the first one idles beside it."""
        self.quiet()
        bowls = self.plan["bowls"]
        before = {}
        runs = {}
        for kind in ("ours", "polling"):
            idle, busy = self.peers[kind][0], self.peers[kind][-1]
            runs[kind] = busy.send(bowls)
            before[kind] = time.monotonic(), idle.cpu()
        for kind in ("ours", "polling"):
            idle, busy = self.peers[kind][0], self.peers[kind][-1]
            goal_id, sent = runs[kind]
            for i in range(bowls + 1):
                self.stage = "bowls of a second each, and idle servers: %d of %d" % (min(i, bowls), bowls)
                busy.since(sent, goal_id, "bowl-%d" % i if i < bowls else "result")
            wall, cpu = before[kind]
            self.add("idle", kind, (idle.cpu() - cpu) / (time.monotonic() - wall) * 100)
            self.add("memory", kind, idle.memory())
            begun = busy.times[goal_id, "bowl-0"]
            for i in range(1, bowls):
                self.add("bowl", kind, abs(busy.times[goal_id, "bowl-%d" % i] - begun - i))
            self.add("drift", kind, busy.times[goal_id, "result"] - begun - bowls)

    def measure_simulated_time(self):
        """CPU of a bowl, on a clock that goes on by a second when the bowl of the last one is here."""
        self.stage = "starting the servers of the simulated time"
        self.tick(1000)
        rospy.set_param("/use_sim_time", True)  # asked for when a node starts, and then no more
        peers = {kind: self.start(kind, "simulated") for kind in ("ours", "polling")}
        for peer in peers.values():
            peer.wait_until_answered()
            peer.on_feedback = lambda: self.tick(1)
        rospy.delete_param("/use_sim_time")
        small, middle, large = self.plan["sizes"]
        for turn, size in enumerate([small] * 5 + [middle] + [large] + [middle] + [small] * 5):
            for kind in ("ours", "polling") if turn % 2 else ("polling", "ours"):
                self.stage = "simulated time: %d bowls, %s" % (size, kind)
                peer = peers[kind]
                before = peer.cpu()
                goal_id, _ = peer.send(size)
                self.tick_until(lambda: (goal_id, "result") in peer.times, 30 + size / 50)
                self.add("sim %d" % size, kind, (peer.cpu() - before) / size)
        self.processes.stop(*[peer.process for peer in peers.values()])

    def tick(self, seconds):
        with self.lock:
            self.now += rospy.Duration(seconds)
            self.clock.publish(self.now)

    def tick_until(self, condition, timeout):
        """Repeat the time while it stands still, as a simulator does: rospy.sleep() may miss a single tick, and would
        then look at the clock again after 0.5 s. Should a feedback get lost, go on without it after a second."""
        limit = time.monotonic() + timeout
        moved = time.monotonic()
        while not condition():
            before = self.now
            time.sleep(0.02)
            if self.now != before:
                moved = time.monotonic()
            else:
                self.tick(time.monotonic() > moved + 1)
            if time.monotonic() > limit:
                raise Failed("%s: not over in %d s" % (self.stage, timeout))


def p99(values):
    return sorted(values)[math.ceil(0.99 * len(values)) - 1]


def rate(values):
    return 1 / statistics.mean(values)


def pauses(values):
    """The share, in %, of goals that met the 100 ms pause of actionlib's executeLoop."""
    usual = statistics.median(values)
    return 100 * sum(value > usual + 0.08 for value in values) / len(values)


def figures(samples, plan):
    """Returns the rows of the table: dicts of key, label, unit, ours, polling, floor, ratio, ratio_to, goal, met, n."""
    small, middle, large = plan["sizes"]
    median = statistics.median
    rows = []

    def row(key, label, unit, statistic, figure, scale=1.0, floor=None, ratio_to=None, goal=None):
        """goal: the highest ratio to ratio_to (a kind of server) where there is one, else the highest value of ours."""
        values = {"ours": samples[figure, "ours"], "polling": samples[figure, "polling"],
                  "floor": samples.get((floor, "floor"))}
        value = {kind: statistic(numbers) * scale if numbers else None for kind, numbers in values.items()}
        ratio = value["ours"] / value[ratio_to] if ratio_to and value[ratio_to] else None
        judged = value["ours"] if ratio_to is None else ratio
        rows.append(dict(value, key=key, label=label, unit=unit, ratio=ratio, ratio_to=ratio_to, goal=goal,
                         met=None if goal is None or judged is None else abs(judged) <= goal,
                         n={kind: len(numbers) for kind, numbers in values.items() if numbers}))

    for key, label, figure, limit, slowest in (("cancel_result", "cancel → result", "cancel", 8, 10),
                                               ("newer_active", "newer goal → ACTIVE", "newer", 10, None),
                                               ("goal_feedback", "goal → first feedback", "first feedback", 5, None)):
        row(key + "_median", label + ", median", "ms", median, figure, 1e3, "ping", "floor", limit)
        row(key + "_p99", label + ", p99", "ms", p99, figure, 1e3, "ping", goal=slowest)
    row("bowl_error_p99", "error of a bowl's second, p99", "ms", p99, "bowl", 1e3, goal=5)
    row("drift", "drift over %d bowls" % plan["bowls"], "ms", median, "drift", 1e3, goal=5)
    row("idle_cpu", "idle, CPU", "%", median, "idle", ratio_to="polling", goal=1.1)
    row("memory", "idle, resident memory", "MiB", median, "memory", ratio_to="polling", goal=1.1)
    for key, size in ("small", small), ("middle", middle), ("large", large):
        row("cpu_bowl_" + key, "CPU a bowl, simulated time, n = %d" % size, "ms", median, "sim %d" % size, 1e3)
    rows[-1].update(ratio=rows[-1]["ours"] / rows[-3]["ours"], ratio_to="n = %d" % small, goal=1.2)
    rows[-1]["met"] = rows[-1]["ratio"] <= rows[-1]["goal"]
    row("goals_a_second", "goals of no bowls in a row", "1/s", rate, "burst", floor="burst")
    row("goals_paused", "… of them held up by actionlib for 100 ms", "%", pauses, "burst", floor="burst")
    # No ratio: rosrun looks twice for a node that has a devel-space relay, as ours has.
    row("start", "rosrun → first goal ACTIVE", "s", median, "start")
    for step, clients in enumerate(plan["clients"]):
        row("cancel_result_clients_%d" % step, "cancel → result, %d client%s" % (clients, "s" * (clients > 1)), "ms",
            median, "clients %d" % step, 1e3, "clients %d" % step, "floor")
    return rows


def table(rows):
    """Returns the rows as a Markdown table with aligned columns."""
    def number(value):
        return "" if value is None else "%.*f" % (max(0, 2 - len(str(int(abs(value)))) + (abs(value) < 10)), value)

    def goal(row):
        if row["goal"] is None:
            return ""
        return "≤ %g %s" % (row["goal"], "× " + row["ratio_to"] if row["ratio_to"] else row["unit"])

    lines = [["figure", "unit", "ours", "polling", "floor", "ratio", "goal", "met"]]
    for row in rows:
        ratio = "" if row["ratio"] is None else "%.2f × %s" % (row["ratio"], row["ratio_to"])
        lines.append([row["label"], row["unit"], number(row["ours"]), number(row["polling"]), number(row["floor"]),
                      ratio, goal(row), {None: "", True: "yes", False: "no"}[row["met"]]])
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]))]
    lines.insert(1, ["-" * width for width in widths])
    return "\n".join("| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths)) + " |" for line in lines)


def plot(samples, server, path):
    """Write cancel → result as cumulative distributions to path (SVG, the same bytes for the same samples)."""
    import matplotlib
    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "actions_tutorial"
    from matplotlib import pyplot
    figure, axes = pyplot.subplots(figsize=(8, 4.5))
    for kind, name, colour, label in (
            ("floor", "ping", "tab:gray", "bare ROS: a message\nand its answer"),
            ("ours", "cancel", "tab:blue", server + ",\nwoken by the cancel"),
            ("polling", "cancel", "tab:orange", "a server that looks for\na cancel once a second")):
        times = sorted(1e3 * value for value in samples[name, kind])
        share = [100 * (i + 1) / len(times) for i in range(len(times))]
        axes.plot([times[0]] + times, [0] + share, drawstyle="steps-post", color=colour, linewidth=2,
                  label="%s\nmedian %.3g ms" % (label, statistics.median(times)))
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda value, _: "%g" % value))
    axes.set(xlabel="time since the cancel was sent (ms, logarithmic)", ylabel="cancels answered by then (%)",
             ylim=(0, 100), title="How long a cancelled goal takes to end")
    axes.grid(True, which="both", alpha=0.25)
    axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, labelspacing=1.5)
    figure.savefig(path, format="svg", bbox_inches="tight", metadata={"Date": None, "Creator": None})


def machine():
    with open("/etc/os-release") as file:
        system = dict(line.rstrip().split("=", 1) for line in file if "=" in line).get("PRETTY_NAME", "").strip('"')
    return "%d cores, %s, Python %s" % (len(os.sched_getaffinity(0)), system, platform.python_version())


def free_port():
    with socket.socket() as listener:
        listener.bind(("localhost", 0))
        return listener.getsockname()[1]


def start_master(processes):
    """Start a master of this run's own and make this process a node of it."""
    port = free_port()
    os.environ.update(ROS_MASTER_URI="http://localhost:%d" % port, ROS_HOSTNAME="localhost")
    for name in "ROS_IP", "ROS_NAMESPACE":
        os.environ.pop(name, None)
    process = processes.start(["roscore", "-p", str(port)])
    limit = time.monotonic() + TIMEOUT
    while not rosgraph.is_master_online():
        if time.monotonic() > limit or process.poll() is not None:
            raise Failed("roscore does not start")
        time.sleep(0.05)
    rospy.init_node("benchmark", disable_signals=True)


def tell_progress(benchmark, begun):
    """Print what is being measured: a line every 5 s."""
    while True:
        print("%4d s  %s" % (time.monotonic() - begun, benchmark.stage), file=sys.stderr, flush=True)
        time.sleep(5)


def arguments():
    parser = argparse.ArgumentParser(prog="benchmark", description="Measures the action server beside one that polls.")
    parser.add_argument("--json", metavar="FILE", help="write figures and samples")
    parser.add_argument("--plot", metavar="FILE.svg", help="draw cancel → result (needs python3-matplotlib)")
    parser.add_argument("--server", metavar="PATH",
                        help="measure this server in place of ours, and start none by rosrun")
    parser.add_argument("--quick", action="store_true", help="20 s, to see that it works: too few samples to quote")
    args = parser.parse_args()
    # Better now than after four minutes:
    if args.plot:
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            raise Failed("--plot needs matplotlib: apt install python3-matplotlib")
    for path in filter(None, (args.json, args.plot)):
        open(path, "a").close()
    if args.server and not os.path.isfile(args.server):
        raise Failed("no server %s" % args.server)
    return args


def measure(args, folder):
    begun = time.monotonic()
    processes = Processes(folder)
    plan = QUICK if args.quick else FULL
    try:
        start_master(processes)
        benchmark = Benchmark(args.server and os.path.abspath(args.server), plan, processes)
        threading.Thread(target=tell_progress, args=(benchmark, begun), daemon=True).start()
        benchmark.run()
    finally:
        for number in signal.SIGINT, signal.SIGTERM:  # a second Ctrl-C would leave servers behind
            signal.signal(number, signal.SIG_IGN)
        rospy.signal_shutdown("done")
        processes.stop(*reversed(processes.running))
    samples = benchmark.samples
    rows = figures(samples, plan)
    shown_by = {kind: sum(peer.shown_by["status"] for peer in benchmark.peers[kind]) / sum(
        sum(peer.shown_by.values()) for peer in benchmark.peers[kind]) for kind in ("ours", "polling")}
    if args.json:
        with open(args.json, "w") as file:
            json.dump({"machine": machine(), "quick": args.quick, "server": args.server, "figures": rows,
                       "active_shown_first_by_status": shown_by, "seconds": time.monotonic() - begun,
                       "samples": {"%s, %s" % key: values for key, values in samples.items()}},
                      file, indent=1, ensure_ascii=False)
    if args.plot:
        plot(samples, os.path.basename(args.server or SERVERS["ours"]), args.plot)
    print(table(rows))
    print("\n%s; %d s. n: %s" % (machine(), time.monotonic() - begun, ", ".join(
        "%s %s" % (row["label"].split(",")[0], "/".join(str(n) for n in row["n"].values())) for row in rows[:6:2])))
    if args.quick:
        print("--quick: too few samples to quote")


def main():
    for number in signal.SIGINT, signal.SIGTERM:  # also when a script started this in the background
        signal.signal(number, signal.default_int_handler)
    folder = tempfile.mkdtemp(prefix="benchmark-")
    os.environ.update(ROS_HOME=folder, ROS_LOG_DIR=folder, MPLCONFIGDIR=folder)
    try:
        measure(arguments(), folder)
    except KeyboardInterrupt:
        return "benchmark: stopped"
    except (Failed, OSError) as error:
        return "benchmark: %s" % error
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
