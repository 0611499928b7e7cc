#!/usr/bin/env python3
"""What robust does with goals when a program is told to end: servers end them, clients may cancel theirs.

The servers are programs/shutdown_server.py; ways_to_stop.py says what their goals do.
"""
import contextlib
import os
import signal
import subprocess
import sys
import time
import unittest
import xmlrpc.client

import rosgraph
import rospy
import rostest

from actions_tutorial import robust

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.printed import bowls
from support.processes import run
from support.raw_client import RawClient
from support.scripted import Programs, ScriptedCase
from support.states import ABORTED, ACTIVE, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED
from ways_to_stop import (
    BY_PREEMPT_CALLBACK, CALLBACK_BLOCKS, KEEPS_THE_LOCK, OF_ITS_OWN_ACCORD, ONLY_ON_SHUTDOWN, OWN_TEXT, POLLS,
    RAISES, RESULT_OF_20_MB, STOPS_ITS_SERVER, TEN_MORE_PERIODS, WORKS_ON)

SHUTTING_DOWN = "the server is shutting down"


class TestServer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")

    def setUp(self):
        self.namespace, self.programs = "/" + self.id().split(".")[-1], Programs()
        self.addCleanup(self.programs.stop)

    def start(self, *hook):
        self.program = self.programs.program("shutdown_server", *hook, stdin=subprocess.PIPE,
                                             ROS_NAMESPACE=self.namespace)
        self.program.expect("ready")

    def connect(self, name="first"):
        """Returns a client of one of the three servers."""
        client = RawClient(self.namespace + "/" + name)
        self.addCleanup(client.close)
        return client.wait_connected(self.program)

    def send_active(self, client, minutes):
        goal = client.send(minutes)
        client.wait(lambda: ACTIVE in client.states.get(goal, []), "an active goal")
        return goal

    def interrupt(self):
        self.program.signal(signal.SIGINT)

    def rosnode_kill(self):
        uri = rosgraph.Master(rospy.get_name()).lookupNode(self.namespace + "/shutdown_server")
        with contextlib.suppress(OSError):  # the node may end before it answers
            xmlrpc.client.ServerProxy(uri).shutdown(rospy.get_name(), "rosnode kill")

    def expect(self, client, goal, state, text, count=0):
        message = client.wait_result(goal)
        self.assertEqual((state, text, bowls(count)),
                         (message.status.status, message.status.text, message.result.dishes_washed), client)

    def check_aborted(self, end):
        self.start()
        client = self.connect()
        goal = self.send_active(client, 3)
        end()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 3)
        self.program.wait()
        self.assertNotIn("ABORTED", self.program.stdout + self.program.stderr, "no line about goals during a shutdown")

    def test_sigint_aborts_the_goal_with_its_result(self):
        self.check_aborted(self.interrupt)

    def test_rosnode_kill_aborts_the_goal_with_its_result(self):
        self.check_aborted(self.rosnode_kill)

    def test_end_of_main_thread_aborts_the_goal_with_its_result(self):
        self.check_aborted(lambda: self.program.type("return\n"))

    def test_signal_shutdown_aborts_the_goal_with_its_result(self):
        self.check_aborted(lambda: self.program.type("signal_shutdown\n"))

    def test_second_node_of_the_name_aborts_the_goal_and_lives(self):
        self.start()
        client, first = self.connect(), self.program
        goal = self.send_active(client, 3)
        self.start()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 3)
        first.wait()
        goal = self.send_active(client.wait_connected(self.program), 2)
        self.assertTrue(self.program.running())
        client.cancel(goal)
        self.expect(client, goal, PREEMPTED, "cancelled", 2)

    def test_is_preempt_requested_on_shutdown(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, POLLS)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)

    def test_is_preempt_requested_on_shutdown_only_during_a_goal(self):
        self.start()
        self.interrupt()
        self.program.wait()
        self.assertIn("preempt requested: False", self.program.stdout)

    def test_is_preempt_requested_after_the_timeout_of_the_shutdown(self):
        self.start("3")
        client = self.connect()
        goal = self.send_active(client, WORKS_ON)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.program.expect("preempt requested: True")

    def test_goal_that_a_client_had_cancelled_is_preempted(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, ONLY_ON_SHUTDOWN)
        client.cancel(goal)
        client.wait(lambda: PREEMPTING in client.states[goal], "a goal that should stop")
        self.interrupt()
        self.expect(client, goal, PREEMPTED, "cancelled")

    def test_own_text_is_appended(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, OWN_TEXT)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN + ": rinsed")

    def test_execute_cb_that_raises_on_shutdown_is_logged(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, RAISES)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.program.wait()
        self.assertIn("ValueError: out of soap", self.program.stderr, self.program)

    def test_thread_of_execute_cb_ends_and_can_be_joined(self):
        output = run(sys.executable, "-c", """if True:
            from actions_tutorial import msg, robust
            import rospy
            rospy.init_node("joins")
            server = robust.SimpleActionServer("joins", msg.WashTheDishesAction, print, auto_start=False)
            server.start()
            rospy.signal_shutdown("done")
            server.execute_thread.join()
            print("joined")""", timeout=30)
        self.assertIn("joined", output)

    def test_loop_that_goes_on_keeps_its_pace(self):
        self.start()
        client = self.connect("second")
        goal = self.send_active(client, TEN_MORE_PERIODS)
        begun = time.monotonic()
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.assertGreater(time.monotonic() - begun, 0.4)

    def test_goals_that_come_meanwhile_raise_nothing(self):
        self.start()
        client = self.connect()
        self.interrupt()
        while self.program.running():
            client.send(1)
            time.sleep(0.002)
        self.program.wait()
        self.assertNotIn("bad callback", self.program.stderr, self.program)

    def test_goal_that_does_not_stop_is_aborted_after_the_timeout(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, WORKS_ON)
        begun = time.monotonic()
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.assertGreater(time.monotonic() - begun, 0.9)
        self.program.wait(10)

    def test_goal_that_keeps_the_servers_lock_is_aborted(self):
        self.start()
        client = self.connect()
        goal = self.send_active(client, KEEPS_THE_LOCK)
        self.interrupt()
        client.wait(lambda: client.results.get(goal), "a result")
        self.assertEqual(ABORTED, client.results[goal][0].status.status)
        self.program.wait(10)

    def test_server_that_was_stopped_during_a_goal_raises_nothing(self):
        self.start()
        client = self.connect()
        client.send(STOPS_ITS_SERVER)
        self.program.expect("stopped")
        self.interrupt()
        self.program.wait(10)
        self.assertNotIn("Traceback", self.program.stderr, self.program)

    def test_goals_are_aborted_where_no_thread_can_be_started(self):
        self.start("no_threads")
        client = self.connect()
        first = self.send_active(client, WORKS_ON)
        waiting = client.send(1)
        client.wait(lambda: waiting in client.states, "a goal that waits")
        self.interrupt()
        self.expect(client, waiting, RECALLED, SHUTTING_DOWN)
        self.expect(client, first, ABORTED, SHUTTING_DOWN)

    def test_server_whose_len_is_0_ends_its_goal(self):
        self.start()
        client = self.connect("empty")
        goal = self.send_active(client, 3)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 3)

    def test_status_that_is_due_when_the_topics_close_raises_nothing(self):
        rospy.set_param(self.namespace + "/actionlib_status_frequency", 50)
        program = self.programs.program("servers_and_clients", ROS_NAMESPACE=self.namespace)
        program.expect("ready")
        program.signal(signal.SIGINT)
        program.wait()
        self.assertNotIn("Traceback", program.stderr, program)

    def test_signal_just_before_a_rate_waits_ends_its_sleep(self):
        for line in "with clock", "clock.wait":
            self.programs.program("interrupted_rate", line).expect("slept False", timeout=20)

    def test_result_of_20_mb_arrives(self):
        self.start()
        client = self.connect("second")
        goal = self.send_active(client, RESULT_OF_20_MB)
        self.interrupt()
        client.wait(lambda: client.results.get(goal), "a result", timeout=10)
        self.assertEqual(300000, len(client.results[goal][0].result.dishes_washed))

    def test_waiting_goal_is_recalled_at_once(self):
        self.start()
        client = self.connect("second")
        first = self.send_active(client, WORKS_ON)
        waiting = client.send(1)
        client.wait(lambda: waiting in client.states, "a goal that waits")
        self.interrupt()
        self.expect(client, waiting, RECALLED, SHUTTING_DOWN)
        self.assertNotIn(first, client.results, "RECALLED at once")
        self.expect(client, first, ABORTED, SHUTTING_DOWN)

    def test_goal_that_comes_after_the_timeout_is_recalled_at_once(self):
        self.start("5")
        client = self.connect()
        goal = self.send_active(client, WORKS_ON)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.expect(client, client.send(1), RECALLED, SHUTTING_DOWN)
        self.assertNotIn("hook ended", self.program.stdout)

    def test_two_servers_end_their_goals_at_once(self):
        self.start()
        client, other = self.connect(), self.connect("second")
        goals = self.send_active(client, WORKS_ON), self.send_active(other, WORKS_ON)
        begun = time.monotonic()
        self.interrupt()
        self.expect(client, goals[0], ABORTED, SHUTTING_DOWN)
        self.expect(other, goals[1], ABORTED, SHUTTING_DOWN)
        self.assertLess(time.monotonic() - begun, 2.9, "shutdown_timeout of one is 1 s, of the other 2 s")

    def test_goal_of_a_goal_callback_is_aborted_with_its_result(self):
        self.start()
        client = self.connect("callbacks")
        goal = self.send_active(client, 3)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 3)

    def test_preempt_callback_is_called(self):
        self.start()
        client = self.connect("callbacks")
        goal = self.send_active(client, BY_PREEMPT_CALLBACK)
        begun = time.monotonic()
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.assertLess(time.monotonic() - begun, 0.9, "shutdown_timeout is 1 s")

    def test_preempt_callback_without_a_goal_is_not_called(self):
        self.start()
        client = self.connect("callbacks")
        goal = self.send_active(client, OF_ITS_OWN_ACCORD)
        self.expect(client, goal, PREEMPTED, "preempted by the server")
        self.interrupt()
        self.program.wait()
        self.assertNotIn("preempt callback", self.program.stdout)

    def test_preempt_callback_that_blocks_delays_no_outcome(self):
        self.start()
        client = self.connect("callbacks")
        goal = self.send_active(client, CALLBACK_BLOCKS)
        self.interrupt()
        client.wait(lambda: client.results.get(goal), "a result", timeout=10)
        self.assertEqual(ABORTED, client.results[goal][0].status.status)
        self.program.wait(10)

    def test_hook_of_3_s_ends_and_delays_no_outcome(self):
        self.start("3")
        client = self.connect()
        goal = self.send_active(client, 3)
        self.interrupt()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 3)
        self.assertNotIn("hook ended", self.program.stdout)
        self.program.wait()
        self.assertIn("hook ended", self.program.stdout, self.program)


class TestClient(ScriptedCase):

    library = robust

    def start(self, words, *arguments):
        """Start programs/shutdown_client.py and wait until its goal is active."""
        program = self.programs.program("shutdown_client", words, *arguments)
        program.expect("active")
        return program

    def test_cancel_on_shutdown_waits_for_the_outcome(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "cancels")
        program.signal(signal.SIGINT)
        program.expect("^True PREEMPTED goal PREEMPTED: cancelled")
        program.wait()

    def test_cancel_on_shutdown_waits_for_a_server_that_is_slow(self):
        program = self.start("ACTIVE cancel 1.5 result:PREEMPTED", "cancels")
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED goal PREEMPTED: cancelled")
        program.wait()

    def test_client_that_is_stopped_keeps_no_other_from_its_cancel(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "stops_another")
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED goal PREEMPTED: cancelled")
        program.wait()
        self.assertNotIn("Traceback", program.stdout + program.stderr)

    def test_client_that_raises_keeps_no_other_from_its_cancel(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "breaks_another")
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED goal PREEMPTED: cancelled")
        program.wait()

    def test_shutdown_from_done_cb_waits_for_nothing(self):
        program = self.start("ACTIVE 0.2 result:SUCCEEDED", "signals_shutdown")
        program.expect("done_cb")
        begun = time.monotonic()
        self.assertEqual(0, program.wait(), program)
        self.assertLess(time.monotonic() - begun, 1.7, "the outcome would be awaited for 2 s")

    def test_cancel_on_shutdown_with_a_frozen_server_is_lost(self):
        program = self.start("ACTIVE", "cancels")
        self.server.signal(signal.SIGSTOP)
        self.addCleanup(self.server.signal, signal.SIGCONT)
        begun = time.monotonic()
        program.signal(signal.SIGINT)
        program.expect("^(True|False) LOST goal LOST: a cancel was sent")
        self.assertGreater(time.monotonic() - begun, 0.9)
        program.wait(10)

    def test_cancel_on_shutdown_cancels_its_own_goal_only(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "cancels")
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED", 5)
        self.wait_state(ACTIVE)
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED")
        self.go()
        self.expect(SUCCEEDED, 5)
        self.assertEqual("by script", self.client.get_goal_status_text(), "not cancelled")

    def test_hook_of_3_s_ends_and_delays_no_cancel(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "cancels", "3")
        program.signal(signal.SIGINT)
        self.eventually(lambda: self.results, "a cancel, and the result after it")
        self.assertNotIn("hook ended", program.stdout)
        program.wait()
        self.assertIn("hook ended", program.stdout, program)

    def test_by_default_the_goal_goes_on(self):
        program = self.start("ACTIVE 3 result:SUCCEEDED", "default")
        program.signal(signal.SIGINT)
        program.expect("^False ACTIVE")
        program.wait()
        self.eventually(lambda: self.results, "a result")
        self.assertEqual("by script", self.results[0].status.text, "not cancelled")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_shutdown", "robust_shutdown_test")
