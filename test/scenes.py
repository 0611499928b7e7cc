"""The bases of the tests: a scene, which is a server and its clients in a namespace, and the cases that play in it."""
import signal
import unittest
from multiprocessing.pool import ThreadPool

import rosnode
import rospy

from raw_client import SUCCEEDED, RawClient
from processes import Group, bowls, printed_bowls
from simulated_clock import SimulatedClock

# s that a bound of the contract is exceeded by at most, because the clock here runs while a loaded machine starts
# other interpreters on the same cores; a node that is really late hangs for ever, or is late by its own time-outs.
SLACK = 4


class Scene(RawClient, Group):
    """A namespace (str) on this process's master, with what is said and what runs in it."""

    def __init__(self, namespace):
        RawClient.__init__(self, namespace)
        Group.__init__(self, ROS_NAMESPACE=namespace)

    def server(self, script="action_server.py", *arguments, **options):
        """Start a server, and wait until messages go both ways. -> Process"""
        server = self.node(script, *arguments, **options)
        self.wait_connected(server)
        return server

    def client(self, minutes, *arguments, **options):
        """Start a client with this goal, by default one that does not fear a slow machine. -> Process"""
        return self.node("action_client.py", "_number_of_minutes:=%d" % minutes,
                         *(arguments or ["_heartbeat_timeout:=20"]), **options)

    def end(self, process, how, name="until_rosnode_kill"):
        """Tell a node (Process) to end, by a signal (its name) or by rosnode_kill, for which it needs its name."""
        if how == "rosnode_kill":
            rosnode.kill_nodes(["%s/%s" % (self.namespace, name)])
        else:
            process.signal(getattr(signal, how))

    def serves(self):
        """Wait until the server has washed one more bowl."""
        self.check_ending(self.send(1), SUCCEEDED, bowls(1))

    def stop(self):
        Group.stop(self)
        self.close()

    def __str__(self):
        return "\n".join([RawClient.__str__(self)] + [str(process) for process in self.processes])


class ServerCase(unittest.TestCase):
    """Each test finds a new server, on a clock in its hand."""

    script = "action_server.py"

    @classmethod
    def setUpClass(cls):
        rospy.init_node("server_case", disable_signals=True)
        cls.clock = SimulatedClock()

    def setUp(self):
        self.clock.stop()
        self.scene = Scene("")
        self.addCleanup(self.scene.stop)
        self.server = self.scene.server(self.script)
        self.clock.lead(self.scene)

    def wash(self, minutes, count):
        """Send a goal, and turn the clock on second by second until it has named count bowls. Returns its id."""
        goal_id = self.scene.send(minutes)
        for already in range(1, count + 1):
            if already > 1:
                self.clock.turn(1, self.scene)
            self.scene.wait_bowls(goal_id, already)
        return goal_id

    def finish(self, goal_id, minutes):
        """Turn the clock on second by second until a goal of so many minutes has ended as it should. -> its result"""
        for count in range(len(self.scene.bowls_of(goal_id)) + 1, minutes + 1):
            self.clock.turn(1, self.scene)
            self.scene.wait_bowls(goal_id, count)
        self.assertNotIn(goal_id, self.scene.results, "ended before its last second was over: %s" % self.scene)
        self.clock.turn(1, self.scene)
        return self.scene.check_ending(goal_id, SUCCEEDED, bowls(minutes))


class NodeCase(unittest.TestCase):
    """Tests in a process that is a node, so that scenes see messages."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("node_case", disable_signals=True)


def concurrently(place, at_once=2):
    """Class decorator: the first of a TestCase's tests starts them all side by side, as they mostly wait. Each has its
    own outcome and place(its name) (Scene or Master), shares nothing else, and has no set-up nor tear-down methods."""
    pool, runs = ThreadPool(at_once), {}  # its threads end with the program: Ctrl-C waits for none

    def run(test):
        try:
            with place("/" + test.__name__) as here:
                try:
                    test(here)
                finally:
                    test.__self__.doCleanups()
        except SystemExit as error:  # would end a thread of the pool without a word
            raise AssertionError("the test raised %r" % error) from error

    def decorate(case):
        tests = {name: getattr(case(name), name) for name in vars(case) if name.startswith("test_")}

        def outcome(name):
            def joined(_):
                if not runs:
                    runs.update((one, pool.apply_async(run, [test])) for one, test in tests.items())
                runs[name].get()
            return joined

        for name in tests:
            setattr(case, name, outcome(name))
        return case
    return decorate


def check_partial(client, at_least):
    """Wait for a client (Process) that ends with exit status 1, at_least bowls as feedback, and a result with the same.
    The last feedback may be missing: the result has a connection of its own and may overtake it."""
    assert client.wait() == 1, "expected exit status 1 of %s" % client
    named, result = printed_bowls(client)
    assert result is not None and (named, result) == (bowls(len(named)), bowls(len(result))) \
        and len(named) >= at_least and len(result) - len(named) in (0, 1), \
        "expected %d bowls or more, and a result with the same, of %s" % (at_least, client)


def check_quiet(*nodes):
    """Expect no traceback from nodes (Process)."""
    for node in nodes:
        assert "Traceback" not in node.stdout + node.stderr, "expected no traceback of %s" % node
