#!/usr/bin/env python3
"""launch/wash_the_dishes.launch with each of its arguments."""
import signal
import unittest

import rosnode
import rospy
import rostest

from support.printed import bowls, printed_bowls
from support.processes import Group
from support.raw_client import RawClient


class LaunchTest(unittest.TestCase):
    """A test of the launch file."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")

    def setUp(self):
        self.processes = Group()
        self.addCleanup(self.processes.stop)

    def launch(self, *arguments):
        """-> Process"""
        return self.processes.start("roslaunch", "actions_tutorial", "wash_the_dishes.launch", *arguments)

    def check_bowls(self, launch, count):
        """Wait for the end of a launch. Expect that its client has printed a result of so many bowls."""
        self.assertEqual((0, bowls(count)), (launch.wait(), printed_bowls(launch)[1]), launch)

    def check_server_alone(self, launch, server):
        """Expect the server (str, its node), no client, and an end on Ctrl-C."""
        RawClient().wait_connected(launch)
        self.assertEqual({server}, {name for name in rosnode.get_node_names() if "action" in name})
        launch.signal(signal.SIGINT)
        launch.wait()


class TestLaunch(LaunchTest):

    def test_default_is_seven_minutes(self):
        arguments = self.launch("--ros-args")
        arguments.expect(r'number_of_minutes \(default "7"\)')

    def test_number_of_minutes(self):
        self.check_bowls(self.launch("number_of_minutes:=1"), 1)

    def test_client_false_starts_the_server_alone(self):
        self.check_server_alone(self.launch("client:=false"), "/action_server")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "launch", TestLaunch)
