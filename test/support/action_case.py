"""The class of the tests of goal, feedback, preempt and result."""
import unittest

import actionlib
from actions_tutorial.msg import WashTheDishesAction
import psutil
from rosgraph_msgs.msg import Log
import rospy

from support.processes import eventually
from support.raw_client import RawClient, server_of, wait_connected


class ActionTest(unittest.TestCase):
    """A test of the server of wash_dishes_as. client: actionlib's SimpleActionClient; raw: a RawClient;
    errors: what the server has logged as such (list of str)."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.client, cls.raw = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction), RawClient()
        wait_connected(cls.client)
        cls.raw.wait_connected()
        server = server_of(cls.raw.action)
        cls.server, cls.errors = psutil.Process(server.getPid(rospy.get_name())[2]), []
        rospy.Subscriber("/rosout", Log, cls.keep_error)
        eventually(lambda: "/rosout" in [topic for _, _, _, _, topic, *_ in server.getBusInfo(rospy.get_name())[2]],
                   "a server that sends its log")

    @classmethod
    def keep_error(cls, line):
        # actionlib also logs an error, with this text, when a cancel comes for a goal that it does not know.
        harmless = "uninitialized ServerGoalHandle" in line.msg
        if line.name.endswith("action_server") and line.level >= Log.ERROR and not harmless:
            cls.errors.append(line.msg)

    def tearDown(self):
        self.assertEqual([], [self.errors.pop() for _ in list(self.errors)], "errors that the server has logged")

    def start(self, goal, **callbacks):
        """Send a goal with client. actionlib's client loses an answer that comes before its send_goal returns
        (ros/actionlib #206), so the server's process is stopped meanwhile. Only tests do this, never a program."""
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
