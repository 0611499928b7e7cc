#!/usr/bin/python3
"""The launch file starts server and client, hands the goal over, and ends when the client does."""
import signal
import unittest

import rostest

from processes import Master, check_client, eventually


class TestLaunch(unittest.TestCase):

    def setUp(self):
        self.master = Master()
        self.addCleanup(self.master.stop)

    def launch(self, *arguments):
        return self.master.start("roslaunch", "actions_tutorial", "wash_the_dishes.launch", *arguments)

    def nodes(self):
        """The nodes that the master knows to publish, subscribe or serve, but for rosout."""
        kinds = self.master.api.getSystemState()
        return sorted({node for kind in kinds for _, nodes in kind for node in nodes} - {"/rosout"})

    def test_argument_is_the_goal_and_the_end_is_the_clients(self):
        launch = self.launch("number_of_minutes:=2")
        check_client(launch, 0, 2)
        eventually(lambda: not self.nodes(), "no node left")
        self.assertFalse(self.master.api.hasParam("/action_client"), "a parameter for the client's next run")

    def test_wrong_parameter_is_the_launchs_and_not_one_of_an_earlier_run(self):
        launch = self.launch("number_of_minutes:=x")
        self.assertIn("number_of_minutes is 'x', must be a whole number", launch.expect("must be").string)
        self.assertIn("this one is from the launch", launch.stderr)
        launch.wait()

    def test_seven_minutes_unless_told_otherwise(self):
        launch = self.launch()
        launch.expect("bowl-0")
        self.assertEqual(7, self.master.api.getParam("/launched_client/number_of_minutes"))
        launch.signal(signal.SIGINT)
        launch.wait()

    def test_without_client_the_server_stays(self):
        launch = self.launch("client:=false")
        eventually(lambda: self.nodes() == ["/action_server"], "the server alone", launch)
        check_client(self.master.node("action_client.py", "_number_of_minutes:=1"), 0, 1)
        self.assertTrue(launch.running(), launch)
        launch.signal(signal.SIGINT)
        self.assertEqual(0, launch.wait(), launch)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "launch", TestLaunch)
