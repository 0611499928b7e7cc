"""What tests of servers share: a server of wash_dishes_as in the test's own process, and its client; the command that
starts server_programs.py."""
import sys
import threading
import unittest

from actions_tutorial.msg import WashTheDishesAction
from rosgraph_msgs.msg import Log
import rospy

from support.processes import eventually
from support.raw_client import RawClient
from support.states import ACTIVE

PROGRAM = sys.executable, "-m", "robust.server_programs"  # a command without the name and arguments of the program


class ServerCase(unittest.TestCase):
    """server: what serve() has started; client: its RawClient; started: number_of_minutes of each goal that has
    started; free: ends work_until_free; log: lines of this node's log (Log)."""

    library = None  # the module whose SimpleActionServer is tried

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.log = []
        rospy.Subscriber("/rosout", Log, lambda line: cls.log.append(line) if line.name == rospy.get_name() else None)

    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        self.name = self.namespace + "/wash_dishes_as"
        self.started, self.free = [], threading.Event()
        self.addCleanup(self.free.set)

    def serve(self, execute_cb=None, goal_cb=None, preempt_cb=None, kind=None, auto_start=False):
        """Start self.server with these callbacks, and connect self.client. kind: a class instead of the library's."""
        kind = kind or self.library.SimpleActionServer
        self.server = kind(self.name, WashTheDishesAction, execute_cb, auto_start)
        self.addCleanup(setattr, self.server, "need_to_terminate", True)  # or the thread of actionlib's goes on
        if goal_cb:
            self.server.register_goal_callback(goal_cb)
        if preempt_cb:
            self.server.register_preempt_callback(preempt_cb)
        if not auto_start:
            self.server.start()
        self.connect()

    def connect(self):
        """Connect a new self.client."""
        self.client = RawClient(self.namespace)
        self.addCleanup(self.client.close)
        self.client.wait_connected()

    def work_until_free(self, goal):
        """An execute_cb: 0 minutes SUCCEED at once, others are PREEMPTED when self.free is set."""
        self.started.append(goal.number_of_minutes)
        if goal.number_of_minutes:
            self.free.wait(30)
            self.server.set_preempted()
        else:
            self.server.set_succeeded()

    def accept(self):
        """A goal callback: accept the goal, and leave it ACTIVE."""
        self.started.append(self.server.accept_new_goal().number_of_minutes)

    def send_active(self, number_of_minutes, **options):
        """Send a goal, and wait until it is ACTIVE and has started. Returns its id."""
        goal = self.client.send(number_of_minutes, **options)
        self.client.wait(lambda: ACTIVE in self.client.states.get(goal, []), f"{goal} is ACTIVE")
        eventually(lambda: number_of_minutes in self.started, f"{goal} has started", self.client)
        return goal

    def send_waiting(self, number_of_minutes, **options):
        """Send a goal, and wait until the server has it. Returns its id."""
        goal = self.client.send(number_of_minutes, **options)
        self.client.wait(lambda: goal in self.client.states, f"{goal} in the status")
        return goal

    def expect(self, goal, state, text=None):
        """Wait for the outcome of a goal: its state and, if given, its whole text. Returns the message."""
        message = self.client.wait_result(goal)
        self.assertEqual(state, message.status.status, self.client)
        if text is not None:
            self.assertEqual(text, message.status.text)
        return message

    def wait_log(self, text, level):
        """Wait for a line of log that holds text. level: such as Log.WARN."""
        eventually(lambda: any(text in one.msg and one.level == level for one in list(self.log)), "log: " + text)
