"""The benchmark's measurements: what each server, and the floor, is asked to do, and the samples of it.

The floor is a bare node that answers a message with a message. Its figure is taken by this same process, with the same
pauses between two samples, so that a ratio to it says what action and server add to ROS. The times are those of
time.monotonic() in plain publishers and subscribers: SimpleActionClient would add its own locks and threads.
"""
import contextlib
import gc
import os
import random
import subprocess
import sys
import threading
import time

import rospy

HERE = os.path.dirname(os.path.realpath(__file__))
sys.path.insert(0, os.path.join(HERE, "..", "test"))
from raw_client import ACTIVE, RawClient  # noqa: E402
from processes import PACKAGE, eventually  # noqa: E402
from simulated_clock import SimulatedClock  # noqa: E402

SCRIPTS = os.path.join(PACKAGE, "scripts")
SERVERS = {"ours": os.path.join(SCRIPTS, "action_server.py"), "plain": os.path.join(SCRIPTS, "plain_action_server.py"),
           "floor": os.path.join(HERE, "ping_pong.py")}
CLIENTS = {"ours": [os.path.join(SCRIPTS, "action_client.py"), "_number_of_minutes:=0"],
           "plain": [os.path.join(HERE, "plain_client.py")]}
# instances: servers that take samples side by side; a sample is mostly waiting. Then: samples of each of them for a
# figure, the least seconds for a goal, a newer one and its cancel, whole clients, bowls to time, sizes under simulated
# time, goals in a row, and ended goals that may still be listed when something is measured.
FULL = {"instances": {"ours": 5, "plain": 5, "floor": 1},
        "samples": {"ours": 31, "plain": 31, "floor": 200}, "cycle": 2.5,
        "clients": 15, "bowls": 60, "sizes": (100, 10000), "burst": 112, "listed": 2}
QUICK = {"instances": {"ours": 2, "plain": 2, "floor": 1},
         "samples": {"ours": 3, "plain": 2, "floor": 12}, "cycle": 0,
         "clients": 1, "bowls": 3, "sizes": (5, 20), "burst": 10, "listed": 30}
TIMELINE = (2.3, 4.6)  # s of a newer goal and of its cancel in the picture
TIMEOUT = 60  # s, for anything that takes a second or two


class Peer(RawClient):
    """This process's end of a server, or the floor (kind), in a namespace of its own; process: the server's."""

    process = on_bowl = None

    def __init__(self, kind, number):
        super().__init__("/%s_%s" % (kind, number), **{"topics": ("goal", "result")} if kind == "floor" else {})

    def on_feedback(self, message):
        super().on_feedback(message)
        if self.on_bowl:
            self.on_bowl()

    def wait(self, condition, what, timeout=TIMEOUT):
        return eventually(condition, "%s, in %s" % (what, self.namespace), self.process, timeout=timeout,
                          news=self.news, pause=1)

    def since(self, sent, goal_id, *events):
        """Wait for the first of the events. Returns the seconds from sent to it."""
        def seen():
            return [self.times[goal_id, event] for event in events if (goal_id, event) in self.times]

        return min(self.wait(seen, "%s of %s" % (events[0], goal_id))) - sent

    def took(self, goal_id, *events):
        """Wait for the first of the events. Returns the seconds from the sending of the goal to it."""
        return self.since(self.times[goal_id, "sent"], goal_id, *events)

    def cpu(self):
        """CPU seconds of the process so far, all its threads, ended ones too, to the nanosecond, where psutil has
        hundredths of a second: see clock_getcpuclockid(3)."""
        return time.clock_gettime((~self.process.usage.pid << 3) | 2)


class Benchmark:
    """One run on a master (Master): its methods fill self.samples, a list of numbers for each (figure, kind)."""

    def __init__(self, server, plan, master):
        self.server, self.plan, self.master = server, plan, master
        self.stage, self.samples, self.failures, self.peers = "starting", {}, {}, {}
        self.timeline = {}
        self.lock = threading.Lock()
        self.turn = threading.Lock()  # held while something short is timed: one thing at a time
        self.random = random.Random(6)

    def add(self, figure, kind, value):
        with self.lock:
            self.samples.setdefault((figure, kind), []).append(value)

    def start(self, kind, number):
        """Start a server of this kind. -> Peer"""
        peer = Peer(kind, number)
        script = self.server if kind == "ours" and self.server else SERVERS[kind]
        peer.process = self.master.start(sys.executable, script, "__ns:=" + peer.namespace, stdout=subprocess.DEVNULL)
        return peer

    def start_all(self):
        self.stage = "starting the servers"
        self.peers = {
            kind: [self.start(kind, i) for i in range(count)] for kind, count in self.plan["instances"].items()}
        for peers in self.peers.values():
            for peer in peers:
                peer.wait_connected(peer.process)

    def phases(self, count):
        """Times spread evenly over a second, in an order made up."""
        return self.random.sample([(i + self.random.random()) / count for i in range(count)], count)

    def run(self):
        """Take one step after the other. If one fails, its figures are missing, and self.failures tells why."""
        sizes = ["sim %d" % size for size in self.plan["sizes"]]
        reactions, minute = ["cancel", "newer", "first feedback", "no bowls"], ["idle", "memory", "bowl", "drift"]
        steps = [(reactions + minute + ["burst", "client"], self.start_all), (["client"], self.measure_clients),
                 (["burst"], self.measure_bursts), (sizes, self.measure_simulated_time),
                 (reactions, self.measure_reactions), (["burst"], self.measure_bursts),
                 (minute, self.measure_idle_minute), (["burst"], self.measure_bursts)]
        if self.plan["timeline"]:
            steps.append((["timeline"], self.measure_timeline))
        for figures, step in steps:
            try:
                step()
            except (AssertionError, OSError, rospy.ROSException) as error:
                print("%s: %s" % (self.stage, error), file=sys.stderr)
                for figure in figures:
                    self.failures.setdefault(figure, "%s: %s" % (self.stage, str(error).splitlines()[0]))

    def measure_clients(self):
        """Whole clients, from start to exit, each with our last server: the first one's memory is compared later."""
        for turn in range(self.plan["clients"]):
            for kind in ("ours", "plain") if turn % 2 else ("plain", "ours"):
                self.stage = "whole client, %d of %d" % (turn + 1, self.plan["clients"])
                begun = time.monotonic()
                client = self.master.start(*CLIENTS[kind], "__ns:=" + self.peers["ours"][-1].namespace)
                client.wait()
                self.add("client", kind, time.monotonic() - begun)
                assert client.said("stdout") == "%s[]\n" % ("The result is: dishes_washed: " if kind == "ours" else
                                                            "dishes_washed: "), client

    def quiet(self):
        gc.freeze()  # to look through all messages, which are kept, for garbage takes up to 0.2 s, in a sample's midst
        self.stage = "waiting until the ended goals are forgotten"
        for peer in self.peers["ours"] + self.peers["plain"]:
            # Those that have ended make each publication slower, until the library forgets them after 5 s.
            peer.wait(lambda: len(peer.status.status_list) <= self.plan["listed"], "short status message")

    def measure_bursts(self):
        """Goals of no bowls, each sent when the result of the one before is here."""
        self.quiet()
        for i in range(3):
            for kind in random.Random(i).sample(sorted(self.peers), 3):
                self.stage = "goals of no bowls, one after the other: %s" % kind
                peer = self.peers[kind][i % len(self.peers[kind])]
                begun, done = time.monotonic(), 0
                while done < self.plan["burst"] and time.monotonic() < begun + 2:
                    self.add("burst", kind, peer.took(peer.send(0), "result"))
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
                time.sleep(first / 2)
                with self.turn:
                    self.add("ping", kind, peer.took(peer.send(1), "result"))
            else:
                begun = time.monotonic()
                # An idle server's slowest clock is its status, every 0.2 s: the goal comes at any time within that.
                time.sleep(before / 5)
                with self.turn:
                    self.add("first feedback", kind, peer.took(peer.send(1000), "bowl-0"))
                time.sleep(first)
                with self.turn_of(kind):
                    goal_id = peer.send(1000)
                    self.add("newer", kind, peer.took(goal_id, ACTIVE, "bowl-0"))
                peer.took(goal_id, "bowl-0")
                time.sleep(second)
                with self.turn_of(kind):
                    sent = time.monotonic()
                    peer.cancel(goal_id)
                    self.add("cancel", kind, peer.since(sent, goal_id, "result"))
                with self.turn_of(kind):
                    self.add("no bowls", kind, peer.took(peer.send(0), "result"))
                # No server goes ahead: a goal that has ended is listed for 5 s, and a longer status takes longer.
                time.sleep(max(0.0, begun + self.plan["cycle"] - time.monotonic()))
            yield

    def turn_of(self, kind):
        """The plain server may take a second, for which nobody else is held up."""
        return contextlib.nullcontext() if kind == "plain" else self.turn

    def measure_timeline(self):
        """A goal, a newer one in the midst of its third bowl, and a cancel. Fills self.timeline: kind -> [goal], each a
        dict of sent, active, stop (asked for), ended, all s since the first was sent, and bowls [(name, s)]."""
        self.quiet()
        newer, cancel = TIMELINE
        peers = {kind: self.peers[kind][0] for kind in ("plain", "ours")}
        begun = time.monotonic()
        ids = {kind: [peer.send(1000)] for kind, peer in peers.items()}
        time.sleep(begun + newer - time.monotonic())
        for kind, peer in peers.items():
            ids[kind].append(peer.send(1000))
        time.sleep(begun + cancel - time.monotonic())
        asked = {kind: (peer.times[ids[kind][1], "sent"], time.monotonic(), peer.cancel(ids[kind][1]))
                 for kind, peer in peers.items()}
        for kind, peer in peers.items():
            self.timeline[kind] = [
                {"ended": peer.since(begun, goal_id, "result"), "sent": peer.times[goal_id, "sent"] - begun,
                 "active": peer.since(begun, goal_id, ACTIVE, "bowl-0"), "stop": stop - begun,
                 "bowls": [(bowl, peer.times[goal_id, bowl] - begun) for bowl in peer.bowls_of(goal_id)]}
                for goal_id, stop in zip(ids[kind], asked[kind])]

    def measure_idle_minute(self):
        """The last server of each kind washes, the first one idles beside it."""
        self.quiet()
        bowls, before = self.plan["bowls"], {}
        for kind in ("ours", "plain"):
            idle, busy = self.peers[kind][0], self.peers[kind][-1]
            before[kind] = busy.send(bowls), time.monotonic(), idle.cpu()
        for kind in ("ours", "plain"):
            idle, busy = self.peers[kind][0], self.peers[kind][-1]
            goal_id, wall, cpu = before[kind]
            for i in range(bowls + 1):
                self.stage = "bowls of a second each, and idle servers: %d of %d" % (min(i, bowls), bowls)
                busy.took(goal_id, "bowl-%d" % i if i < bowls else "result")
            self.add("idle", kind, (idle.cpu() - cpu) / (time.monotonic() - wall) * 100)
            self.add("memory", kind, idle.process.usage.memory_info().rss / 2**20)
            begun = busy.times[goal_id, "bowl-0"]
            for i in range(1, bowls):
                self.add("bowl", kind, abs(busy.times[goal_id, "bowl-%d" % i] - begun - i))
            self.add("drift", kind, busy.times[goal_id, "result"] - begun - bowls)

    def measure_simulated_time(self):
        """CPU of a bowl, on a clock that goes on by a second when the bowl of the last one is here."""
        self.stage = "starting the servers of the simulated time"
        clock = SimulatedClock()
        rospy.set_param("/use_sim_time", True)  # asked for when a node starts, and then no more
        try:
            peers = {kind: self.start(kind, "simulated") for kind in ("ours", "plain")}
            for peer in peers.values():
                peer.wait_connected(peer.process)
                peer.on_bowl = lambda: clock.turn(1)
        finally:
            rospy.delete_param("/use_sim_time")
        small, large = self.plan["sizes"]
        for turn, size in enumerate([small] * 4 + [large] + [small] * 4 + [large] + [small] * 4):
            for kind in ("ours", "plain") if turn % 2 else ("plain", "ours"):
                self.stage = "simulated time: %d bowls, %s" % (size, kind)
                peer, before = peers[kind], peers[kind].cpu()
                self.turn_until_ended(clock, peer, peer.send(size), 30 + size / 50)
                self.add("sim %d" % size, kind, (peer.cpu() - before) / size)
        for peer in peers.values():
            peer.process.stop()

    def turn_until_ended(self, clock, peer, goal_id, timeout):
        """Repeat the time while it stands still, as a simulator does: rospy.sleep() may miss a single turn, and would
        then look at the clock again after 0.5 s. Should a feedback get lost, go on without it after a second."""
        last, moved = clock.now, time.monotonic()

        def ended():
            nonlocal last, moved
            if last != clock.now:
                last, moved = clock.now, time.monotonic()
            elif goal_id not in peer.results:
                clock.turn(time.monotonic() > moved + 1)
            return goal_id in peer.results

        eventually(ended, self.stage, peer, peer.process, timeout=timeout)
