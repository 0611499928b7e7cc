#!/usr/bin/env python3
"""What robust must not do: patch anything, lose lines of log, give up on a goal, send anything of its own accord."""
import os
import signal
import sys
import time

from actionlib.msg import TestRequestAction
from actionlib_msgs.msg import GoalStatus
from rosgraph_msgs.msg import Log
import rospy
import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import PACKAGE, run
from support.raw_client import RawClient
from support.scripted import Programs, ScriptedCase, script
from support.states import ABORTED, ACTIVE, SUCCEEDED


class TestRobustPolicy(ScriptedCase):

    library = robust

    def program(self, *arguments, **env):
        """Start a program that ends with the test. -> Process"""
        programs = Programs()
        self.addCleanup(programs.stop)
        return programs.program(*arguments, **env)

    def driver(self, kind):
        """Start programs/driver.py. Returns the program (Process) and a client."""
        program = self.program("driver", kind, ROS_NAMESPACE="/" + kind)
        client = robust.SimpleActionClient(kind + "/driver", WashTheDishesAction)
        self.assertTrue(client.wait_for_server(30))
        return program, client

    # The process

    def test_import_and_use_patch_nothing(self):
        program = self.program("patches_nothing")
        program.expect("^compared [0-9]{4,}$")
        self.assertNotIn("change of", program.stdout)

    def test_every_line_of_log_arrives_and_exit_status_is_kept(self):
        program = self.program("logs")
        self.assertEqual(3, program.wait())
        missing = [number for number in range(300) if "line %d." % number not in program.stdout]
        self.assertEqual([], missing)

    def test_import_star_gives_actionlibs_names_only(self):
        names = run(sys.executable, "-c", """if True:
            import actionlib
            from actions_tutorial.robust import *
            print(sorted(name for name in set(dir()) - set(vars(actionlib)) if name[0] != "_"))""")
        self.assertEqual("['actionlib']\n", names)

    def test_clients_and_servers_that_are_stopped_leave_nothing(self):
        program = self.program("drops_clients")
        program.expect(r"^clients \(0, \d, 0\)$")  # rospy may have started a thread of its own
        program.expect("^servers True")

    # Programs that nobody here wrote

    def test_stop_handler_that_reads_gh_stops_both_arms(self):
        for kind in "is_not_none", "true":
            program = self.program("two_arms", kind)
            program.expect("both move")
            program.signal(signal.SIGINT)
            program.expect(r"^\[2, 2\]")

    def test_closed_stdout_affects_no_goal_and_no_later_error(self):
        lines = []
        rospy.Subscriber("/rosout", Log, lambda line: lines.append(line.msg))
        programs = Programs()
        self.addCleanup(programs.stop)
        server = programs.start("sh", "-c", '"$0" | head -1', PACKAGE + "/scripts/robust_action_server.py",
                                PYTHONUNBUFFERED="1")
        server.expect("waits for goals")
        client = RawClient().wait_connected(server)
        self.addCleanup(client.close)
        for _ in range(3):
            self.assertEqual(ABORTED, client.wait_result(client.send(-1)).status.status)
        twice = client.send(0)
        client.wait_result(twice)
        client.send(0, twice)
        self.eventually(lambda: any("goal ignored" in line and twice in line for line in lines), "a warning")

    # The goal

    def test_server_frozen_for_8_s_is_waited_for(self):
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        self.server.signal(signal.SIGSTOP)
        try:
            self.assertFalse(self.client.wait_for_result(8))
        finally:
            self.server.signal(signal.SIGCONT)
        self.assertEqual(ACTIVE, self.client.get_state())
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([], 1), (self.cancels, len(self.goals)))

    def test_server_busy_for_6_s_in_its_goal_callback_is_not_lost(self):
        _, client = self.driver("busy")
        self.assertEqual(SUCCEEDED, client.send_goal_and_wait(WashTheDishesGoal(6), 30, 1), client.get_failure())

    def test_loop_of_waits_ends_when_the_server_was_restarted(self):
        server = self.scripted_server(ROS_NAMESPACE="/restarted")
        client = robust.SimpleActionClient("restarted/scripted", TestRequestAction)
        self.assertTrue(client.wait_for_server(30))
        client.send_goal(script("ACTIVE"))
        self.eventually(lambda: client.get_state() == ACTIVE, "an active goal")
        server.stop()
        self.scripted_server(ROS_NAMESPACE="/restarted")
        begun, cpu = time.monotonic(), time.process_time()
        while not client.wait_for_result(rospy.Duration(1)):
            self.assertLess(time.monotonic() - begun, 30)
        self.assertLess(time.process_time() - cpu, 1)
        self.assertEqual(GoalStatus.LOST, client.get_state())
        self.assertTrue(client.wait_for_result(rospy.Duration(1)))

    def test_driver_that_crashes_and_is_respawned_executes_once(self):
        driver, client = self.driver("crashes")
        client.send_goal(WashTheDishesGoal(1))
        self.assertEqual(1, driver.wait())
        self.assertIn("executes", driver.stdout)
        respawned = self.program("driver", "crashes", ROS_NAMESPACE="/crashes")
        respawned.expect("ready")
        client.wait_for_result(5)
        self.assertTrue(respawned.running())
        self.assertNotIn("executes", respawned.stdout)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_policy", TestRobustPolicy)
