"""What tests of clients share: the action `scripted`, which scripted_server.py serves as each goal says."""
import gc
import sys
import unittest

from actionlib.msg import TestRequestAction, TestRequestActionGoal, TestRequestActionResult, TestRequestGoal
from actionlib_msgs.msg import GoalID
from rosgraph_msgs.msg import Log
import rospy
from std_msgs.msg import String

from support.processes import Group, eventually

SCRIPTED_SERVER = sys.executable, "-m", "support.scripted_server"


def script(words, the_result=0):
    """Returns a goal: what the scripted server does (words; see there), and the result that it sends."""
    return TestRequestGoal(result_text=words, the_result=the_result)


class ScriptedCase(unittest.TestCase):
    """goals, cancels, results: the messages on these topics of the action, without late cancels of an older test; log:
    lines of this node's log (Log)."""

    library = None  # the module whose SimpleActionClient is tried
    patience = 30  # s for each wait

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.goals, cls.all_cancels, cls.results, cls.log, cls.programs = [], [], [], [], Group()
        cls.go_pub = rospy.Publisher("scripted/go", String, queue_size=10)
        rospy.Subscriber("scripted/goal", TestRequestActionGoal, cls.goals.append)
        rospy.Subscriber("scripted/cancel", GoalID, cls.all_cancels.append)
        rospy.Subscriber("scripted/result", TestRequestActionResult, cls.results.append)
        rospy.Subscriber("/rosout", Log, lambda line: cls.log.append(line) if line.name == rospy.get_name() else None)
        cls.server = cls.programs.start(*SCRIPTED_SERVER)
        # All clients of a node share its connections, so this one makes sure of them.
        cls.first, feedback = cls.library.SimpleActionClient("scripted", TestRequestAction), []

        def is_connected():
            cls.first.send_goal(script("ACTIVE feedback 0.05 cancel result:PREEMPTED"), feedback_cb=feedback.append)
            cls.first.wait_for_result(rospy.Duration(0.2))
            cls.first.cancel_goal()
            return cls.first.wait_for_result(rospy.Duration(1)) and feedback

        cls.first.wait_for_server()
        eventually(is_connected, "messages that go both ways", cls.server)
        eventually(lambda: cls.go_pub.get_num_connections() and cls.goals and cls.all_cancels and cls.results,
                   "all topics", cls.server)

    @classmethod
    def tearDownClass(cls):
        cls.programs.stop()

    def setUp(self):
        for record in self.goals, self.all_cancels, self.results, self.log:
            record.clear()
        self.sent = 0  # goals, by send()
        self.done, self.active, self.feedback = [], [], []  # what connect()'s client told the callbacks of send()

    @property
    def cancels(self):
        ids = {goal.goal_id.id for goal in self.goals}
        return [cancel for cancel in self.all_cancels if cancel.id in ids]

    def connect(self, **options):
        """Make self.client with these keyword arguments."""
        self.client = self.library.SimpleActionClient("scripted", TestRequestAction, **options)
        self.assertTrue(self.client.wait_for_server(rospy.Duration(30)))

    def send(self, words, the_result=0, **callbacks):
        """Send a goal with self.client. What its callbacks get is in done [(state, the_result)], active, feedback."""
        self.sent += 1
        self.client.send_goal(script(words, the_result), **dict(dict(
            done_cb=lambda state, result: self.done.append((state, result and result.the_result)),
            active_cb=lambda: self.active.append(True), feedback_cb=self.feedback.append), **callbacks))

    def go(self):
        """Let the scripts of all goals so far go on after their word go."""
        self.eventually(lambda: len(self.goals) >= max(1, self.sent), "the goals")
        for goal in list(self.goals):
            self.go_pub.publish(goal.goal_id.id)

    def eventually(self, condition, what):
        eventually(condition, what, self.server, timeout=self.patience)

    def wait_state(self, state):
        self.eventually(lambda: self.client.get_state() == state, "state %d" % state)

    def expect(self, state, the_result=None):
        """Wait until self.client's goal is over. Expect its state and, if given, its result."""
        self.assertTrue(self.client.wait_for_result(rospy.Duration(self.patience)), "over in time")
        self.assertEqual(state, self.client.get_state(), self.client.get_goal_status_text())
        if the_result is not None:
            self.assertEqual(the_result, self.client.get_result().the_result)

    def wait_freed(self, reference):
        """Wait until the object of a weakref is freed."""
        self.eventually(lambda: gc.collect() and False or not reference(), "it is freed")

    def wait_log(self, text):
        """Wait for a line of log of this node that holds text."""
        self.eventually(lambda: any(text in line.msg for line in list(self.log)), "log: " + text)
