#!/usr/bin/env python3
"""What robust does with goals when a program is told to end: servers end them, clients may cancel theirs.

The programs are shutdown_server and shutdown_client of server_programs.py, which says what their scripts mean.
"""
import contextlib
import signal
import subprocess
import time
import unittest
import xmlrpc.client

from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust
from parameterized import parameterized
import rosgraph
import rospy
import rostest

from support.printed import bowls
from support.processes import Group
from support.raw_client import RawClient
from support.scripted import ScriptedCase
from support.server_case import PROGRAM
from support.states import ABORTED, ACTIVE, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED

SHUTTING_DOWN = "the server is shutting down"


class TestServer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")

    def setUp(self):
        self.namespace, self.programs = "/" + self.id().split(".")[-1], Group()
        self.addCleanup(self.programs.stop)

    def start(self, *arguments):
        """Start shutdown_server with a script and maybe hook_seconds."""
        self.program = self.programs.start(
            *PROGRAM, "shutdown_server", *arguments, stdin=subprocess.PIPE, ROS_NAMESPACE=self.namespace)
        self.program.expect("ready")

    def connect(self, name="first"):
        """Returns a client of one of the two servers."""
        client = RawClient(f"{self.namespace}/{name}")
        self.addCleanup(client.close)
        return client.wait_connected(self.program)

    def send_active(self, client, minutes=1):
        goal = client.send(minutes)
        client.wait(lambda: ACTIVE in client.states.get(goal, []), "an active goal")
        return goal

    def start_goal(self, *arguments):
        """Start shutdown_server, and a goal of first. Returns the client and the goal."""
        self.start(*arguments)
        client = self.connect()
        return client, self.send_active(client)

    def expect(self, client, goal, state, text, count=0):
        """Wait for the result of a goal. Expect one, with count bowls."""
        client.wait(lambda: client.results.get(goal), f"a result of {goal}")
        self.assertEqual([(state, text, bowls(count))], [
            (one.status.status, one.status.text, one.result.dishes_washed) for one in client.results[goal]], client)

    # What ends a program

    def ctrl_c(self):
        self.program.signal(signal.SIGINT)

    def sigterm(self):
        self.program.signal(signal.SIGTERM)

    def rosnode_kill(self):
        uri = rosgraph.Master(rospy.get_name()).lookupNode(f"{self.namespace}/shutdown_server")
        with contextlib.suppress(OSError):  # the node may end before it answers
            xmlrpc.client.ServerProxy(uri).shutdown(rospy.get_name(), "rosnode kill")

    def end_main_thread(self):
        self.program.type("end_main_thread\n")

    def signal_shutdown(self):
        self.program.type("signal_shutdown\n")

    @parameterized.expand(["ctrl_c", "sigterm", "rosnode_kill", "end_main_thread", "signal_shutdown"])
    def test_goal_is_aborted_with_its_result_after(self, end):
        client, goal = self.start_goal("rate")
        getattr(self, end)()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)
        self.program.wait(10)

    # What a goal does meanwhile

    @parameterized.expand([("poll", SHUTTING_DOWN), ("preempt_callback", SHUTTING_DOWN),
                           ("rate text:rinsed", f"{SHUTTING_DOWN}: rinsed")])
    def test_goals_of_two_servers_are_asked_to_stop(self, script, text):
        self.start(script)
        clients = self.connect("first"), self.connect("second")
        goals = [self.send_active(client, 3) for client in clients]
        self.ctrl_c()
        for client, goal in zip(clients, goals):
            self.expect(client, goal, ABORTED, text, 3)

    @parameterized.expand(["work", "block work"])
    def test_goals_that_do_not_stop_are_aborted_side_by_side(self, script):
        self.start(script)
        clients = self.connect("first"), self.connect("second")
        goals = [self.send_active(client) for client in clients]
        self.ctrl_c()
        for client, goal in zip(clients, goals):
            self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        first, second = [client.times[goal, "result"] for client, goal in zip(clients, goals)]
        self.assertTrue(0.5 < second - first < 1.6, "shutdown_timeout of first is 1 s, of second 2 s")
        self.program.wait(10)

    def test_goal_that_a_client_had_cancelled_is_preempted(self):
        client, goal = self.start_goal("hook")
        client.cancel(goal)
        client.wait(lambda: PREEMPTING in client.states[goal], "a goal that should stop")
        self.ctrl_c()
        self.expect(client, goal, PREEMPTED, "cancelled", 1)

    def test_lock_that_is_held_until_a_hook_delays_no_hook(self):
        client, goal = self.start_goal("lock")
        self.ctrl_c()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)

    @parameterized.expand([("raise", True), ("return", False)])
    def test_log_of_an_execute_cb_without_an_outcome(self, how, is_logged):
        client, goal = self.start_goal(f"rate {how}")
        self.ctrl_c()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.program.wait()
        self.assertEqual(is_logged, "execute_cb" in self.program.stderr, self.program)

    # Goals that do not run

    def test_goal_that_waits_is_recalled_at_once(self):
        client, first = self.start_goal("work")
        waiting = client.send(1)
        client.wait(lambda: waiting in client.states, "a goal that waits")
        self.ctrl_c()
        self.expect(client, waiting, RECALLED, SHUTTING_DOWN)
        self.assertNotIn(first, client.results)

    def test_goals_that_come_are_recalled_and_the_hook_of_3_s_ends(self):
        client, goal = self.start_goal("rate", "3")
        self.ctrl_c()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)
        for _ in range(2):  # the server may not be done with its shutdown when the first one comes
            self.expect(client, client.send(1), RECALLED, SHUTTING_DOWN)
        self.assertNotIn("hook ended", self.program.stdout)
        self.program.wait()
        self.assertIn("hook ended", self.program.stdout, self.program)

    def test_goal_that_is_over_is_not_asked_to_stop(self):
        self.start("")
        client = self.connect()
        self.expect(client, client.send(1), PREEMPTED, "preempted by the server", 1)
        self.ctrl_c()
        self.program.expect("hook ended, preempt requested: False")
        self.program.wait()
        self.assertNotIn("preempt callback", self.program.stdout)

    def test_goal_that_the_goal_callback_rejected_is_left_alone(self):
        self.start("reject")
        client = self.connect("second")
        self.expect(client, client.send(1), GoalStatus.REJECTED, "the server refused the goal")
        self.ctrl_c()
        self.program.wait()
        self.assertNotIn("ERROR", self.program.stderr, self.program)


class TestClient(ScriptedCase):

    library = robust

    def start(self, words, how="cancels"):
        """Start shutdown_client, and wait until its goal is active."""
        program = self.programs.start(*PROGRAM, "shutdown_client", words, how)
        program.expect("active")
        return program

    def test_cancel_waits_for_the_outcome(self):
        program = self.start("ACTIVE cancel 1.5 result:PREEMPTED")
        program.signal(signal.SIGINT)
        program.expect("^True PREEMPTED goal PREEMPTED: cancelled")
        self.assertEqual(0, program.wait(), program)

    def test_goal_of_a_frozen_server_is_lost_after_2_s(self):
        program = self.start("ACTIVE")
        self.server.signal(signal.SIGSTOP)
        self.addCleanup(self.server.signal, signal.SIGCONT)
        begun = time.monotonic()
        program.signal(signal.SIGINT)
        program.expect("LOST goal LOST: a cancel was sent on shutdown, and no outcome came within 2 s")
        self.assertGreater(time.monotonic() - begun, 1.5)
        program.wait(10)

    def test_goal_of_another_client_is_not_cancelled(self):
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        program = self.start("ACTIVE cancel result:PREEMPTED")
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED")
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual("by script", self.client.get_goal_status_text(), "not cancelled")

    def test_loop_over_goals_sends_no_goal_during_the_shutdown(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "patrols")
        program.signal(signal.SIGINT)
        program.wait()
        self.eventually(lambda: self.results, "the result")
        self.assertEqual(1, len(self.goals))

    def test_by_default_the_goal_goes_on(self):
        program = self.start("ACTIVE go result:SUCCEEDED", "default")
        program.signal(signal.SIGINT)
        program.expect("^False ACTIVE")
        program.wait()
        self.go()
        self.eventually(lambda: self.results, "a result")
        self.assertEqual("by script", self.results[0].status.text, "not cancelled")

    def test_shutdown_from_done_cb_neither_waits_nor_cancels(self):
        program = self.start("ACTIVE go result:SUCCEEDED", "signals_shutdown")
        self.go()
        program.expect("done_cb")
        begun = time.monotonic()
        self.assertEqual(0, program.wait(), program)
        self.assertLess(time.monotonic() - begun, 1.7, "the outcome would be awaited for 2 s")
        self.assertEqual([], self.cancels)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_shutdown", "robust_shutdown_test")
