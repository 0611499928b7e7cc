#!/usr/bin/env python3
"""What robust must not do: leave more threads or topics than actionlib, give up on a goal, send one again."""
import signal

import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

from support.scripted import ScriptedCase
from support.server_case import PROGRAM
from support.states import ACTIVE, SUCCEEDED


class TestRobustPolicy(ScriptedCase):

    library = robust

    def test_clients_and_servers_that_are_stopped_leave_nothing(self):
        self.programs.start(*PROGRAM, "drop_all").expect(r"^left: \[\]$")

    def test_server_frozen_for_6_s_is_waited_for(self):
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        self.server.signal(signal.SIGSTOP)
        try:
            self.assertFalse(self.client.wait_for_result(6))
        finally:
            self.server.signal(signal.SIGCONT)
        self.assertEqual(ACTIVE, self.client.get_state())
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([], 1), (self.cancels, len(self.goals)))

    def test_driver_that_crashes_and_is_respawned_executes_once(self):
        driver = self.programs.start(*PROGRAM, "crashing_driver", ROS_NAMESPACE="/crashes")
        client = robust.SimpleActionClient("crashes/driver", WashTheDishesAction)
        self.assertTrue(client.wait_for_server(30))
        client.send_goal(WashTheDishesGoal(1))
        self.assertEqual(1, driver.wait())
        self.assertIn("executes", driver.stdout)
        respawned = self.programs.start(*PROGRAM, "crashing_driver", ROS_NAMESPACE="/crashes")
        respawned.expect("ready")
        client.wait_for_result(5)
        self.assertTrue(respawned.running())
        self.assertNotIn("executes", respawned.stdout)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_policy", TestRobustPolicy)
