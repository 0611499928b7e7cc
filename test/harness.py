"""What the tests share: processes and masters, a client of the five topics, a test of the action, simulated time.

checks/ and benchmark/ use it, too.
"""
import atexit
import contextlib
import inspect
import itertools
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import uuid
import xmlrpc.client

import actionlib
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
import psutil
import rosgraph
from rosgraph_msgs.msg import Clock
import rospy

PACKAGE = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))  # its folder
PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, RECALLED, PREEMPTING = (
    GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED,
    GoalStatus.RECALLED, GoalStatus.PREEMPTING)
TERMINAL = {PREEMPTED, SUCCEEDED, ABORTED, RECALLED, GoalStatus.REJECTED}
# Debian 11's rospy raises an AttributeError at the end of a shutdown: its Python has no Thread.isAlive any more.
SHUTDOWN_RAISES = sys.version_info >= (3, 9) and "isAlive" in inspect.getsource(rospy.core.signal_shutdown)
NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}


def bowls(count):
    """Returns the names (list of str) of the first bowls."""
    return ["bowl-%d" % i for i in range(count)]


def eventually(condition, what, *shown, timeout=50, changed=None, pause=0.02):
    """Wait until condition() is true. It is called every pause (s), and when changed (threading.Condition) is notified.

    shown: objects that the error shows. The wait ends when a Process among them has ended.
    Returns what condition() returned. Raises AssertionError with what (str) after timeout (s).
    """
    begun, changed = time.monotonic(), changed or threading.Condition()
    with changed:
        while True:
            ended = any(isinstance(one, Process) and one.has_ended() for one in shown)
            value = condition()
            if value:
                return value
            waited = time.monotonic() - begun
            if ended or waited > timeout:
                raise AssertionError("\n".join(
                    ["expected: %s; not so after %.1f s" % (what, waited)] + [str(one) for one in shown]))
            changed.wait(pause)


# Processes

class Process:
    """A command (list of str) in a process group of its own. env (dict of str) is added to the environment; popen: for
    subprocess.Popen. lines: [(s since the start, "stdout" or "stderr", text)]; usage: psutil.Process."""

    running_ones = set()

    def __init__(self, command, env=None, **popen):
        self.command, self.lines, self._changed, self.started = command, [], threading.Condition(), time.monotonic()
        options = dict({"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}, **popen)
        environment = dict(os.environ)
        environment.pop("PYTHONUNBUFFERED", None)  # or nobody would see that a flush is missing
        environment.update(env or {})
        self._popen = subprocess.Popen(command, env=environment, start_new_session=True, universal_newlines=True,
                                       errors="replace", **options)
        self.running_ones.add(self)
        self.usage = psutil.Process(self._popen.pid)
        self._readers = [threading.Thread(target=self._read, args=[name, pipe], daemon=True) for name, pipe in (
            ("stdout", self._popen.stdout), ("stderr", self._popen.stderr)) if pipe]
        for reader in self._readers:
            reader.start()

    def _read(self, name, pipe):
        with pipe:
            for text in pipe:
                with self._changed:
                    self.lines.append((time.monotonic() - self.started, name, text.rstrip("\n")))
                    self._changed.notify_all()

    def output(self, stream):
        """Returns the text that came on "stdout" or "stderr" so far."""
        return "".join(text + "\n" for _, name, text in list(self.lines) if name == stream)

    stdout = property(lambda self: self.output("stdout"))
    stderr = property(lambda self: self.output("stderr"))

    def expect(self, pattern, timeout=50):
        """Wait until a line holds pattern (regex), also one that came earlier. Returns the match."""
        def match():
            return next(filter(None, (re.search(pattern, text) for _, _, text in self.lines)), None)

        return eventually(match, "a line with /%s/" % pattern, self, timeout=timeout, changed=self._changed)

    def running(self):
        return self._popen.poll() is None

    def has_ended(self):
        """Returns whether the process has ended and all its output is in lines."""
        return not self.running() and not any(reader.is_alive() for reader in self._readers)

    def wait(self, timeout=50):
        """Wait until the process ends, for timeout (s). Returns its exit status (int; -n: killed by signal n)."""
        eventually(lambda: not self.running(), "the process ends", self, timeout=timeout)
        for reader in self._readers:
            reader.join(5)  # a child of it may still hold the pipe
        return self._popen.returncode

    def type(self, keys):
        """Write keys (str) to its stdin, which must be a pipe."""
        self._popen.stdin.write(keys)
        self._popen.stdin.flush()

    def signal(self, number):
        """Send a signal to the process alone, as kill(1) does; SIGKILL is stop()."""
        if number == signal.SIGKILL:
            return self.stop()
        self._popen.send_signal(number)
        if number == signal.SIGSTOP:
            eventually(lambda: self.usage.status() == psutil.STATUS_STOPPED, "the process is stopped", self)

    def stop(self):
        """Kill the group."""
        self.kill()
        self.wait()

    def kill(self):
        """Kill the group, without waiting."""
        # After its end, its number may belong to another process, unless there is no such process.
        if self.running() or not psutil.pid_exists(self._popen.pid):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)
        self.running_ones.discard(self)

    def __str__(self):
        status = self._popen.poll()
        return "\n".join(["'%s' (%s), its output:" % (
            " ".join(self.command), "running" if status is None else "exit status %d" % status)]
            + ["  %7.3f s %s: %s" % line for line in list(self.lines)])


def run(*command, timeout=120, status=0, **env):
    """Run a command (str …) to its end. Returns its stdout. Raises AssertionError if the exit status is not status."""
    process = Process(list(command), env)
    try:
        assert process.wait(timeout) == status, "expected exit status %d of %s" % (status, process)
    finally:
        process.stop()
    return process.stdout


def bound_socket(port=0):
    """Returns a socket that is bound and does not listen. A program may still listen on its port, and no other gets
    it by chance."""
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.bind(("127.0.0.1", port))
    return bound


class Group:
    """Processes that end together, at the end of a with statement at the latest. env: added to their environment."""

    def __init__(self, **env):
        self.env, self.processes = env, []

    def start(self, *command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **env):
        """Start a command (str …). -> Process"""
        self.processes.append(Process(list(command), dict(self.env, **env), stdin=stdin, stdout=stdout, stderr=stderr))
        return self.processes[-1]

    def node(self, name, *arguments, **options):
        """Start scripts/NAME, without rosrun, which takes longer than the node. -> Process"""
        return self.start(os.path.join(PACKAGE, "scripts", name), *arguments, **options)

    def stop(self):
        while self.processes:
            self.processes.pop().stop()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()


class Master(Group):
    """A rosmaster on a free port, with a ROS_HOME of its own, and processes that run on it."""

    homes = []  # folders, of all masters together

    def __init__(self):
        self._port = bound_socket()
        port = str(self._port.getsockname()[1])
        self.home = tempfile.mkdtemp(prefix="actions_tutorial-")
        self.homes.append(self.home)
        super().__init__(ROS_MASTER_URI="http://localhost:" + port, ROS_HOSTNAME="localhost", ROS_IP="",
                         ROS_NAMESPACE="", ROS_HOME=self.home, ROS_LOG_DIR=os.path.join(self.home, "log"))
        master = self.start("rosmaster", "--core", "-p", port)
        eventually(lambda: rosgraph.is_master_online(self.env["ROS_MASTER_URI"]), "a master", master)

    def stop(self):
        super().stop()
        self._port.close()
        shutil.rmtree(self.home, ignore_errors=True)


@atexit.register
def leave_nothing():
    """An interrupted test leaves neither processes nor folders behind."""
    for process in list(Process.running_ones):
        process.kill()
    for home in Master.homes:
        shutil.rmtree(home, ignore_errors=True)


# Output of the action clients in scripts/

def printed_bowls(client):
    """Returns the bowls that a client (Process) has printed as feedback, and those of its result or None."""
    feedback, _, result = client.stdout.partition("The result is: ")
    named = [line.split('"')[1] for line in feedback.splitlines() if "last_dish_washed" in line]
    return named, [line[4:] for line in result.splitlines() if line.startswith("  - ")] if result else None


def check_client(client, status, count):
    """Wait for the end of a client (Process). Expect an exit status, and count bowls as feedback and as result."""
    assert client.wait(60) == status, "expected exit status %d of %s" % (status, client)
    assert printed_bowls(client) == (bowls(count), bowls(count)), "expected %d bowls of %s" % (count, client)


# Messages

def server_of(action):
    """Returns the node (xmlrpc.client.ServerProxy) that serves action (str, with a slash at its end). Raises KeyError
    or ValueError if there is none or several."""
    master = rosgraph.Master(rospy.get_name())
    server, = dict(master.getSystemState()[0])[action + "result"]
    return xmlrpc.client.ServerProxy(master.lookupNode(server))


def sends_here(action, topics=("feedback", "result", "status")):
    """Returns whether the server of action (str, with a slash at its end) sends those topics to this node. It is asked
    itself: a subscriber counts a connection before it is one, and messages sent by then are lost."""
    me = rospy.get_name()
    try:
        connections = server_of(action).getBusInfo(me)[2]
    except (KeyError, ValueError, rosgraph.MasterError, OSError):  # none, several, or one that has just ended
        return False
    return {topic for _, to, way, _, topic, *_ in connections if (to, way) == (me, "o")} >= {
        action + topic for topic in topics}


def wait_connected(client, ns="wash_dishes_as"):
    """Wait until the messages of a client (SimpleActionClient) go both ways. ns: the action's name."""
    assert client.wait_for_server(rospy.Duration(50)), "expected a server of %s" % ns
    eventually(lambda: sends_here(rospy.resolve_name(ns) + "/"), "a server of %s that sends to this node" % ns)


class RawClient:
    """Sends goals and cancels of wash_dishes_as as plain messages, and keeps all that comes from the server.

    namespace: the server's (str). topics: those that the server has. feedback, results: {goal id: [message]};
    states: {goal id: [status number, in the order seen]}; times: {(goal id, "sent", status number, bowl or "result"):
    time.monotonic() of the first}; active_at_once: the most goals that one status showed as ACTIVE or PREEMPTING.
    """

    _numbers = itertools.count()

    def __init__(self, namespace="", topics=("goal", "cancel", "feedback", "result", "status")):
        # Here, since checks/ use this file outside of a workspace.
        from actions_tutorial import msg
        self.namespace, self.action, self.changed = namespace, namespace + "/wash_dishes_as/", threading.Condition()
        self.feedback, self.results, self.states, self.times, self.active_at_once = {}, {}, {}, {}, 0
        self.status, self._goal = GoalStatusArray(), msg.WashTheDishesActionGoal
        self.publishers = {topic: rospy.Publisher(self.action + topic, kind, queue_size=1000) for topic, kind in (
            ("goal", msg.WashTheDishesActionGoal), ("cancel", GoalID)) if topic in topics}
        self.subscribers = {topic: rospy.Subscriber(self.action + topic, kind, callback) for topic, kind, callback in (
            ("feedback", msg.WashTheDishesActionFeedback, self._on_feedback),
            ("result", msg.WashTheDishesActionResult, self._on_result),
            ("status", GoalStatusArray, self._on_status)) if topic in topics}

    def close(self):
        for end in [*self.publishers.values(), *self.subscribers.values()]:
            end.unregister()

    def connected(self):
        """Returns whether messages go both ways."""
        ends = [*self.publishers.values(), *self.subscribers.values()]
        return all(end.get_num_connections() for end in ends) and sends_here(self.action, self.subscribers)

    def wait_connected(self, *processes):
        """Wait until messages go both ways. processes: shown if they do not. -> self"""
        eventually(self.connected, "a server of %s, connected both ways" % self.action, self, *processes)
        return self

    def new_id(self):
        """Returns an id that no goal has, not even one of an earlier test that the server still knows."""
        return "%s-%d-%s" % (rospy.get_name(), next(self._numbers), uuid.uuid4().hex[:8])

    def send(self, number_of_minutes, goal_id=None, stamp=None):
        """Send a goal (int; stamp: rospy.Time, by default now). Returns its id (str)."""
        goal = self._goal()
        goal.goal.number_of_minutes = number_of_minutes
        goal.goal_id.id = self.new_id() if goal_id is None else goal_id
        goal.goal_id.stamp = rospy.Time.now() if stamp is None else stamp
        self.times[goal.goal_id.id, "sent"] = time.monotonic()
        self.publishers["goal"].publish(goal)
        return goal.goal_id.id

    def cancel(self, goal_id="", stamp=rospy.Time()):
        """Send a cancel: of one goal, of all (no id, no stamp), or of all up to stamp."""
        self.publishers["cancel"].publish(GoalID(id=goal_id, stamp=stamp))

    def wait(self, condition, what, timeout=50):
        """Wait until condition() is true. Returns its value; AssertionError with what (str) and all that came."""
        return eventually(condition, what, self, timeout=timeout, changed=self.changed, pause=0.1)

    def wait_bowls(self, goal_id, count):
        """Wait for count bowls of feedback."""
        self.wait(lambda: len(self.bowls_of(goal_id)) >= count, "%d bowls of %s" % (count, goal_id))

    def wait_result(self, goal_id):
        """Wait for the result of a goal and its terminal state in the status. -> WashTheDishesActionResult"""
        self.wait(lambda: self.results.get(goal_id) and TERMINAL & set(self.states.get(goal_id, [])),
                  "a result of %s, and its terminal state in the status" % goal_id)
        assert len(self.results[goal_id]) == 1, "expected one result of %s: %s" % (goal_id, self)
        return self.results[goal_id][0]

    def check_outcome(self, goal_id, state, washed):
        """Expect one result, with that state (int) and those bowls (list of str), and feedback that names the same."""
        result = self.wait_result(goal_id)
        assert (result.status.status, result.result.dishes_washed) == (state, washed), \
            "expected %s %s with %s: %s" % (goal_id, NAMES[state], washed, self)
        self.wait(lambda: self.bowls_of(goal_id) == washed, "feedback of %s for %s" % (washed, goal_id), timeout=10)
        return result

    def bowls_of(self, goal_id):
        """Returns the bowls that feedback has named so far."""
        return [message.feedback.last_dish_washed for message in self.feedback.get(goal_id, [])]

    def _on_feedback(self, message):
        self._keep(self.feedback, message, message.feedback.last_dish_washed)

    def _on_result(self, message):
        self._keep(self.results, message, "result")

    def _keep(self, where, message, event):
        now, goal_id = time.monotonic(), message.status.goal_id.id
        with self.changed:
            self.times.setdefault((goal_id, event), now)
            where.setdefault(goal_id, []).append(message)
            self.changed.notify_all()

    def _on_status(self, message):
        now = time.monotonic()
        with self.changed:
            self.status = message
            for status in message.status_list:
                seen = self.states.setdefault(status.goal_id.id, [])
                if status.status not in seen[-1:]:
                    self.times.setdefault((status.goal_id.id, status.status), now)
                    seen.append(status.status)
            self.active_at_once = max(self.active_at_once, sum(
                status.status in (ACTIVE, PREEMPTING) for status in message.status_list))
            self.changed.notify_all()

    def __str__(self):
        with self.changed:
            last = list(dict.fromkeys([*self.states, *self.feedback, *self.results]))[-5:]
            lines = ["last status of %.2f s" % self.status.header.stamp.to_sec()]
            return "\n".join(lines + ["%s: states %s, bowls %s, results %s" % (
                goal_id, [NAMES[state] for state in self.states.get(goal_id, [])], self.bowls_of(goal_id),
                [(NAMES[one.status.status], one.status.text, one.result.dishes_washed)
                 for one in self.results.get(goal_id, [])]) for goal_id in last])


class ActionTest(unittest.TestCase):
    """A test of the server of wash_dishes_as. client: actionlib's SimpleActionClient; raw: a RawClient."""

    @classmethod
    def setUpClass(cls):
        from actions_tutorial.msg import WashTheDishesAction
        rospy.init_node("test")
        cls.client, cls.raw = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction), RawClient()
        wait_connected(cls.client)
        cls.raw.wait_connected()
        cls.server = psutil.Process(server_of(cls.raw.action).getPid(rospy.get_name())[2])

    def start(self, goal, **callbacks):
        """Send a goal with client. actionlib's client loses an answer that comes before its send_goal returns
        (ros/actionlib #206), so the server is stopped meanwhile."""
        self.server.suspend()
        try:
            eventually(lambda: self.server.status() == psutil.STATUS_STOPPED, "the server is stopped")
            self.client.send_goal(goal, **callbacks)
        finally:
            self.server.resume()

    def send(self, goal, **callbacks):
        """Send a goal with client, and wait until it is over."""
        self.start(goal, **callbacks)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(20)), "no outcome")


# Time

class SimulatedClock:
    """A /clock that stands still unless the test turns it. now: rospy.Time."""

    def __init__(self):
        self._here, self._changed = None, threading.Condition()
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=100, latch=True)
        self._subscriber = rospy.Subscriber("/clock", Clock, self._follow)  # called after rospy's own, which came first
        self.set(rospy.Time(int(time.time() % 1e6) * 1000))  # later than the clock of an earlier test

    def _follow(self, message):
        with self._changed:
            self._here = message.clock
            self._changed.notify_all()

    def set(self, now):
        """Set the clock to now (rospy.Time): in this process at once, in other nodes soon."""
        self.now = now
        self._publisher.publish(now)
        eventually(lambda: self._here == now, "a /clock that comes back", changed=self._changed)

    def turn(self, seconds, client=None):
        """Turn the clock on by seconds. client: a RawClient, to wait for the server's next status (0.25 s or more)."""
        self.set(self.now + rospy.Duration.from_sec(seconds))
        if client:
            client.wait(lambda: client.status.header.stamp == self.now, "a status of %.2f s" % self.now.to_sec())

    def lead(self, client):
        """Turn the clock on until the server's status follows it, which may have missed some turns."""
        begun = self.now
        client.wait(lambda: self.turn(0.25) or begun < client.status.header.stamp <= self.now,
                    "a status that follows the clock")
        self.turn(0.25, client)  # or a goal may overtake the last of those turns
