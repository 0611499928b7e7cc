#!/usr/bin/env python3
"""What robust does with goals when a program is told to end: servers end them, clients may cancel theirs.

The servers are those of shutdown_server.py, which says what the scripts of their goals mean.
"""
import contextlib
import os
import signal
import subprocess
import sys
import time
import unittest
import xmlrpc.client

from parameterized import parameterized
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

SHUTTING_DOWN = "the server is shutting down"
SERVER = os.path.join(os.path.dirname(os.path.realpath(__file__)), "shutdown_server.py")


class TestServer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test")

    def setUp(self):
        self.namespace, self.programs = "/" + self.id().split(".")[-1], Programs()
        self.addCleanup(self.programs.stop)

    def start(self, script, hook=0):
        """Start shutdown_server.py with these arguments."""
        self.program = self.programs.start(
            sys.executable, SERVER, script, str(hook), stdin=subprocess.PIPE, ROS_NAMESPACE=self.namespace)
        self.program.expect("ready")

    def connect(self, name="first"):
        """Returns a client of one of the two servers."""
        client = RawClient(self.namespace + "/" + name)
        self.addCleanup(client.close)
        return client.wait_connected(self.program)

    def send_active(self, client, minutes=1):
        goal = client.send(minutes)
        client.wait(lambda: ACTIVE in client.states.get(goal, []), "an active goal")
        return goal

    def start_goal(self, script, hook=0):
        """Start shutdown_server.py with these arguments and a goal of first. Returns the client and the goal."""
        self.start(script, hook)
        client = self.connect()
        return client, self.send_active(client)

    def expect(self, client, goal, state, text, count=0):
        """Wait for the result of a goal. Expect one, with count bowls."""
        client.wait(lambda: client.results.get(goal), "a result of %s" % goal)
        self.assertEqual([(state, text, bowls(count))], [
            (one.status.status, one.status.text, one.result.dishes_washed) for one in client.results[goal]], client)

    # What ends a program

    def sigint(self):
        self.program.signal(signal.SIGINT)

    def rosnode_kill(self):
        uri = rosgraph.Master(rospy.get_name()).lookupNode(self.namespace + "/shutdown_server")
        with contextlib.suppress(OSError):  # the node may end before it answers
            xmlrpc.client.ServerProxy(uri).shutdown(rospy.get_name(), "rosnode kill")

    def end_main_thread(self):
        self.program.type("end_main_thread\n")

    def signal_shutdown(self):
        self.program.type("signal_shutdown\n")

    @parameterized.expand(["sigint", "rosnode_kill", "end_main_thread", "signal_shutdown"])
    def test_end_of_the_program_aborts_the_goal(self, end):
        client, goal = self.start_goal("wait")
        getattr(self, end)()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)
        self.program.wait()
        self.assertNotIn("ABORTED", self.program.stdout + self.program.stderr, "no line about goals during a shutdown")

    @parameterized.expand(["work", "no_threads work"])
    def test_waiting_goal_is_recalled_at_once(self, script):
        client, first = self.start_goal(script)
        waiting = client.send(1)
        client.wait(lambda: waiting in client.states, "a goal that waits")
        self.sigint()
        self.expect(client, waiting, RECALLED, SHUTTING_DOWN)
        self.assertNotIn(first, client.results)
        self.expect(client, first, ABORTED, SHUTTING_DOWN)

    def test_second_node_of_the_name_aborts_the_goal_and_lives(self):
        client, goal = self.start_goal("wait")
        first = self.program
        self.start("wait")
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)
        first.wait()
        goal = self.send_active(client.wait_connected(self.program))
        self.assertTrue(self.program.running())
        client.cancel(goal)
        self.expect(client, goal, PREEMPTED, "cancelled", 1)

    # What a goal does meanwhile

    @parameterized.expand([
        ("wait", SHUTTING_DOWN, 3),
        ("poll", SHUTTING_DOWN, 3),
        ("preempt_callback", SHUTTING_DOWN, 3),
        ("wait text:rinsed", SHUTTING_DOWN + ": rinsed", 3),
        ("work", SHUTTING_DOWN, 0),
        ("block work", SHUTTING_DOWN, 0)])
    def test_goals_of_two_servers_are_aborted_side_by_side(self, script, text, count):
        self.start(script)
        clients = self.connect("first"), self.connect("second")
        goals = [self.send_active(client, 3) for client in clients]
        begun = time.monotonic()
        self.sigint()
        for client, goal in zip(clients, goals):
            self.expect(client, goal, ABORTED, text, count)
        self.assertLess(time.monotonic() - begun, 2.9, "shutdown_timeout of one is 1 s, of the other 2 s")
        self.program.wait(10)

    def test_goal_that_does_not_stop_is_aborted_after_the_timeout(self):
        client, goal = self.start_goal("work", hook=2)
        begun = time.monotonic()
        self.sigint()
        client.wait(lambda: ABORTED in client.states[goal], "an aborted goal")
        self.assertGreater(time.monotonic() - begun, 0.9)
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.program.expect("preempt requested: True")

    def test_goal_that_a_client_had_cancelled_is_preempted(self):
        client, goal = self.start_goal("hook")
        client.cancel(goal)
        client.wait(lambda: PREEMPTING in client.states[goal], "a goal that should stop")
        self.sigint()
        self.expect(client, goal, PREEMPTED, "cancelled", 1)

    def test_execute_cb_that_raises_is_logged(self):
        client, goal = self.start_goal("wait raise")
        self.sigint()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.program.wait()
        self.assertIn("ValueError: out of soap", self.program.stderr, self.program)

    def test_goals_end_though_the_server_is_locked_for_good(self):
        client, goal = self.start_goal("wait lock work")
        waiting = client.send(1)  # a newer goal, so the other one goes on
        self.program.expect("locked")
        self.sigint()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN)
        self.expect(client, waiting, RECALLED, SHUTTING_DOWN)

    def test_server_that_was_stopped_during_a_goal_raises_nothing(self):
        self.start("stop_server work")
        self.connect().send(1)
        self.program.expect("stopped")
        self.sigint()
        self.program.wait(10)
        self.assertNotIn("Traceback", self.program.stderr, self.program)

    def test_result_of_20_mb_arrives(self):
        client, goal = self.start_goal("wait 20_MB")
        self.sigint()
        client.wait(lambda: client.results.get(goal), "a result", timeout=10)
        self.assertEqual(20000000, len(client.results[goal][0].result.dishes_washed[0]))

    # Before a goal and after it

    def test_goal_that_is_over_is_not_asked_to_stop(self):
        self.start("")
        client = self.connect()
        self.expect(client, client.send(1), PREEMPTED, "preempted by the server", 1)
        self.sigint()
        self.program.wait()
        self.assertIn("preempt requested: False", self.program.stdout)
        self.assertNotIn("preempt callback", self.program.stdout)

    def test_hook_of_3_s_ends_and_delays_no_outcome(self):
        client, goal = self.start_goal("wait", hook=3)
        self.sigint()
        self.expect(client, goal, ABORTED, SHUTTING_DOWN, 1)
        self.expect(client, client.send(1), RECALLED, SHUTTING_DOWN)  # it arrives during the shutdown
        self.assertNotIn("hook ended", self.program.stdout)
        self.program.wait()
        self.assertIn("hook ended", self.program.stdout, self.program)

    def test_goals_that_come_meanwhile_raise_nothing(self):
        self.start("wait")
        client = self.connect()
        self.sigint()
        while self.program.running():
            client.send(1)
            time.sleep(0.002)
        self.program.wait()
        self.assertNotIn("bad callback", self.program.stderr, self.program)

    def test_status_that_is_due_when_the_topics_close_raises_nothing(self):
        rospy.set_param(self.namespace + "/actionlib_status_frequency", 50)
        program = self.programs.program("servers_and_clients", ROS_NAMESPACE=self.namespace)
        program.expect("ready")
        program.signal(signal.SIGINT)
        program.wait()
        self.assertNotIn("Traceback", program.stderr, program)

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


class TestClient(ScriptedCase):

    library = robust

    def start(self, *arguments):
        """Start shutdown_client of programs.py with these arguments, and wait until its goal is active."""
        program = self.programs.program("shutdown_client", *arguments)
        program.expect("active")
        return program

    @parameterized.expand([
        ("at_once", "ACTIVE cancel result:PREEMPTED", "cancels", False),
        ("after_1_5_s", "ACTIVE cancel 1.5 result:PREEMPTED", "cancels", False),
        ("beside_stopped_clients", "ACTIVE cancel result:PREEMPTED", "stops_another", False),
        ("beside_clients_that_raise", "ACTIVE cancel result:PREEMPTED", "breaks_another", True)])
    def test_cancel_waits_for_the_outcome(self, _, words, how, is_logged):
        program = self.start(words, how)
        program.signal(signal.SIGINT)
        program.expect("^True PREEMPTED goal PREEMPTED: cancelled")
        program.wait()
        self.assertEqual(is_logged, "Traceback" in program.stdout + program.stderr, program)

    def test_cancel_of_a_frozen_servers_goal_is_lost(self):
        program = self.start("ACTIVE", "cancels")
        self.server.signal(signal.SIGSTOP)
        self.addCleanup(self.server.signal, signal.SIGCONT)
        begun = time.monotonic()
        program.signal(signal.SIGINT)
        program.expect("^(True|False) LOST goal LOST: a cancel was sent")
        self.assertGreater(time.monotonic() - begun, 0.9)
        program.wait(10)

    def test_no_goal_of_another_client_is_cancelled(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "cancels")
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED", 5)
        self.wait_state(ACTIVE)
        program.signal(signal.SIGINT)
        program.expect("PREEMPTED")
        self.go()
        self.expect(SUCCEEDED, 5)
        self.assertEqual("by script", self.client.get_goal_status_text(), "not cancelled")

    def test_by_default_the_goal_goes_on(self):
        program = self.start("ACTIVE go result:SUCCEEDED", "default")
        program.signal(signal.SIGINT)
        program.expect("^False ACTIVE")
        program.wait()
        self.go()
        self.eventually(lambda: self.results, "a result")
        self.assertEqual("by script", self.results[0].status.text, "not cancelled")

    def test_hook_of_3_s_ends_and_delays_no_cancel(self):
        program = self.start("ACTIVE cancel result:PREEMPTED", "cancels", "3")
        program.signal(signal.SIGINT)
        self.eventually(lambda: self.results, "a cancel, and the result after it")
        self.assertNotIn("hook ended", program.stdout)
        program.wait()
        self.assertIn("hook ended", program.stdout, program)

    def test_shutdown_from_done_cb_waits_for_nothing(self):
        program = self.start("ACTIVE go result:SUCCEEDED", "signals_shutdown")
        self.go()
        program.expect("done_cb")
        begun = time.monotonic()
        self.assertEqual(0, program.wait(), program)
        self.assertLess(time.monotonic() - begun, 1.7, "the outcome would be awaited for 2 s")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_shutdown", "robust_shutdown_test")
