"""What is measured. Times are measured with plain publishers and subscribers: an action client would add its own."""
import os
import random
import statistics
import subprocess
import sys
import time

from support.processes import PACKAGE
from support.raw_client import RawClient
from support.states import ACTIVE

SERVERS = {"floor": "benchmark/ping_pong.py", "plain": "scripts/action_server.py",
           "hz20": "benchmark/action_server_20_hz.py", "robust": "scripts/robust_action_server.py"}
# rounds: samples of each server. windows: of idle CPU, with their seconds. bursts: with their number of empty goals.
FULL = {"rounds": 40, "windows": 6, "seconds": 10, "bursts": 5, "goals": 100}
QUICK = {"rounds": 2, "windows": 1, "seconds": 1, "bursts": 1, "goals": 5}
NEWER, CANCEL = 2.3, 4.6  # s: when the timeline's second goal is sent, and cancelled


class Peer(RawClient):
    """A server in a namespace of its own, and this process's side of it."""

    def __init__(self, master, kind):
        super().__init__("/" + kind, **{"topics": ("goal", "result")} if kind == "floor" else {})
        self.process = master.start(sys.executable, os.path.join(PACKAGE, SERVERS[kind]), "__ns:=" + self.namespace,
                                    stdout=subprocess.DEVNULL)

    def cancel(self, goal_id):
        self.times[goal_id, "stop"] = time.monotonic()
        super().cancel(goal_id)

    def seconds_to(self, goal_id, *events, since="sent"):
        """Wait for the first of the events (keys of self.times). Returns the seconds to it."""
        def seen():
            return [self.times[goal_id, event] for event in events if (goal_id, event) in self.times]

        return min(self.wait(seen, "%s of %s" % (events[0], goal_id))) - self.times[goal_id, since]

    def cpu(self):
        """Returns the CPU seconds of the process so far, exact to microseconds: see clock_getcpuclockid(3)."""
        return time.clock_gettime((~self.process.usage.pid << 3) | 2)


class Benchmark:
    """samples: {(figure, kind of server): [number]}."""

    def __init__(self, master, plan):
        self.plan, self.samples, self.random = plan, {}, random.Random(6)
        self.peers = {kind: Peer(master, kind) for kind in SERVERS}
        for peer in self.peers.values():
            peer.wait_connected(peer.process)

    def add(self, figure, kind, value):
        self.samples.setdefault((figure, kind), []).append(value)

    def turns(self):
        """Returns the servers in random order: [(kind, Peer)]."""
        return self.random.sample(sorted(self.peers.items()), len(self.peers))

    def quiet(self):
        """Wait until the servers have forgotten finished goals, which they list for 5 s: they slow each status."""
        for peer in self.peers.values():
            peer.wait(lambda: not peer.status.status_list, "a status without goals")

    def phases(self):
        """Returns moments spread evenly over a second (list of float), one for each round, in random order."""
        count = self.plan["rounds"]
        return self.random.sample([(i + self.random.random()) / count for i in range(count)], count)

    def measure_reactions(self):
        phases = {kind: zip(self.phases(), self.phases(), self.phases()) for kind in self.peers}
        for _ in range(self.plan["rounds"]):
            for kind, peer in self.turns():
                before, first, second = next(phases[kind])
                if kind == "floor":  # with the same pauses: a process that has slept is slower
                    for pause in before / 5, first, second:
                        time.sleep(pause)
                        self.add("answer", kind, peer.seconds_to(peer.send(0), "result"))
                    continue
                time.sleep(before / 5)  # an idle server sends its status every 0.2 s
                self.add("feedback", kind, peer.seconds_to(peer.send(1000), "bowl-0"))
                time.sleep(first)
                goal_id = peer.send(1000)
                self.add("newer", kind, peer.seconds_to(goal_id, ACTIVE, "bowl-0"))
                peer.seconds_to(goal_id, "bowl-0")
                time.sleep(second)
                peer.cancel(goal_id)
                self.add("cancel", kind, peer.seconds_to(goal_id, "result", since="stop"))

    def measure_idle(self):
        self.quiet()
        for kind, peer in self.peers.items():
            self.add("memory", kind, peer.process.usage.memory_info().rss / 2**20)
        for _ in range(self.plan["windows"]):
            begun, before = time.monotonic(), {kind: peer.cpu() for kind, peer in self.peers.items()}
            time.sleep(self.plan["seconds"])
            for kind, peer in self.peers.items():
                self.add("cpu", kind, 100 * (peer.cpu() - before[kind]) / (time.monotonic() - begun))

    def measure_bursts(self):
        """Empty goals, each sent when the previous result has arrived."""
        for _ in range(self.plan["bursts"]):
            self.quiet()
            for kind, peer in self.turns():
                begun = time.monotonic()
                for _ in range(self.plan["goals"]):
                    peer.seconds_to(peer.send(0), "result")
                self.add("empty", kind, self.plan["goals"] / (time.monotonic() - begun))

    def timeline(self):
        """A goal, a newer one, and a cancel. Returns {kind: [{event: s since the first goal} of each goal]}."""
        self.quiet()
        peers, begun = {kind: self.peers[kind] for kind in ("plain", "robust")}, time.monotonic()
        first = {kind: peer.send(1000) for kind, peer in peers.items()}
        time.sleep(begun + NEWER - time.monotonic())
        second = {kind: peer.send(1000) for kind, peer in peers.items()}
        time.sleep(begun + CANCEL - time.monotonic())
        for kind, peer in peers.items():
            peer.times[first[kind], "stop"] = peer.times[second[kind], "sent"]
            peer.cancel(second[kind])
        return {kind: [self.story(peer, goals[kind], begun) for goals in (first, second)]
                for kind, peer in peers.items()}

    def story(self, peer, goal_id, begun):
        peer.seconds_to(goal_id, "result")
        active = peer.times[goal_id, "sent"] + peer.seconds_to(goal_id, ACTIVE, "bowl-0")
        moments = {event: peer.times[goal_id, event] for event in ["sent", "stop", "result", *peer.bowls_of(goal_id)]}
        return {event: moment - begun for event, moment in dict(moments, active=active).items()}

    def median(self, figure, kind):
        # The floor's only reaction is its answer.
        return statistics.median(self.samples.get((figure, kind)) or self.samples["answer", kind])
