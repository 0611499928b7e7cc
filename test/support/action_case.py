"""The class of the tests of goal, feedback, preempt and result."""
import unittest

import actionlib
from actions_tutorial.msg import WashTheDishesAction
import psutil
import rospy

from support.processes import eventually
from support.raw_client import RawClient, server_of, wait_connected


class ActionTest(unittest.TestCase):
    """A test of the server of wash_dishes_as. client: actionlib's SimpleActionClient; raw: a RawClient."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")
        cls.client, cls.raw = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction), RawClient()
        wait_connected(cls.client)
        cls.raw.wait_connected()
        cls.server = psutil.Process(server_of(cls.raw.action).getPid(rospy.get_name())[2])

    def start(self, goal, **callbacks):
        """Send a goal with client. actionlib's client loses an answer that comes before its send_goal returns
        (ros/actionlib #206), so the server's process is stopped meanwhile: for tests alone, no program does this."""
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
