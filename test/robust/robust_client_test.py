#!/usr/bin/env python3
"""robust.SimpleActionClient: one test for each thing that it does other than actionlib's.

The server is support/scripted_server.py. Each goal is a script of what it does: `ACTIVE go result:SUCCEEDED`.
ACTIONLIB=plain in the environment tries actionlib instead. The tests that doc/known_issues.md names fail then.
"""
import ctypes
import gc
import itertools
import os
import signal
import sys
import threading
import time
from unittest import mock
import weakref

import actionlib
from actionlib import CommState
from actionlib.msg import TestRequestAction, TestRequestActionGoal, TestRequestActionResult, TestRequestGoal
from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
from parameterized import parameterized
import rospy
import rostest

from support.processes import Group
from support.raw_client import RawClient
from support.scripted import SCRIPTED_SERVER, ScriptedCase, script
from support.states import ABORTED, ACTIVE, PENDING, PREEMPTED, SUCCEEDED

PROGRAM = sys.executable, "-m", "robust.client_programs"
LOST = GoalStatus.LOST
IS_PLAIN = os.environ.get("ACTIONLIB") == "plain"


class TestRobustClient(ScriptedCase):

    library = actionlib if IS_PLAIN else robust
    patience = 5 if IS_PLAIN else 30

    def setUp(self):
        super().setUp()
        self.connect()

    def while_sending(self, do):
        """Call do() once, in send_goal, after the goal was sent and before send_goal returns."""
        def publish(goal):
            manager.register_send_goal_fn(send)
            send(goal)
            do()

        manager, send = self.client.action_client.manager, self.client.action_client.pub_goal.publish
        manager.register_send_goal_fn(publish)

    def in_simulated_time(self, name):
        """Run a program of client_programs.py to its end. Returns what it prints last."""
        rospy.set_param("/use_sim_time", True)
        try:
            with Group() as programs:
                program = programs.start(*PROGRAM, name)
                program.wait(25)
        finally:
            rospy.delete_param("/use_sim_time")
        return program.stdout.splitlines()[-1]

    # Send

    def test_answer_before_send_goal_returns(self):
        self.while_sending(lambda: self.eventually(lambda: self.results, "the result") and time.sleep(0.1))
        self.send("ACTIVE result:SUCCEEDED", 1)
        self.expect(SUCCEEDED, 1)
        self.assertEqual([(SUCCEEDED, 1)], self.done)

    def test_goals_of_two_threads_call_their_own_done_cb(self):
        def send(number):
            self.send("go result:SUCCEEDED", number, done_cb=lambda _, result: done.append((number, result.the_result)))

        done, another = [], threading.Thread(target=send, args=[2])
        self.while_sending(lambda: another.start() or another.join(1))
        send(1)
        another.join(30)
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual([(2, 2)], done)

    def test_state_while_a_goal_is_sent_is_not_lost(self):
        def ask():
            states.append(self.client.get_state())

        states, asking = [], threading.Thread(target=ask)
        self.while_sending(lambda: asking.start() or asking.join(0.5))
        self.send("result:SUCCEEDED")
        asking.join(30)
        self.assertNotIn(LOST, states)

    def test_goal_that_was_replaced_writes_no_error(self):
        self.send("ACTIVE go feedback result:SUCCEEDED")
        self.wait_state(ACTIVE)
        older = self.client.gh
        self.send("ACTIVE")
        self.go()
        self.eventually(older.get_result, "its result")
        rospy.logerr("the last line")
        self.wait_log("the last line")
        self.assertEqual([], [line.msg for line in self.log if "tracking" in line.msg])

    def test_ids_are_unique_while_simulated_time_stands_still(self):
        ids = {self.in_simulated_time("goal_in_a_moment_of_simulated_time") for _ in range(2)}
        self.assertEqual(2, len(ids), ids)

    @parameterized.expand([("action_goal", TestRequestActionGoal(), ".*ActionGoal"), ("str", "wash", "str")])
    def test_goal_of_another_type_raises_and_changes_nothing(self, _, wrong, kind):
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        with self.assertRaisesRegex(TypeError, f"must be of type actionlib/TestRequestGoal, not {kind}"):
            self.client.send_goal(wrong)
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([(SUCCEEDED, 0)], 1), (self.done, len(self.goals)))

    def test_goal_that_cannot_be_sent_spoils_no_other(self):
        with self.assertRaises(rospy.ROSSerializationException):
            self.client.send_goal(TestRequestGoal(the_result="many"))
        self.send("0.1 result:ABORTED", 4)
        self.expect(ABORTED, 4)

    # State, result and callbacks

    def test_state_result_and_callbacks_agree(self):
        def done_cb(*args):
            time.sleep(0.2)  # the wait ends later
            self.done.append((*args, self.client.get_state(), self.client.get_result()))

        self.send("0.2 PENDING go ACTIVE go SUCCEEDED go result:SUCCEEDED", 4, done_cb=done_cb)
        self.eventually(lambda: self.client.gh.get_comm_state() == CommState.PENDING, "a status")
        self.assertEqual((PENDING, []), (self.client.get_state(), self.active))
        self.go()
        self.wait_state(ACTIVE)
        self.go()
        self.eventually(lambda: self.client.gh.get_goal_status() == SUCCEEDED, "the state before the result")
        self.assertEqual((ACTIVE, None), (self.client.get_state(), self.client.get_result()))
        self.go()
        self.expect(SUCCEEDED, 4)
        result = self.client.get_result()
        self.assertEqual(([True], [(SUCCEEDED, result, SUCCEEDED, result)]), (self.active, self.done))

    def test_done_cb_sends_the_next_goal_and_waits_for_it(self):
        def again(*_):
            self.send("0.1 result:SUCCEEDED", 2)
            self.done.append(self.client.wait_for_result(rospy.Duration(self.patience)))

        self.send("0.1 result:ABORTED", 1, done_cb=again)
        self.eventually(lambda: len(self.done) == 2, "both done_cb")
        self.assertEqual([(SUCCEEDED, 2), True], self.done)
        self.expect(SUCCEEDED, 2)

    def test_callback_that_raises_is_logged(self):
        for callback, error in itertools.product(["done_cb", "active_cb", "feedback_cb"], [ValueError, SystemExit]):
            def broken(*_):
                raise error(f"of {callback}")

            self.send("0.1 ACTIVE feedback 0.1 result:SUCCEEDED", 3, **{callback: broken})
            self.expect(SUCCEEDED, 3)
            self.wait_log(f"{error.__name__}: of {callback}")

    def test_last_feedback_of_a_slow_callback_is_delivered(self):
        self.send("0.1 ACTIVE feedback feedback feedback result:SUCCEEDED",
                  feedback_cb=lambda feedback: time.sleep(0.2) or self.feedback.append(feedback))
        self.expect(SUCCEEDED)
        self.eventually(lambda: len(self.feedback) == 3, "feedback three times")

    def test_done_cb_and_preempt_callback_do_not_deadlock(self):
        def done_cb(*_):
            in_done.set()
            in_preempt.wait(5)
            server.set_preempted()
            ended.set()

        def preempt_cb():
            in_preempt.set()
            time.sleep(0.2)
            self.client.cancel_goal()

        in_done, in_preempt, ended = threading.Event(), threading.Event(), threading.Event()
        server = self.library.SimpleActionServer("deadlock/wash_dishes_as", WashTheDishesAction, auto_start=False)
        server.register_goal_callback(lambda: server.accept_new_goal())
        server.register_preempt_callback(preempt_cb)
        server.start()
        raw = RawClient("/deadlock").wait_connected()
        self.addCleanup(raw.close)
        goal = raw.send(1)
        raw.wait(lambda: ACTIVE in raw.states.get(goal, []), "an active goal")
        self.send("0.1 ACTIVE 0.2 result:ABORTED", done_cb=done_cb)
        self.assertTrue(in_done.wait(30))
        raw.cancel(goal)
        self.assertTrue(ended.wait(5))

    # Waits

    def test_timeouts_may_be_seconds(self):
        self.send("0.2 ACTIVE 0.3 result:SUCCEEDED")
        self.assertTrue(self.client.wait_for_result(self.patience))
        self.assertTrue(self.client.wait_for_server(0))  # no limit
        self.assertEqual(SUCCEEDED, self.client.send_goal_and_wait(script("0.2 ACTIVE 0.3 result:SUCCEEDED"), 0, 0.0))

    @parameterized.expand([("float", 0.5, 0.5), ("negative", -1, 0), ("negative_duration", rospy.Duration(-1), 0)])
    def test_wait_for_result_ends_after_its_timeout(self, _, timeout, seconds):
        self.send("ACTIVE")
        begun = time.monotonic()
        self.assertFalse(self.client.wait_for_result(timeout))
        self.assertTrue(seconds - 0.05 < time.monotonic() - begun < seconds + 2)

    @parameterized.expand([("execute_timeout", "ACTIVE cancel result:PREEMPTED", 0.3, 30, PREEMPTED),
                           ("preempt_timeout", "ACTIVE", rospy.Duration(0.3), 0.3, ACTIVE)])
    def test_send_goal_and_wait_cancels_after(self, _, words, execute_timeout, preempt_timeout, state):
        self.assertEqual(state, self.client.send_goal_and_wait(script(words), execute_timeout, preempt_timeout))
        self.eventually(lambda: self.cancels, "a cancel")

    def test_timeout_that_is_no_number_raises_and_sends_nothing(self):
        for timeouts in ("1", 1), (1, None):
            self.assertRaises(TypeError, self.client.send_goal_and_wait, script("wrong"), *timeouts)
        self.send("0.1 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.assertEqual(1, len(self.goals))

    def test_wait_for_server_without_a_clock_ends(self):
        self.assertEqual("ends", self.in_simulated_time("no_clock_while_waiting_for_server"))

    def test_clock_that_begins_ends_no_wait_for_server(self):
        self.assertEqual("waits", self.in_simulated_time("clock_begins_while_waiting_for_server"))

    @mock.patch.object(robust, "WARN_EVERY", 1.0)
    def test_wait_for_server_warns_again_and_again(self):
        client = self.library.SimpleActionClient("nobody", TestRequestAction)
        self.assertFalse(client.wait_for_server(rospy.Duration(2.5)))
        for seconds in 1, 2:
            self.wait_log(f"waiting for the server of /nobody for {seconds} s")

    def test_wait_for_server_settles_once_for_each_connection(self):
        def wait():
            client = robust.SimpleActionClient("settles/scripted", TestRequestAction)
            client.action_client.wait_for_server()
            begun = time.monotonic()
            self.assertTrue(client.wait_for_server(30))
            return time.monotonic() - begun

        for _ in range(2):
            server = self.programs.start(*SCRIPTED_SERVER, ROS_NAMESPACE="/settles")
            self.assertGreater(wait(), 0.19)
            self.assertLess(min(wait() for _ in range(3)), 0.1, "a second client does not wait")
            server.stop()

    def test_shutdown_while_connections_settle_is_false(self):
        program = self.programs.start(*PROGRAM, "shutdown_while_connections_settle")
        program.expect("^False interrupted while waiting for the server of /scripted")

    # The end of a goal

    def test_cancel_and_status_after_the_end_change_nothing(self):
        self.send("0.1 ACTIVE result:SUCCEEDED go PREEMPTING unlisted result:ABORTED", 7)
        self.expect(SUCCEEDED, 7)
        self.client.cancel_goal()
        self.go()
        self.eventually(lambda: len(self.results) == 2, "the last word of the script")
        self.expect(SUCCEEDED, 7)
        self.assertEqual(([], [(SUCCEEDED, 7)]), (self.cancels, self.done))
        self.assertEqual(CommState.DONE, self.client.gh.get_comm_state())

    def test_unlisted_goal_is_lost_after_1_s_and_stays_lost(self):
        self.send("ACTIVE 0.2 unlisted cancel ACTIVE result:SUCCEEDED")
        self.wait_state(ACTIVE)
        begun = time.monotonic()
        self.expect(LOST)
        self.assertLess(time.monotonic() - begun, 4)
        self.client.cancel_goal()
        self.eventually(lambda: self.results, "a late result")
        self.assertFalse(self.client.get_result())
        self.expect(LOST)
        self.assertEqual("the server no longer knows the goal", self.client.get_goal_status_text())
        self.assertEqual([(LOST, None)], self.done)

    def test_status_that_lists_the_goal_again_keeps_it(self):
        self.send("ACTIVE unlisted 0.3 ACTIVE 1 unlisted 0.3 ACTIVE 0.1 result:SUCCEEDED")
        self.expect(SUCCEEDED)

    def test_older_status_loses_no_goal_that_was_just_cancelled(self):
        self.send("0.2 others 0.2 ACTIVE cancel result:PREEMPTED")
        self.client.cancel_goal()
        self.expect(PREEMPTED)

    @mock.patch.object(robust, "RESULT_WITHIN", 2.0)
    def test_goal_whose_result_got_lost_is_lost(self):
        self.send("ACTIVE SUCCEEDED 0.2 unlisted")
        self.expect(LOST)
        self.assertRegex(self.client.get_goal_status_text(), "reported SUCCEEDED, and no result came within 2 s")

    # heartbeat_timeout

    @parameterized.expand([("after_a_status", 1, "ACTIVE silent"),
                           ("before_it_was_listed", rospy.Duration(1), "silent"),
                           ("before_the_result", 1, "ACTIVE SUCCEEDED 0.2 unlisted silent")])
    def test_silent_goal_is_lost_and_cancelled(self, _, timeout, words):
        self.connect(heartbeat_timeout=timeout)
        self.send(words)
        begun = time.monotonic()
        self.expect(LOST)
        self.assertGreater(time.monotonic() - begun, 1)
        self.assertRegex(self.client.get_goal_status_text(),
                         r"^server lost: silent for [12]\.\d s \(heartbeat_timeout is 1 s\)$")
        self.assertEqual([(LOST, None)], self.done)
        self.eventually(lambda: self.cancels, "a cancel, in case the server is only asleep")
        self.assertEqual([self.goals[0].goal_id.id], [one.id for one in self.cancels])

    @parameterized.expand([
        ("feedback_and_status", "ACTIVE silent 1.4 feedback 1.4 ACTIVE 1.4 feedback result:SUCCEEDED"),
        ("feedback_shortly_before_the_timeout", "silent ACTIVE 0.4 feedback 1.7 feedback 0.1 result:SUCCEEDED"),
        ("status_before_the_result", "ACTIVE SUCCEEDED 0.2 unlisted 3 result:SUCCEEDED")])
    def test_sign_of_life(self, _, words):
        self.connect(heartbeat_timeout=2)
        self.send(words)
        self.expect(SUCCEEDED)
        self.assertEqual([], self.cancels)

    def test_time_for_which_the_client_stood_still_is_no_silence(self):
        self.connect(heartbeat_timeout=2)
        self.send("ACTIVE silent go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        for _ in range(3):
            ctypes.PyDLL(None).usleep(1500000)  # keeps the interpreter's lock, so no other thread runs
            time.sleep(0.1)
        self.go()
        self.expect(SUCCEEDED)

    @parameterized.expand([("when_another_is_sent", 1.75, True), ("when_none_is_tracked", 1.75, False),
                           ("when_none_is_tracked_any_more", 2.25, False)])
    def test_silent_goal_that_is_given_up_is_not_cancelled(self, _, seconds, sends_another):
        self.connect(heartbeat_timeout=2)
        self.send("silent 3.5 result:SUCCEEDED")
        given_up = self.client.gh
        time.sleep(seconds)
        if sends_another:
            self.send("go result:SUCCEEDED")
        else:
            self.client.stop_tracking_goal()
        self.eventually(given_up.get_result, "its result")
        self.assertEqual([], self.cancels)

    def test_client_is_kept_until_its_goal_is_over(self):
        self.connect(heartbeat_timeout=1)
        self.send("ACTIVE silent")
        client = weakref.ref(self.client)
        del self.client
        gc.collect()
        self.assertTrue(client())
        self.wait_freed(client)
        self.assertEqual([(LOST, None)], self.done)

    def test_300_quick_goals_leave_few_threads(self):
        self.connect(heartbeat_timeout=30, cancel_on_shutdown=True)
        before = threading.active_count()
        for _ in range(150):
            self.send("")
            self.send("result:SUCCEEDED")
            self.expect(SUCCEEDED)
        self.assertLess(threading.active_count() - before, 20)

    @parameterized.expand([("zero", 0), ("negative", -1), ("nan", float("nan"))])
    def test_heartbeat_timeout_not_above_0_is_a_value_error(self, _, wrong):
        self.assertRaises(ValueError, self.connect, heartbeat_timeout=wrong)

    def test_silence_after_ctrl_c_loses_no_goal(self):
        program = self.programs.start(*PROGRAM, "sends_goal", "ACTIVE", "heartbeat_timeout", "1")
        program.expect("active")
        program.signal(signal.SIGINT)
        program.wait()
        self.assertNotIn("done_cb", program.stdout, program)

    # cancel_on_shutdown; see robust_shutdown_test.py, too

    @parameterized.expand(["cancel_goal", "send_goal"])
    def test_ctrl_c_within_a_call_cancels_the_goal(self, call):
        program = self.programs.start(*PROGRAM, "interrupted", call)
        self.eventually(lambda: self.results, "a cancel, and the result after it")
        self.assertEqual(PREEMPTED, self.results[0].status.status)
        program.wait()

    def test_lost_goal_is_cancelled_on_shutdown(self):
        self.programs.start(
            *PROGRAM, "sends_goal", "ACTIVE unlisted cancel result:PREEMPTED", "cancel_on_shutdown", "1")
        self.eventually(lambda: self.results, "a cancel, and the result after it")

    # get_failure

    @parameterized.expand([
        ("success", "result:SUCCEEDED", None),
        ("text_of_two_lines", "text:no_soap result:PREEMPTED", "goal PREEMPTED: no soap"),
        ("no_text", "text: result:ABORTED", "goal ABORTED: the server gave no reason")])
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
