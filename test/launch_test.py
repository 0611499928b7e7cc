#!/usr/bin/python3
"""The launch file starts server and client, hands the goal over, and ends when the client does."""
import signal
import unittest

import rostest

from harness import Master, eventually


class TestLaunch(unittest.TestCase):

    def setUp(self):
        self.master = Master()
        self.addCleanup(self.master.stop)

    def launch(self, *arguments):
        return self.master.process("roslaunch", "actions_tutorial", "wash_the_dishes.launch", *arguments)

    def nodes(self):
        """The nodes that the master knows to publish, subscribe or serve, but for rosout."""
        kinds = self.master.api.getSystemState()
        return sorted({node for kind in kinds for _, nodes in kind for node in nodes} - {"/rosout"})

    def test_argument_is_the_goal_and_the_end_is_the_clients(self):
        launch = self.launch("number_of_minutes:=2")
        launch.expect("^  - bowl-1$")
        self.assertEqual(0, launch.wait(), launch)
        for line in ('Feedback received: last_dish_washed: "bowl-0"', 'Feedback received: last_dish_washed: "bowl-1"',
                     "The result is: dishes_washed: "):
            self.assertEqual(1, launch.stdout.splitlines().count(line), "lines «%s» of %s" % (line, launch))
        self.assertNotIn("bowl-2", launch.stdout, launch)
        eventually(lambda: not self.nodes(), "no node left")

    def test_seven_minutes_unless_told_otherwise(self):
        launch = self.launch()
        launch.expect("goal accepted: number_of_minutes 7$")
        launch.expect("bowl-0")
        launch.signal(signal.SIGINT)
        launch.wait()

    def test_without_client_the_server_stays(self):
        launch = self.launch("client:=false")
        eventually(lambda: self.nodes() == ["/action_server"], "the server alone")
        launch.expect("wash_dishes_as waits for goals")
        client = self.master.node("action_client.py", "_number_of_minutes:=1")
        self.assertEqual(0, client.wait(), client)
        self.assertTrue(launch.running(), launch)
        launch.signal(signal.SIGINT)
        self.assertEqual(0, launch.wait(), launch)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "launch", TestLaunch)
