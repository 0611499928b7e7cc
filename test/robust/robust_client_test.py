#!/usr/bin/env python3
"""robust.SimpleActionClient: one test for each thing that it does other than actionlib's.

The server is support/scripted_server.py. Each goal is a script of what it does: `ACTIVE go result:SUCCEEDED`.
"""
import ctypes
import gc
import math
import os
import signal
import subprocess
import sys
import threading
import time
from unittest import mock
import weakref

import actionlib
from actionlib import CommState
from actionlib.msg import TestRequestAction, TestRequestActionGoal, TestRequestActionResult
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from parameterized import parameterized
import rospy
import rostest
from std_msgs.msg import Header

from actions_tutorial import robust

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import Master, run
from support.scripted import ScriptedCase, script
from support.states import ABORTED, ACTIVE, PENDING, PREEMPTED, PREEMPTING, SUCCEEDED

LOST = GoalStatus.LOST


class TestRobustClient(ScriptedCase):

    library = robust

    def setUp(self):
        super().setUp()
        self.connect()

    # Send

    def test_goal_message_may_be_changed_and_sent_again(self):
        goal = script("result:SUCCEEDED", 1)
        self.client.send_goal(goal)
        goal.the_result = 2
        self.expect(SUCCEEDED, 1)
        self.client.send_goal(goal)
        self.expect(SUCCEEDED, 2)

    @parameterized.expand([("action_goal", TestRequestActionGoal(), ".*ActionGoal"), ("str", "wash", "str")])
    def test_goal_of_another_type_raises_and_changes_nothing(self, _, wrong, kind):
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        with self.assertRaisesRegex(TypeError, "must be of type actionlib/TestRequestGoal, not " + kind):
            self.client.send_goal(wrong)
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([(SUCCEEDED, 0)], 1), (self.done, len(self.goals)))

    def test_send_goal_after_stop_raises_and_leaves_no_goal(self):
        client = robust.SimpleActionClient("nobody", TestRequestAction)
        client.action_client.stop()
        self.assertRaises(rospy.ROSException, client.send_goal, script(""))
        self.assertIsNone(client.gh)
        self.assertFalse(client.wait_for_result(1))

    # The goal handle

    def test_gh_shows_the_raw_status_and_get_state_folds_it(self):
        self.send("ACTIVE cancel PREEMPTING go silent unlisted feedback go result:PREEMPTED", 4)
        self.wait_state(ACTIVE)
        handle = self.client.gh
        self.assertEqual(CommState.ACTIVE, handle.get_comm_state())
        handle.cancel()
        self.eventually(lambda: handle.get_comm_state() == CommState.PREEMPTING, "PREEMPTING")
        self.go()
        self.eventually(lambda: self.feedback, "feedback, which says ACTIVE")
        self.assertEqual((ACTIVE, PREEMPTING, CommState.PREEMPTING, None), (
            self.client.get_state(), handle.get_goal_status(), handle.get_comm_state(), handle.get_result()))
        self.go()
        self.expect(PREEMPTED, 4)
        self.assertEqual((PREEMPTED, PREEMPTED, "cancelled", 4, CommState.DONE), (
            handle.get_goal_status(), handle.get_terminal_state(), handle.get_goal_status_text(),
            handle.get_result().the_result, handle.get_comm_state()))

    @parameterized.expand([("stop_tracking_goal", lambda client: client.stop_tracking_goal()),
                           ("gh_set_to_none", lambda client: setattr(client, "gh", None))])
    def test_goal_that_is_no_longer_tracked_goes_on(self, _, stop_tracking):
        self.send("ACTIVE go feedback 0.2 result:ABORTED", 1)
        self.wait_state(ACTIVE)
        kept = self.client.gh
        stop_tracking(self.client)
        self.go()
        self.eventually(kept.get_result, "a result, in the handle that was kept")
        self.assertFalse(self.client.wait_for_result())
        self.assertEqual((None, LOST, None), (self.client.gh, self.client.get_state(), self.client.get_result()))
        self.client.gh = kept
        self.expect(ABORTED, 1)
        self.assertEqual(([], [], []), (self.done, self.feedback, self.cancels))

    @parameterized.expand(["is_not_none", "true"])
    def test_stop_handler_stops_both_arms_whose_gh(self, kind):
        program = self.programs.program("two_arms", kind)
        program.expect("both move")
        program.signal(signal.SIGINT)
        program.expect(r"^\[2, 2\]")

    def test_simple_state_is_done_after_done_cb_stopped_tracking(self):
        self.send("ACTIVE result:SUCCEEDED", done_cb=lambda *_: self.client.stop_tracking_goal())
        self.eventually(lambda: self.client.simple_state == actionlib.SimpleGoalState.DONE, "DONE")

    # State, result and callbacks

    def test_state_result_and_callbacks_agree(self):
        self.send("PENDING go ACTIVE go SUCCEEDED 0.2 result:SUCCEEDED", 4, done_cb=lambda *args: self.done.append(
            (*args, self.client.get_state(), self.client.get_result())))
        self.eventually(lambda: self.client.gh.get_comm_state() == CommState.PENDING, "a status")
        self.assertEqual((PENDING, []), (self.client.get_state(), self.active))
        self.go()
        self.wait_state(ACTIVE)
        self.go()
        self.expect(SUCCEEDED, 4)
        result = self.client.get_result()
        self.assertEqual(([True], [(SUCCEEDED, result, SUCCEEDED, result)]), (self.active, self.done))
        self.assertEqual("by script", self.client.get_goal_status_text())

    @parameterized.expand([("SUCCEEDED", 1), ("ABORTED", 1), ("PREEMPTED", 1), ("RECALLED", 0), ("REJECTED", 0)])
    def test_result_without_any_status_ends_the_goal(self, state, accepted):
        self.send("silent result:" + state, 6)
        self.expect(getattr(GoalStatus, state), 6)
        self.assertEqual((1, accepted), (len(self.done), len(self.active)))

    def test_status_after_the_result_changes_nothing(self):
        self.send("ACTIVE result:SUCCEEDED 0.1 PREEMPTING unlisted feedback", 7)
        self.eventually(lambda: self.feedback, "the last word of the script")
        self.expect(SUCCEEDED, 7)
        self.assertEqual([(SUCCEEDED, 7)], self.done)
        self.assertEqual((SUCCEEDED, CommState.DONE), (
            self.client.gh.get_terminal_state(), self.client.gh.get_comm_state()))

    def test_done_cb_sends_the_next_goal_and_waits_for_it(self):
        def again(*_):
            self.send("result:SUCCEEDED", 2)
            self.done.append(self.client.wait_for_result(30))

        self.send("result:ABORTED", 1, done_cb=again)
        self.eventually(lambda: len(self.done) == 2, "both done_cb")
        self.assertEqual([(SUCCEEDED, 2), True], self.done)
        self.expect(SUCCEEDED, 2)

    @parameterized.expand([("heartbeat_timeout", 30), ("cancel_on_shutdown", True)])
    def test_goal_that_no_thread_can_guard_is_not_sent(self, option, value):
        self.connect(**{option: value})
        self.send("ACTIVE go result:SUCCEEDED", 3)
        self.wait_state(ACTIVE)
        self.addCleanup(threading.stack_size, threading.stack_size(1 << 46))  # no computer has that memory
        self.assertRaises(RuntimeError, self.client.send_goal, script("result:ABORTED"))
        self.go()
        self.expect(SUCCEEDED, 3)
        self.assertEqual(([(SUCCEEDED, 3)], 1), (self.done, len(self.goals)), "done_cb needs no thread of its own")

    def test_send_goal_at_exit_raises_nothing_without_a_thread(self):
        program = self.programs.program("goal_at_exit_without_threads")
        program.expect("sent")
        self.assertEqual(0, program.wait(), program)

    # Waits

    def test_stop_tracking_goal_ends_a_wait(self):
        self.send("ACTIVE")
        threading.Timer(0.3, self.client.stop_tracking_goal).start()
        begun = time.monotonic()
        self.assertFalse(self.client.wait_for_result(30))
        self.assertLess(time.monotonic() - begun, 5)

    @parameterized.expand([
        ("int", 1, 1), ("float", 0.5, 0.5), ("duration", rospy.Duration(0.5), 0.5), ("negative", -1, 0),
        ("negative_duration", rospy.Duration(-1), 0), ("minus_infinity", -math.inf, 0)])
    def test_wait_for_result_ends_after_its_timeout(self, _, timeout, seconds):
        self.send("ACTIVE")
        begun = time.monotonic()
        self.assertFalse(self.client.wait_for_result(timeout))
        self.assertTrue(seconds - 0.05 < time.monotonic() - begun < seconds + 2)

    @parameterized.expand([("zero", 0), ("empty_duration", rospy.Duration()), ("infinity", math.inf)])
    def test_timeout_that_is_no_limit(self, _, timeout):
        self.assertTrue(self.client.wait_for_server(timeout))
        goal = script("ACTIVE 0.3 result:SUCCEEDED")
        self.assertEqual(SUCCEEDED, self.client.send_goal_and_wait(goal, timeout, timeout))
        self.assertTrue(self.client.wait_for_result(timeout))

    @parameterized.expand([("nan", math.nan, ValueError), ("none", None, TypeError), ("str", "1", TypeError)])
    def test_timeout_that_is_no_number_raises_and_sends_nothing(self, _, wrong, error):
        self.assertRaises(error, self.client.wait_for_server, wrong)
        self.assertRaises(error, self.client.send_goal_and_wait, script(""), wrong)
        self.assertRaises(error, self.client.send_goal_and_wait, script(""), 1, wrong)
        self.send("result:SUCCEEDED")
        self.assertRaises(error, self.client.wait_for_result, wrong)
        self.expect(SUCCEEDED)
        self.eventually(lambda: self.goals, "the goal")
        self.assertEqual(1, len(self.goals))

    def test_wait_for_result_without_a_goal_is_false_and_logged(self):
        self.assertIsNone(self.client.gh)
        self.assertFalse(self.client.wait_for_result())
        self.wait_log("wait_for_result")

    @parameterized.expand([
        ("in_time", "result:SUCCEEDED", rospy.Duration(30), rospy.Duration(30), SUCCEEDED, 0),
        ("execute_timeout", "ACTIVE cancel result:PREEMPTED", 0.3, 30, PREEMPTED, 1),
        ("execute_timeout_duration", "ACTIVE cancel result:PREEMPTED", rospy.Duration(0.3), 30, PREEMPTED, 1),
        ("preempt_timeout", "ACTIVE", 0.3, 0.3, ACTIVE, 1),
        ("negative_preempt_timeout", "ACTIVE", 0.3, -1, ACTIVE, 1)])
    def test_send_goal_and_wait(self, _, words, execute_timeout, preempt_timeout, state, cancels):
        self.assertEqual(state, self.client.send_goal_and_wait(script(words), execute_timeout, preempt_timeout))
        self.eventually(lambda: len(self.cancels) == cancels, "%d cancels" % cancels)

    def test_wait_for_server_before_init_node_raises(self):
        output = run(sys.executable, "-c", """if True:
            from actions_tutorial import msg, robust
            import rospy
            try:
                robust.SimpleActionClient("scripted", msg.WashTheDishesAction).wait_for_server(1)
            except rospy.ROSInitException:
                print("raised")""")
        self.assertEqual("raised\n", output)

    def test_wait_for_server_settles_once_for_each_connection(self):
        def wait():
            begun = time.monotonic()
            self.assertTrue(client.wait_for_server(30))
            return time.monotonic() - begun

        client = robust.SimpleActionClient("settles/scripted", TestRequestAction)
        for _ in range(2):
            server = self.programs.scripted_server(ROS_NAMESPACE="/settles")
            # Another client, with the same connections, waits until they are there.
            self.assertTrue(robust.SimpleActionClient("settles/scripted", TestRequestAction).wait_for_server(30))
            self.assertGreater(wait(), 0.19)
            self.assertLess(wait(), 0.19)
            server.stop()

    def test_status_of_a_node_that_serves_nothing_delays_no_wait(self):
        self.send("silent result:SUCCEEDED")
        self.expect(SUCCEEDED)
        publisher = rospy.Publisher("scripted/status", GoalStatusArray, queue_size=1)
        self.addCleanup(publisher.unregister)
        self.eventually(lambda: publisher.publish(header=Header(frame_id="here")) or (
            self.client.action_client.last_status_msg.header.frame_id == "here"), "a status from here")
        self.assertTrue(self.client.wait_for_server(0.1))

    def test_wait_for_server_ends_in_time_though_the_master_hangs(self):
        with Master() as master:
            program = master.start(sys.executable, "-c", """if True:
                from actions_tutorial import msg, robust
                import rospy
                import time
                rospy.init_node("waits")
                client = robust.SimpleActionClient("nobody", msg.WashTheDishesAction)
                print("ready", flush=True)
                input()
                begun = time.monotonic()
                print(client.wait_for_server(7), time.monotonic() - begun, flush=True)""", stdin=subprocess.PIPE)
            program.expect("ready")
            master.processes[0].signal(signal.SIGSTOP)
            program.type("go\n")
            program.expect(r"^False 7\.", timeout=20)

    def test_shutdown_while_connections_settle_is_false(self):
        program = self.programs.program("shutdown_while_connections_settle")
        program.expect("^False interrupted while waiting for the server of /scripted")
        program.wait()

    # A goal that is guarded

    @parameterized.expand([("heartbeat_timeout", 1, "ACTIVE silent", LOST),
                           ("cancel_on_shutdown", True, "ACTIVE go result:SUCCEEDED", SUCCEEDED)])
    def test_client_that_nobody_holds_is_kept_for_its_goal(self, option, value, words, state):
        self.connect(**{option: value})
        self.send(words)
        self.wait_state(ACTIVE)
        client = weakref.ref(self.client)
        del self.client
        gc.collect()
        self.assertTrue(client())
        self.go()
        self.wait_freed(client)
        self.assertEqual(state, self.done[0][0])

    def test_client_is_freed_when_its_goal_is_not_tracked_any_more(self):
        self.connect(heartbeat_timeout=30, cancel_on_shutdown=True)
        self.send("ACTIVE")
        self.client.stop_tracking_goal()
        client = weakref.ref(self.client)
        del self.client
        self.wait_freed(client)

    def test_goal_that_was_replaced_is_not_cancelled_for_its_silence(self):
        self.connect(heartbeat_timeout=1)
        self.send("go")  # no status lists it
        self.send("ACTIVE 2.5 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.assertEqual([], self.cancels)

    @parameterized.expand([("at_the_end", "cancels", "LOST goal LOST: the server no longer knows the goal"),
                           ("in_done_cb", "signals_shutdown", "done_cb")])
    def test_lost_goal_is_cancelled_on_shutdown(self, _, how, line):
        program = self.programs.program("shutdown_client", "ACTIVE unlisted cancel result:PREEMPTED", how)
        program.expect(line)
        begun = time.monotonic()
        self.assertEqual(0, program.wait(), program)
        self.assertLess(time.monotonic() - begun, 1.7, "an outcome would be awaited for 2 s")
        self.eventually(lambda: self.results, "a cancel, and the result after it")

    # A lost server

    @parameterized.expand([
        ("silence", "ACTIVE silent", r"^server lost: silent for [12]\.\d s \(heartbeat_timeout is 1 s\)$"),
        ("silence_before_it_was_listed", "silent", "^server lost: silent for "),
        ("silence_before_the_result", "ACTIVE SUCCEEDED 0.2 unlisted silent", "^server lost: silent for "),
        ("status_of_other_goals", "others 0.2 " * 10, "^the server did not list the goal, nor send feedback, for 1")])
    def test_goal_is_lost_and_cancelled_for(self, _, words, text):
        self.connect(heartbeat_timeout=1)
        self.send(words)
        self.expect(LOST)
        self.assertRegex(self.client.get_goal_status_text(), text)
        self.assertEqual([(LOST, None)], self.done)
        self.eventually(lambda: self.cancels, "a cancel, in case the server is only asleep")
        self.assertEqual([self.goals[0].goal_id.id], [one.id for one in self.cancels])

    @parameterized.expand([
        ("feedback_and_status", 1.5, "ACTIVE silent 1 feedback 1 ACTIVE 1 feedback 1 result:SUCCEEDED"),
        ("status_before_the_result", 1, "ACTIVE SUCCEEDED 0.2 unlisted 2.5 result:SUCCEEDED"),
        ("status_without_heartbeat_timeout", None, "ACTIVE SUCCEEDED 0.2 unlisted 2.5 result:SUCCEEDED"),
        ("status_that_lists_it_again", None,
         "ACTIVE others unlisted 0.2 ACTIVE 1.5 unlisted 0.2 ACTIVE 0.1 result:SUCCEEDED")])
    def test_sign_of_life(self, _, heartbeat_timeout, words):
        self.connect(heartbeat_timeout=heartbeat_timeout)
        self.send(words)
        self.expect(SUCCEEDED)
        self.assertEqual([], self.cancels)

    def test_time_for_which_the_client_stood_still_is_no_silence(self):
        self.connect(heartbeat_timeout=2)
        self.send("ACTIVE silent go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        for _ in range(2):
            ctypes.PyDLL(None).usleep(1500000)  # keeps the interpreter's lock, so no other thread runs
            time.sleep(0.1)
        self.go()
        self.expect(SUCCEEDED)

    def test_silence_after_stop_is_lost(self):
        self.connect(heartbeat_timeout=1)
        self.send("ACTIVE")
        self.wait_state(ACTIVE)
        self.client.action_client.stop()  # no cancel can be sent any more
        self.expect(LOST)

    def test_lost_goal_that_is_listed_again_stays_lost(self):
        self.connect(heartbeat_timeout=1)
        self.send("silent cancel go ACTIVE feedback")
        self.expect(LOST)
        self.go()
        self.eventually(lambda: self.feedback, "the last word of the script")
        self.assertEqual(([(LOST, None)], []), (self.done, self.active))

    def test_goal_after_a_lost_one_has_its_own_time(self):
        self.connect(heartbeat_timeout=2)
        self.send("silent")
        self.expect(LOST)
        self.send("silent 1 result:SUCCEEDED")
        self.expect(SUCCEEDED)

    @parameterized.expand([("zero", 0), ("negative", -1), ("nan", math.nan)])
    def test_heartbeat_timeout_not_above_0_is_a_value_error(self, _, wrong):
        self.assertRaises(ValueError, self.connect, heartbeat_timeout=wrong)

    @mock.patch.object(robust, "CANCELLED_UNLISTED_FOR", 1.0)
    def test_goal_never_listed_stays_pending_unless_cancelled(self):
        self.send("go result:SUCCEEDED")
        self.client.cancel_all_goals()  # also of other clients
        self.assertFalse(self.client.wait_for_result(1.5))
        self.assertEqual((PENDING, [], 1), (self.client.get_state(), self.cancels, len(self.goals)))
        self.go()
        self.expect(SUCCEEDED)

    @mock.patch.object(robust, "CANCELLED_UNLISTED_FOR", 2.0)
    def test_goal_never_listed_is_lost_some_time_after_first_cancel(self):
        self.send("cancel")
        begun = time.monotonic()
        self.client.cancel_goal()
        self.assertFalse(self.client.wait_for_result(1))
        self.client.cancel_goal()
        self.expect(LOST)
        self.assertTrue(2 <= time.monotonic() - begun < 2.9)
        self.assertEqual("cancelled, and the server does not list the goal", self.client.get_goal_status_text())

    # get_failure

    @parameterized.expand([
        ("success", "result:SUCCEEDED", None),
        ("text_of_two_lines", "text:no_soap result:PREEMPTED", "goal PREEMPTED: no soap"),
        ("no_text", "text: result:ABORTED", "goal ABORTED: the server gave no reason"),
        ("lost_goal", "ACTIVE 0.2 unlisted", "goal LOST: the server no longer knows the goal")])
    def test_get_failure_of(self, _, words, failure):
        self.send(words)
        self.assertTrue(self.client.wait_for_result(30))
        self.assertEqual(failure, self.client.get_failure())

    def test_get_failure_is_of_what_came_last(self):
        def wait_in_vain():
            self.assertFalse(client.wait_for_server(0.1))
            self.assertEqual("no server of /late within 0.1 s", client.get_failure())

        client = robust.SimpleActionClient("late", TestRequestAction)
        publisher = rospy.Publisher("late/result", TestRequestActionResult, queue_size=10)
        self.addCleanup(publisher.unregister)
        self.assertEqual("no goal was sent, or it is no longer tracked", client.get_failure())
        wait_in_vain()
        client.send_goal(script(""))
        self.assertEqual("goal PENDING: no outcome so far", client.get_failure())
        wait_in_vain()
        status = GoalStatus(client.gh.comm_state_machine.action_goal.goal_id, SUCCEEDED, "")
        self.eventually(lambda: publisher.publish(status=status) or client.wait_for_result(0.1), "a result")
        self.assertIsNone(client.get_failure())
        wait_in_vain()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_client", TestRobustClient)
