"""What is measured. The clients are plain publishers and subscribers: actionlib's would add delays of their own."""
import collections
import gc
import os
import random
import sys
import time

import rospy
from support.processes import PACKAGE
from support.raw_client import RawClient
from support.states import ACTIVE

PROGRAMS = {"floor": "benchmark/ping_pong.py", "plain": "scripts/action_server.py",
            "hz20": "benchmark/action_server_20_hz.py", "robust": "scripts/robust_action_server.py"}


class Server(RawClient):
    """A server in a namespace of its own, with this process as its client."""

    def __init__(self, master, kind):
        topics = ["goal", "result"] if kind == "floor" else ["goal", "cancel", "feedback", "result", "status"]
        super().__init__("/" + kind, topics)
        self.process = master.start(sys.executable, os.path.join(PACKAGE, PROGRAMS[kind]), "__ns:=/" + kind)
        self.wait_connected(self.process)

    def cancel(self, goal_id):
        self.times[goal_id, "cancel"] = time.monotonic()
        super().cancel(goal_id)

    def moment(self, goal_id, event):
        """Wait for the event of a goal. Returns its time.monotonic()."""
        return self.wait(lambda: self.times.get((goal_id, event)), "%s of %s" % (event, goal_id))

    def answer_time(self):
        """Send an empty goal and wait for its result. Returns how long that took (s)."""
        goal = self.send(0)
        return self.moment(goal, "result") - self.moment(goal, "sent")

    def wash(self, pause):
        """Send a goal, pause (s) after its first bowl a newer one, and pause after that one's first bowl its cancel.
        Returns the moments of both goals."""
        first = self.send(1000)
        self.moment(first, "bowl-0")
        time.sleep(pause)
        newer = self.send(1000)
        self.moment(newer, "bowl-0")
        time.sleep(pause)
        self.cancel(newer)
        return self.moments(first), self.moments(newer)

    def moments(self, goal_id):
        """Wait until a goal has ended. Returns {"sent", "cancel", state, bowl or "result": its time.monotonic()}."""
        self.moment(goal_id, ACTIVE)
        self.moment(goal_id, "result")
        with self.changed:
            return {event: moment for (of, event), moment in self.times.items() if of == goal_id}

    def wait_idle(self):
        """Wait until the server has forgotten its finished goals: it lists them in each status, for 5 s."""
        self.wait(lambda: not self.status.status_list, "a status without goals")

    def cpu(self):
        """Returns the CPU seconds of the process so far, exact to microseconds: see clock_getcpuclockid(3)."""
        return time.clock_gettime((~self.process.usage.pid << 3) | 2)


class Benchmark:
    """The servers run on master (Master). samples: {(figure, kind): [ms, 1/s, % or MiB, as in the table]}."""

    def __init__(self, master):
        gc.disable()  # or it may add up to 0.2 s to a sample
        os.environ.update(master.env)
        rospy.init_node("benchmark", disable_signals=True)
        self.servers = {kind: Server(master, kind) for kind in PROGRAMS}
        self.samples = collections.defaultdict(list)

    def shuffled(self):
        """Returns [(kind, Server)] in random order."""
        return random.sample(list(self.servers.items()), len(self.servers))

    def measure_reactions(self, rounds):
        """Times from a goal to its first bowl, from a newer goal to ACTIVE, and from a cancel to the result.
        The newer goals and the cancels are spread evenly over a bowl's second."""
        for number in range(rounds):
            pause = (number + random.random()) / rounds
            for kind, server in self.shuffled():
                time.sleep(random.uniform(0, 0.2))  # an idle server sends its status every 0.2 s
                if kind == "floor":
                    for figure in "feedback", "newer", "cancel":
                        time.sleep(pause)  # as in wash: a process that has slept is slower
                        self.samples[figure, kind].append(1e3 * server.answer_time())
                else:
                    goal, newer = server.wash(pause)
                    self.samples["feedback", kind].append(1e3 * (goal["bowl-0"] - goal["sent"]))
                    self.samples["newer", kind].append(1e3 * (newer[ACTIVE] - newer["sent"]))
                    self.samples["cancel", kind].append(1e3 * (newer["result"] - newer["cancel"]))

    def measure_idle(self, windows):
        """Memory, and the share of a core in each window of 10 s."""
        for kind, server in self.servers.items():
            server.wait_idle()
            self.samples["memory", kind].append(server.process.usage.memory_info().rss / 2**20)
        for _ in range(windows):
            before = {kind: server.cpu() for kind, server in self.servers.items()}
            time.sleep(10)
            for kind, server in self.servers.items():
                self.samples["cpu", kind].append(100 * (server.cpu() - before[kind]) / 10)

    def measure_empty_goals(self, bursts):
        """Bursts of 100, each goal sent when the previous result has arrived."""
        for _ in range(bursts):
            for kind, server in self.shuffled():
                server.wait_idle()
                begun = time.monotonic()
                for _ in range(100):
                    server.answer_time()
                self.samples["empty", kind].append(100 / (time.monotonic() - begun))

    def timelines(self):
        """A goal, a newer one and its cancel, for a picture. Returns {kind: what Server.wash returns}."""
        return {kind: self.servers[kind].wash(1.5) for kind in ("plain", "robust")}
