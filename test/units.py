"""The base of the tests that need no node and no master, and what they share."""
import contextlib
import functools
import logging
import threading
import unittest
import weakref
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import rospy
from actionlib.msg import TestAction, TestActionFeedback, TestActionGoal, TestActionResult
from actionlib_msgs.msg import GoalID, GoalStatusArray
from rospy.impl import paramserver, transport

from actions_tutorial import robust
from actions_tutorial.robust import log, shutdown


@contextlib.contextmanager
def closer():
    """A Closer that hears signals, but does not run, and gives up."""
    one = shutdown.Closer()
    try:
        one.heed_signals()
        yield one
    finally:
        one.give_up()


def is_free(lock):
    """Returns whether another thread gets lock at once."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(lambda: lock.acquire(blocking=False) and lock.release() is None).result()


def send(one, goal_id="", stamp=0):
    """Has a goal with that id and stamp (s) come to one (SimpleActionServer)."""
    one.action_server.internal_goal_callback(TestActionGoal(goal_id=GoalID(id=goal_id, stamp=rospy.Time(stamp))))


def take_up(one, *goal):
    """Has a goal come to one (SimpleActionServer), which accepts it."""
    send(one, *goal)
    one.accept_new_goal()


class Connection(transport.Transport):
    """One of a topic, to the node with that name (str), which keeps in sent what is written."""

    def __init__(self, node="/node"):
        super().__init__(transport.BIDIRECTIONAL)
        self.endpoint_id = self.callerid_pub = node
        self.sent = []
        self.write_data = self.sent.append


class UnitCase(unittest.TestCase):

    def setUp(self):
        """No master, the real clock until a test sets another, and no hook that waits for the end of a node."""
        self.addCleanup(rospy.rostime.switch_to_wallclock)
        rospy.rostime.set_rostime_initialized(True)
        for state in (mock.patch.multiple(rospy.core, _client_ready=False, _in_shutdown=False, _shutdown_flag=False,
                                          _client_shutdown_hooks=[], _preshutdown_hooks=[], _shutdown_hooks=[]),
                      mock.patch.dict("os.environ", ROS_MASTER_URI="http://localhost:1"),
                      mock.patch.dict(rospy.core._xmlrpc_cache), mock.patch.object(rospy.client, "_param_server", None),
                      mock.patch.multiple(shutdown, _endings={}, _told_at=0, hooks_thread=None,
                                          servers=weakref.WeakSet())):
            self.enter(state)

    def enter(self, context):
        """Enter a context until the test ends. (TestCase.enterContext is new in Python 3.11.) Returns what it yields"""
        value = context.__enter__()
        self.addCleanup(context.__exit__, None, None, None)
        return value

    def cache(self, **parameters):
        """Returns rospy's cache of the parameter server, a new one with these parameters, which asks no master."""
        cache = paramserver.ParamServerCache()
        for name, value in parameters.items():
            cache.set("/" + name, value)
        self.enter(mock.patch.object(paramserver, "_param_server_cache", cache))
        return cache

    def logged(self, note=logging.LogRecord.getMessage):
        """Returns a list to which note(line) is added for each line (logging.LogRecord) of rospy's log."""
        said, handler = [], logging.Handler()
        handler.emit = functools.partial(log._write_to_terminal, lambda line: said.append(note(line)))
        logger, level = logging.getLogger("rosout"), logging.getLogger("rosout").level
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        self.addCleanup(lambda: (logger.removeHandler(handler), logger.setLevel(level)))
        return said

    def client(self, base=robust.SimpleActionClient):
        """Returns a client, to which nobody listens."""
        rospy.core.set_initialized(True)
        self.cache(actionlib_client_pub_queue_size=10, actionlib_client_sub_queue_size=-1)
        one = base("work", TestAction)
        one._SimpleActionClient__is_watched = True  # by the test
        self.addCleanup(one.action_client.stop)
        return one

    def server(self):
        """Returns a server that serves, but to which nobody listens. Several have the same topics, as in any node; what
        was sent last on one is in action_server.NAME_pub.impl.latch."""
        one = robust.SimpleActionServer("work", TestAction, auto_start=False)
        one.lock = threading.Lock()  # as a subclass may have for data of its own
        one.action_server.started = True
        self.advertise(one.action_server)
        return one

    def advertise(self, action_server):
        """Gives it its topics, and a timer that does not run."""
        rospy.core.set_initialized(True)
        action_server.status_timer = rospy.Timer.__new__(rospy.Timer)
        for name, topic in (("goal_sub", rospy.Subscriber("work/goal", TestActionGoal)),
                            ("cancel_sub", rospy.Subscriber("work/cancel", GoalID)),
                            *((name + "_pub", rospy.Publisher("work/" + name, message, latch=True, queue_size=1))
                              for name, message in (("status", GoalStatusArray), ("feedback", TestActionFeedback),
                                                    ("result", TestActionResult)))):
            setattr(action_server, name, topic)
            self.addCleanup(topic.unregister)
