#!/usr/bin/env python3
"""launch/wash_the_dishes.launch with each of its arguments."""
import signal
import unittest

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

    def check_end(self, launch):
        """Wait for the end of a launch. Expect roslaunch's exit status, which is 0 even if a node fails, and that the
        server's output was on the screen."""
        self.assertEqual(0, launch.wait(), launch)
        self.assertIn("wash_dishes_as waits for goals", launch.stdout, launch)

    def check_bowls(self, launch, count):
        """Wait for the end of a launch. Expect that its client has printed a result of so many bowls."""
        self.check_end(launch)
        self.assertEqual(bowls(count), printed_bowls(launch)[1], launch)

    def check_nodes(self, launch, *names):
        """Expect that a launch that is over listed nodes (str), each with the program of that name."""
        for name in names:
            launch.expect(r"^ +%s \(actions_tutorial/%s\.py\)$" % (name, name))

    def check_server_alone(self, launch, server):
        """Expect the server (str, its node), no client, and an end on Ctrl-C."""
        RawClient().wait_connected(launch)
        launch.signal(signal.SIGINT)
        self.check_end(launch)
        self.check_nodes(launch, server)
        self.assertNotIn("action_client", launch.stdout, launch)


class TestLaunch(LaunchTest):

    def test_arguments_have_defaults_and_a_description(self):
        arguments = self.launch("--ros-args")
        arguments.expect(r'number_of_minutes \(default "7"\): .*how many minutes')
        arguments.expect(r'client \(default "true"\): false starts only the server')

    def test_number_of_minutes(self):
        launch = self.launch("number_of_minutes:=1")
        self.check_bowls(launch, 1)
        self.check_nodes(launch, "action_server", "action_client")

    def test_client_false_starts_the_server_alone(self):
        self.check_server_alone(self.launch("client:=false"), "action_server")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "launch", TestLaunch)
