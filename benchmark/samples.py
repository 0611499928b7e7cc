"""The benchmark's samples: what each server is asked to do, and the floor, a bare node that answers a message with a
message. One process asks all, with the same pauses: a ratio to the floor says what action and server add to ROS. The
times are time.monotonic() in plain publishers and subscribers: SimpleActionClient would add its own locks and threads.
"""
import contextlib
import gc
import os
import random
import subprocess
import sys
import threading
import time
from multiprocessing.pool import ThreadPool

import rospy

from actions_tutorial.msg import WashTheDishesActionFeedback

sys.path.insert(0, os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "test"))
from harness import ACTIVE, PACKAGE, RawClient, SimulatedClock, bowls, eventually  # noqa: E402

SERVERS = {"ours": "scripts/action_server.py", "plain": "scripts/plain_action_server.py",
           "floor": "benchmark/ping_pong.py"}
CLIENTS = {"ours": ["scripts/action_client.py", "_number_of_minutes:=0"], "plain": ["benchmark/plain_client.py"]}
# instances: servers that take samples side by side, as they mostly wait; cycle: the least s for a goal, a newer one and
# its cancel; sizes: bowls in simulated time; burst: goals in a row; listed: ended goals that a status may still have.
FULL = {"instances": {"ours": 5, "plain": 5, "floor": 1},
        "samples": {"ours": 31, "plain": 31, "floor": 200}, "cycle": 2.5,
        "clients": 15, "bowls": 60, "sizes": (100, 10000), "burst": 112, "listed": 2}
QUICK = {"instances": {"ours": 2, "plain": 2, "floor": 1},
         "samples": {"ours": 3, "plain": 2, "floor": 12}, "cycle": 0,
         "clients": 1, "bowls": 3, "sizes": (5, 20), "burst": 10, "listed": 30}
TIMELINE = (2.3, 4.6)  # s of a newer goal and of its cancel in the picture
TIMEOUT = 60  # s, for anything that takes a second or two
REACTIONS, MINUTE = ["cancel", "newer", "first feedback", "no bowls"], ["idle", "memory", "bowl", "drift"]


class Peer(RawClient):
    """A server, or the floor (kind), in a namespace of its own, and this process's end of it."""

    def __init__(self, master, kind, number, script):
        super().__init__("/%s_%s" % (kind, number), **{"topics": ("goal", "result")} if kind == "floor" else {})
        self.process = master.start(sys.executable, os.path.join(PACKAGE, script), "__ns:=" + self.namespace,
                                    stdout=subprocess.DEVNULL)

    def wait(self, condition, what, timeout=TIMEOUT):
        return eventually(condition, "%s, in %s" % (what, self.namespace), self.process, timeout=timeout,
                          news=self.news, pause=1)

    def cancel(self, goal_id):
        self.times[goal_id, "stop"] = time.monotonic()
        super().cancel(goal_id)

    def took(self, goal_id, *events, since="sent"):
        """Wait for the first of the events. Returns the seconds to it, from the sending of the goal or its "stop"."""
        def seen():
            return [self.times[goal_id, event] for event in events if (goal_id, event) in self.times]

        return min(self.wait(seen, "%s of %s" % (events[0], goal_id))) - self.times[goal_id, since]

    def story(self, goal_id, begun):
        """Wait for the end of a goal. Returns the s since begun of what happened to it: sent, active, stop (asked for),
        result and each bowl."""
        self.took(goal_id, "result")
        moments = {event: self.times[goal_id, event] for event in ["sent", "stop", "result", *self.bowls_of(goal_id)]}
        moments["active"] = moments["sent"] + self.took(goal_id, ACTIVE, "bowl-0")
        return {event: moment - begun for event, moment in moments.items()}

    def cpu(self):
        """CPU seconds of the process so far, all its threads, ended ones too, to the nanosecond, where psutil has
        hundredths of a second: see clock_getcpuclockid(3)."""
        return time.clock_gettime((~self.process.usage.pid << 3) | 2)


class Benchmark:
    """One run on a master (Master): its methods fill self.samples, a list of numbers for each (figure, kind).

    failures: figure -> why it is missing; timeline: kind -> [Peer.story of a goal].
    """

    def __init__(self, master, server, plan):
        self.master, self.plan, self.stage = master, plan, "starting the servers"
        self.servers = dict(SERVERS, ours=server or SERVERS["ours"])
        self.samples, self.failures, self.peers, self.timeline = {}, {}, {}, {}
        self.turn = threading.Lock()  # held while something short is timed: one thing at a time
        self.random = random.Random(6)

    def add(self, figure, kind, value):
        self.samples.setdefault((figure, kind), []).append(value)

    def start(self, kind, number):
        return Peer(self.master, kind, number, self.servers[kind])

    def start_all(self):
        self.peers = {kind: [self.start(kind, i) for i in range(n)] for kind, n in self.plan["instances"].items()}
        for peer in sum(self.peers.values(), []):
            peer.wait_connected(peer.process)

    def run(self):
        """Take one step after the other."""
        self.attempt(REACTIONS + MINUTE + ["burst", "client"], self.start_all)
        self.attempt(["client"], self.measure_clients)
        self.attempt(["burst"], self.measure_bursts)
        self.attempt(["n = %d" % size for size in self.plan["sizes"]], self.measure_simulated_time)
        self.attempt(REACTIONS, self.measure_reactions)
        self.attempt(["burst"], self.measure_bursts)
        self.attempt(MINUTE, self.measure_minute)
        self.attempt(["burst"], self.measure_bursts)
        if self.plan["timeline"]:
            self.attempt(["timeline"], self.measure_timeline)

    def attempt(self, figures, step):
        """Take a step. If it fails, its figures are missing, and self.failures tells why."""
        try:
            step()
        except (AssertionError, OSError, rospy.ROSException) as error:
            print("%s: %s" % (self.stage, error), file=sys.stderr)
            for figure in figures:
                self.failures.setdefault(figure, "%s: %s" % (self.stage, str(error).partition("\n")[0]))

    def measure_clients(self):
        """Whole clients, from start to exit, each with our last server: the first one's memory is compared later."""
        for turn in range(self.plan["clients"]):
            for kind in ("ours", "plain") if turn % 2 else ("plain", "ours"):
                self.stage = "whole client, %d of %d" % (turn + 1, self.plan["clients"])
                try:
                    self.measure_client(kind)
                except AssertionError:
                    if kind == "ours":
                        raise
                    self.measure_client(kind)  # actionlib's can lose an ending that comes while it sends, and hangs

    def measure_client(self, kind):
        begun, (script, *arguments) = time.monotonic(), CLIENTS[kind]
        client = self.master.start(os.path.join(PACKAGE, script), *arguments,
                                   "__ns:=" + self.peers["ours"][-1].namespace)
        client.wait()
        took = time.monotonic() - begun
        assert client.stdout == "The result is: dishes_washed: []\n", client
        self.add("client", kind, took)

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
        """Every server, and the floor, takes its samples on its own, at any phase of a second."""
        self.quiet()
        jobs = [(kind, peer) for kind, peers in self.peers.items() for peer in peers]
        with ThreadPool(len(jobs)) as pool:
            pool.starmap(self.react, jobs, chunksize=1)

    def phases(self, kind):
        """Times spread evenly over a second, in an order made up, one for each sample."""
        count = self.plan["samples"][kind]
        return self.random.sample([(i + self.random.random()) / count for i in range(count)], count)

    def react(self, kind, peer):
        """Again and again: a goal, a newer one, its cancel, a goal of no bowls; of the floor, an answer."""
        if kind == "floor":
            for phase in self.phases(kind):
                time.sleep(phase / 2)
                with self.turn:
                    self.add("ping", kind, peer.took(peer.send(1), "result"))
            return
        # The plain server may take a second to stop, for which nobody else is held up.
        turn = contextlib.nullcontext() if kind == "plain" else self.turn
        for done, (before, first, second) in enumerate(zip(self.phases(kind), self.phases(kind), self.phases(kind))):
            self.stage = "goal, newer goal, cancel: %d of %d" % (done + 1, self.plan["samples"][kind])
            begun = time.monotonic()
            # An idle server's slowest clock is its status, every 0.2 s: the goal comes at any time within that.
            time.sleep(before / 5)
            with self.turn:
                self.add("first feedback", kind, peer.took(peer.send(1000), "bowl-0"))
            time.sleep(first)
            with turn:
                goal_id = peer.send(1000)
                self.add("newer", kind, peer.took(goal_id, ACTIVE, "bowl-0"))
            peer.took(goal_id, "bowl-0")
            time.sleep(second)
            with turn:
                peer.cancel(goal_id)
                self.add("cancel", kind, peer.took(goal_id, "result", since="stop"))
            with turn:
                self.add("no bowls", kind, peer.took(peer.send(0), "result"))
            # No server goes ahead: a goal that has ended is listed for 5 s, and a longer status takes longer.
            time.sleep(max(0.0, begun + self.plan["cycle"] - time.monotonic()))

    def measure_minute(self):
        """The last server of each kind washes, the first one idles beside it."""
        self.quiet()
        count = self.plan["bowls"]
        pairs = [(kind, self.peers[kind][0], self.peers[kind][-1]) for kind in ("ours", "plain")]
        before = [(busy.send(count), time.monotonic(), idle.cpu()) for _, idle, busy in pairs]
        for (kind, idle, busy), (goal_id, wall, cpu) in zip(pairs, before):
            events = bowls(count) + ["result"]
            for event in events:
                self.stage = "bowls of a second each, and idle servers: %s of %d" % (event, count)
                busy.took(goal_id, event)
            self.add("idle", kind, (idle.cpu() - cpu) / (time.monotonic() - wall) * 100)
            self.add("memory", kind, idle.process.usage.memory_info().rss / 2**20)
            begun = busy.times[goal_id, "bowl-0"]
            *errors, drift = [busy.times[goal_id, event] - begun - i for i, event in enumerate(events)]
            for error in errors[1:]:
                self.add("bowl", kind, abs(error))
            self.add("drift", kind, drift)

    def measure_simulated_time(self):
        """CPU of a bowl, on a clock that goes on by a second when the bowl of the last one is here."""
        self.stage = "starting the servers of the simulated time"
        clock = SimulatedClock()
        rospy.set_param("/use_sim_time", True)  # asked for when a node starts, and then no more
        try:
            peers = {kind: self.start(kind, "simulated") for kind in ("ours", "plain")}
            for peer in peers.values():
                rospy.Subscriber(peer.action + "feedback", WashTheDishesActionFeedback, lambda _: clock.turn(1))
                peer.wait_connected(peer.process)
        finally:
            rospy.delete_param("/use_sim_time")
        small, large = self.plan["sizes"]
        for turn, size in enumerate(([small] * 4 + [large]) * 2 + [small] * 4):
            for kind in ("ours", "plain") if turn % 2 else ("plain", "ours"):
                self.stage = "simulated time: %d bowls, %s" % (size, kind)
                peer, before = peers[kind], peers[kind].cpu()
                self.turn_until_ended(clock, peer, peer.send(size), 30 + size / 50)
                self.add("n = %d" % size, kind, (peer.cpu() - before) / size)
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

    def measure_timeline(self):
        """A goal, a newer one in the midst of its third bowl, and a cancel."""
        self.quiet()
        newer, cancel = TIMELINE
        peers = {kind: self.peers[kind][0] for kind in ("plain", "ours")}
        begun = time.monotonic()
        first = {kind: peer.send(1000) for kind, peer in peers.items()}
        time.sleep(begun + newer - time.monotonic())
        second = {kind: peer.send(1000) for kind, peer in peers.items()}
        time.sleep(begun + cancel - time.monotonic())
        for kind, peer in peers.items():
            peer.cancel(second[kind])
        for kind, peer in peers.items():
            peer.times[first[kind], "stop"] = peer.times[second[kind], "sent"]
            self.timeline[kind] = [peer.story(goal_id, begun) for goal_id in (first[kind], second[kind])]
