#!/usr/bin/env python3
"""robust.SimpleActionClient: one test for each thing that it does other than actionlib's.

The server is programs/scripted_server.py. Each goal is a script of what it does: `ACTIVE go result:SUCCEEDED`.
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
import weakref

import actionlib
from actionlib import CommState
from actionlib.msg import (
    TestRequestAction, TestRequestActionFeedback, TestRequestActionGoal, TestRequestActionResult)
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
import rospy
import rostest

from actions_tutorial import robust

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import Master, run
from support.scripted import ScriptedCase, script
from support.states import ABORTED, ACTIVE, NAMES, PENDING, PREEMPTED, RECALLED, SUCCEEDED

LOST = GoalStatus.LOST


class TestRobustClient(ScriptedCase):

    library = robust

    # Send

    def test_client_is_an_actionlib_client(self):
        self.connect()
        self.assertIsInstance(self.client, actionlib.SimpleActionClient)

    def test_one_send_goal_sends_one_message(self):
        self.connect()
        self.send("silent")
        self.assertFalse(self.client.wait_for_result(3))
        self.eventually(lambda: self.goals, "the goal")
        self.assertEqual(1, len(self.goals))

    def test_goal_message_may_be_changed_and_sent_again(self):
        self.connect()
        goal = script("result:SUCCEEDED", 1)
        self.client.send_goal(goal)
        goal.the_result = 2
        self.expect(SUCCEEDED, 1)
        self.client.send_goal(goal)
        self.expect(SUCCEEDED, 2)

    def test_action_goal_is_a_type_error_that_says_which_type(self):
        self.connect()
        with self.assertRaisesRegex(TypeError, "must be of type actionlib/TestRequestGoal, not .*ActionGoal"):
            self.client.send_goal(TestRequestActionGoal())
        with self.assertRaisesRegex(TypeError, "must be of type actionlib/TestRequestGoal, not str"):
            self.client.send_goal("wash")

    def test_goal_that_is_refused_leaves_the_goal_before_it_tracked(self):
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        self.assertRaises(TypeError, self.client.send_goal, "wash")
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([(SUCCEEDED, 0)], 1), (self.done, len(self.goals)))

    def test_send_goal_after_stop_raises_and_leaves_no_goal(self):
        client = robust.SimpleActionClient("nobody", TestRequestAction)
        client.action_client.stop()
        with self.assertRaises(rospy.ROSException):
            client.send_goal(script(""))
        self.assertIsNone(client.gh)
        self.assertFalse(client.wait_for_result(1))

    # The goal handle

    def test_gh_is_none_without_a_goal_that_is_tracked(self):
        self.connect()
        self.assertIsNone(self.client.gh)
        self.send("ACTIVE")
        self.assertIsInstance(self.client.gh, actionlib.ClientGoalHandle)
        self.client.stop_tracking_goal()
        self.assertIsNone(self.client.gh)

    def test_gh_none_set_by_the_program_stops_tracking(self):
        self.connect()
        self.send("ACTIVE")
        self.wait_state(ACTIVE)
        self.client.gh = None
        self.assertEqual((LOST, False), (self.client.get_state(), self.client.wait_for_result()))

    def test_gh_names_the_goals_id(self):
        self.connect()
        self.send("ACTIVE")
        self.wait_state(ACTIVE)
        goal_id = self.client.gh.comm_state_machine.action_goal.goal_id.id
        self.eventually(lambda: goal_id in [goal.goal_id.id for goal in self.goals], "the goal")

    def test_gh_shows_the_raw_status_and_get_state_folds_it(self):
        self.connect()
        self.send("ACTIVE cancel PREEMPTING go result:PREEMPTED", 4)
        self.wait_state(ACTIVE)
        self.assertEqual(CommState.ACTIVE, self.client.gh.get_comm_state())
        self.client.gh.cancel()
        self.eventually(lambda: self.client.gh.get_comm_state() == CommState.PREEMPTING, "PREEMPTING")
        self.assertEqual((ACTIVE, GoalStatus.PREEMPTING), (self.client.get_state(), self.client.gh.get_goal_status()))
        self.assertIsNone(self.client.gh.get_result())
        self.go()
        self.expect(PREEMPTED, 4)
        handle = self.client.gh
        self.assertEqual((PREEMPTED, PREEMPTED, "cancelled", 4, CommState.DONE), (
            handle.get_goal_status(), handle.get_terminal_state(), handle.get_goal_status_text(),
            handle.get_result().the_result, handle.get_comm_state()))

    def test_feedback_does_not_change_the_raw_status(self):
        self.connect()
        self.send("ACTIVE cancel PREEMPTING silent unlisted feedback go result:PREEMPTED")  # feedback that says ACTIVE
        self.wait_state(ACTIVE)
        self.client.cancel_goal()
        self.eventually(lambda: self.feedback, "feedback")
        self.assertEqual(GoalStatus.PREEMPTING, self.client.gh.get_goal_status())
        self.go()
        self.expect(PREEMPTED)

    def test_simple_state_is_done_after_done_cb_stopped_tracking(self):
        self.connect()
        self.send("ACTIVE result:SUCCEEDED", done_cb=lambda *_: self.client.stop_tracking_goal())
        self.eventually(lambda: self.client.simple_state == actionlib.SimpleGoalState.DONE, "DONE")

    def test_simple_state_is_of_the_goal_that_done_cb_has_sent(self):
        self.connect()
        self.send("ACTIVE result:ABORTED", done_cb=lambda *_: self.send("go result:SUCCEEDED"))
        self.assertTrue(self.client.wait_for_result(30))
        self.assertEqual(actionlib.SimpleGoalState.PENDING, self.client.simple_state)
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(actionlib.SimpleGoalState.DONE, self.client.simple_state)

    def test_comm_state_stays_done_after_a_cancel(self):
        self.connect()
        self.send("ACTIVE result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.client.cancel_goal()
        self.assertEqual(CommState.DONE, self.client.gh.get_comm_state())

    def test_kept_gh_is_updated_after_the_next_send_goal(self):
        self.connect()
        self.send("ACTIVE go result:ABORTED", 1, done_cb=lambda *_: self.done.append("older"))
        self.wait_state(ACTIVE)
        older = self.client.gh
        self.send("ACTIVE go 0.2 result:SUCCEEDED", 2)
        self.go()
        self.expect(SUCCEEDED, 2)
        self.assertEqual((ABORTED, 1), (older.get_terminal_state(), older.get_result().the_result))
        self.assertEqual([(SUCCEEDED, 2)], self.done)

    def test_kept_gh_is_updated_after_stop_tracking_goal(self):
        self.connect()
        self.send("ACTIVE go result:ABORTED", 1)
        self.wait_state(ACTIVE)
        kept = self.client.gh
        self.client.stop_tracking_goal()
        self.go()
        self.eventually(lambda: kept.get_result(), "a result")
        self.assertEqual((ABORTED, []), (kept.get_terminal_state(), self.done))

    def test_gh_set_back_after_its_outcome_is_over(self):
        self.connect()
        self.send("ACTIVE go result:ABORTED", 1)
        self.wait_state(ACTIVE)
        kept, self.client.gh = self.client.gh, None
        self.go()
        self.eventually(lambda: kept.get_result(), "a result")
        self.client.gh = kept
        self.expect(ABORTED, 1)
        self.assertEqual([], self.done)

    def test_gh_call_that_actionlib_lacks_is_an_attribute_error(self):
        self.connect()
        self.send("ACTIVE")
        with self.assertRaisesRegex(AttributeError, "pause"):
            self.client.gh.pause()

    # Callbacks that are set as attributes

    def test_feedback_cb_set_after_send_goal_is_called(self):
        self.connect()
        self.client.send_goal(script("ACTIVE go feedback result:SUCCEEDED"))
        self.client.feedback_cb = self.feedback.append
        self.sent = 1
        self.go()
        self.eventually(lambda: self.feedback, "feedback")

    def test_active_cb_and_done_cb_set_after_send_goal_are_called(self):
        self.connect()
        self.client.send_goal(script("go ACTIVE 0.1 result:SUCCEEDED"))
        self.client.active_cb = lambda: self.active.append(True)
        self.client.done_cb = lambda state, _: self.done.append(state)
        self.sent = 1
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(([True], [SUCCEEDED]), (self.active, self.done))

    def test_done_cb_of_an_older_goal_is_not_called(self):
        free, older = threading.Event(), []
        self.connect()
        self.send("ACTIVE 0.1 result:ABORTED", active_cb=lambda: free.wait(30), done_cb=lambda *_: older.append(1))
        handle = self.client.gh
        self.eventually(lambda: handle.get_comm_state() == CommState.DONE, "a result, while active_cb runs")
        self.send("ACTIVE 0.2 result:SUCCEEDED", 2)
        free.set()
        self.expect(SUCCEEDED, 2)
        self.assertEqual([], older)

    # State, result and callbacks

    def test_state_is_pending_then_active_then_terminal(self):
        self.connect()
        self.send("PENDING go ACTIVE go result:ABORTED", 4)
        self.assertFalse(self.client.wait_for_result(0.3))
        self.assertEqual(PENDING, self.client.get_state())
        self.go()
        self.wait_state(ACTIVE)
        self.go()
        self.expect(ABORTED, 4)
        self.assertEqual([(ABORTED, 4)], self.done)
        self.assertEqual("by script", self.client.get_goal_status_text())

    def test_result_without_any_status_ends_the_goal(self):
        self.connect()
        for state in SUCCEEDED, ABORTED, PREEMPTED, RECALLED, GoalStatus.REJECTED:
            self.send("silent result:" + NAMES[state], 6)
            self.expect(state, 6)
        self.assertEqual(5, len(self.done))
        self.assertEqual(3, len(self.active), "RECALLED and REJECTED goals were never active")

    def test_status_after_the_result_changes_nothing(self):
        self.connect()
        self.send("ACTIVE result:SUCCEEDED 0.1 PREEMPTING unlisted feedback", 7)
        self.eventually(lambda: self.feedback, "the last word of the script")
        self.expect(SUCCEEDED, 7)
        self.assertEqual([(SUCCEEDED, 7)], self.done)
        self.assertEqual((SUCCEEDED, CommState.DONE), (
            self.client.gh.get_terminal_state(), self.client.gh.get_comm_state()))

    def test_state_and_result_are_there_when_done_cb_is_called(self):
        self.connect()
        self.send("ACTIVE SUCCEEDED 0.2 result:SUCCEEDED", 8, done_cb=lambda state, result: self.done.append(
            (state, result.the_result, self.client.get_state(), self.client.get_result().the_result)))
        self.expect(SUCCEEDED)
        self.assertEqual([(SUCCEEDED, 8, SUCCEEDED, 8)], self.done)

    def test_done_cb_sends_the_next_goal_and_waits_for_it(self):
        self.connect()

        def again(state, result):
            self.send("result:SUCCEEDED", 2)
            self.assertTrue(self.client.wait_for_result(30))
            self.done.append("waited")

        self.send("result:ABORTED", 1, done_cb=again)
        self.eventually(lambda: "waited" in self.done, "done_cb")
        self.assertEqual([(SUCCEEDED, 2), "waited"], self.done)
        self.expect(SUCCEEDED, 2)

    def test_callbacks_are_called_where_no_thread_can_be_started(self):
        self.connect()
        before = threading.stack_size(1 << 46)  # no computer has that memory
        self.addCleanup(threading.stack_size, before)
        self.assertRaises(RuntimeError, threading.Thread(target=print).start)
        self.send("ACTIVE feedback result:SUCCEEDED", 3)
        self.expect(SUCCEEDED, 3)
        self.assertEqual(([True], [(SUCCEEDED, 3)]), (self.active, self.done))

    def test_goal_that_no_thread_can_guard_is_not_sent(self):
        for options in {"heartbeat_timeout": 30}, {"cancel_on_shutdown": True}:
            self.connect(**options)
            self.send("ACTIVE go result:SUCCEEDED")
            self.wait_state(ACTIVE)
            before = threading.stack_size(1 << 46)  # no computer has that memory
            try:
                self.assertRaises(RuntimeError, self.client.send_goal, script("result:ABORTED"))
            finally:
                threading.stack_size(before)
            self.go()
            self.expect(SUCCEEDED)
        self.assertEqual(([(SUCCEEDED, 0)] * 2, 2), (self.done, len(self.goals)))

    def test_send_goal_at_exit_raises_nothing_without_a_thread(self):
        program = self.programs.program("client_cases", "goal_at_exit_without_threads")
        program.expect("sent")
        self.assertEqual(0, program.wait(), program)

    def test_cancel_names_its_goal(self):
        self.connect()
        for words in "ACTIVE cancel result:PREEMPTED", "cancel result:RECALLED":
            self.send(words)
            self.client.cancel_goal()
            self.assertTrue(self.client.wait_for_result(30), "the scripted server waits for a cancel of this goal")
        self.eventually(lambda: len(self.cancels) == 2, "two cancels")

    def test_stop_tracking_goal_forgets_it_and_it_goes_on(self):
        self.connect()
        self.send("ACTIVE go feedback result:SUCCEEDED")
        self.wait_state(ACTIVE)
        self.client.stop_tracking_goal()
        self.go()
        self.assertFalse(self.client.wait_for_result(0.5))
        self.assertEqual((LOST, None), (self.client.get_state(), self.client.get_result()))
        self.assertEqual(([], [], []), (self.done, self.feedback, self.cancels))

    # Waits

    def test_stop_tracking_goal_ends_a_wait(self):
        self.connect()
        self.send("ACTIVE")
        threading.Timer(0.3, self.client.stop_tracking_goal).start()
        begun = time.monotonic()
        self.assertFalse(self.client.wait_for_result(30))
        self.assertLess(time.monotonic() - begun, 5)

    def test_wait_for_result_takes_seconds_and_durations(self):
        self.connect()
        self.send("ACTIVE go result:SUCCEEDED")
        for timeout in 1, 0.5, rospy.Duration(0.5):
            begun = time.monotonic()
            self.assertFalse(self.client.wait_for_result(timeout))
            self.assertGreater(time.monotonic() - begun, 0.45)
        self.go()
        for timeout in 0, 30, 30.0, rospy.Duration(), rospy.Duration(30):
            self.assertTrue(self.client.wait_for_result(timeout))

    def test_negative_timeout_is_over_at_once(self):
        self.connect()
        self.send("ACTIVE")
        for timeout in -1, rospy.Duration(-1), -math.inf:
            self.assertFalse(self.client.wait_for_result(timeout))
        nobody = robust.SimpleActionClient("nobody", TestRequestAction)
        self.assertFalse(nobody.wait_for_server(-1))
        self.assertEqual(ACTIVE, self.client.send_goal_and_wait(script("ACTIVE"), 0.3, -1))

    def test_infinite_timeout_is_no_limit(self):
        self.connect()
        self.assertTrue(self.client.wait_for_server(math.inf))
        goal = script("ACTIVE 0.2 result:SUCCEEDED")
        self.assertEqual(SUCCEEDED, self.client.send_goal_and_wait(goal, math.inf, math.inf))
        self.assertTrue(self.client.wait_for_result(math.inf))

    def test_timeout_that_is_no_number_raises_and_sends_nothing(self):
        self.connect()
        for wrong, error in (math.nan, ValueError), (None, TypeError), ("1", TypeError):
            for call in (self.client.wait_for_server, self.client.wait_for_result,
                         lambda timeout: self.client.send_goal_and_wait(script(""), timeout),
                         lambda timeout: self.client.send_goal_and_wait(script(""), 1, timeout)):
                self.assertRaises(error, call, wrong)
        self.send("result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.eventually(lambda: self.goals, "the goal")
        self.assertEqual(1, len(self.goals))

    def test_wait_for_result_without_a_goal_is_false_and_logged(self):
        self.connect()
        self.assertFalse(self.client.wait_for_result())
        self.wait_log("wait_for_result")

    def test_send_goal_and_wait_cancels_after_execute_timeout(self):
        self.connect()
        self.assertEqual(SUCCEEDED, self.client.send_goal_and_wait(script("result:SUCCEEDED"), 30, rospy.Duration(30)))
        goal = script("ACTIVE cancel result:PREEMPTED")
        for timeout in 0.3, rospy.Duration(0.3):
            self.assertEqual(PREEMPTED, self.client.send_goal_and_wait(goal, timeout, 30))
        self.eventually(lambda: len(self.cancels) == 2, "two cancels")

    def test_send_goal_and_wait_gives_up_after_preempt_timeout(self):
        self.connect()
        self.assertEqual(ACTIVE, self.client.send_goal_and_wait(script("ACTIVE"), 0.3, 0.3))

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
            self.assertLess(wait(), 0.1)
            server.stop()

    def serve_topics(self, *topics):
        """Publish these topics of the action here, too. Returns a function that publishes an empty status, and a list
        that tells of each status that comes whether it is from here (bool)."""
        kinds = {"status": GoalStatusArray, "result": TestRequestActionResult, "feedback": TestRequestActionFeedback}
        publishers = {topic: rospy.Publisher("scripted/" + topic, kinds[topic], queue_size=1) for topic in topics}
        from_here = []
        subscriber = rospy.Subscriber("scripted/status", GoalStatusArray, lambda status: from_here.append(
            status._connection_header["callerid"] == rospy.get_name()))
        for one in subscriber, *publishers.values():
            self.addCleanup(one.unregister)
        self.eventually(lambda: all(one.get_num_connections() for one in publishers.values()), "connections")
        return publishers["status"].publish, from_here

    def test_status_of_a_node_that_serves_nothing_delays_no_wait(self):
        self.connect()
        publish, from_here = self.serve_topics("status")
        self.send("silent")
        self.eventually(lambda: publish() or from_here[-15:] == [True] * 15, "a silent server")
        self.assertTrue(self.client.wait_for_server(0.1))

    def test_each_of_two_servers_settles_once(self):
        self.connect()
        publish, from_here = self.serve_topics("status", "result", "feedback")
        self.send("silent" + " go others" * 3)
        self.eventually(lambda: publish() or from_here[-15:] == [True] * 15, "a silent server")
        waits = []
        for here in [True, False] * 3:
            publish() if here else self.go()
            self.eventually(lambda: from_here[-1] == here, "its status")
            begun = time.monotonic()
            self.assertTrue(self.client.wait_for_server(30))
            waits.append(time.monotonic() - begun)
        self.assertGreater(waits[0], 0.19)
        self.assertLess(max(waits[1:]), 0.15)

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
        program = self.programs.program("client_cases", "shutdown_while_connections_settle")
        program.expect("^False interrupted while waiting for the server of /scripted")
        program.wait()

    # A goal that is guarded

    def send_and_forget(self, words, **options):
        """Send a goal with a client that nobody holds. Returns a weakref to it."""
        self.connect(**options)
        self.send(words)
        self.wait_state(ACTIVE)
        client = weakref.ref(self.client)
        del self.client
        gc.collect()
        return client

    def test_heartbeat_timeout_keeps_the_client_while_its_goal_runs(self):
        client = self.send_and_forget("ACTIVE silent", heartbeat_timeout=1)
        self.eventually(lambda: self.done, "done_cb")
        self.assertEqual([(LOST, None)], self.done)
        self.eventually(lambda: self.cancels, "a cancel")
        self.eventually(lambda: gc.collect() and False or not client(), "the client is freed")

    def test_cancel_on_shutdown_keeps_the_client_while_its_goal_runs(self):
        client = self.send_and_forget("ACTIVE go result:SUCCEEDED", cancel_on_shutdown=True)
        self.assertTrue(client())
        self.go()
        self.eventually(lambda: gc.collect() and False or not client(), "the client is freed")

    def test_cancel_on_shutdown_of_a_client_that_nobody_holds(self):
        program = self.programs.program("client_cases", "forgotten_client")
        program.expect("sent")
        program.signal(signal.SIGINT)
        self.eventually(lambda: self.results, "a cancel, and the result after it")

    def test_client_is_freed_when_its_goal_is_not_tracked_any_more(self):
        self.connect(heartbeat_timeout=30, cancel_on_shutdown=True)
        self.send("ACTIVE")
        self.client.stop_tracking_goal()
        client = weakref.ref(self.client)
        del self.client
        self.eventually(lambda: gc.collect() and False or not client(), "the client is freed")

    def test_goal_that_was_replaced_is_not_cancelled_for_its_silence(self):
        self.connect(heartbeat_timeout=1)
        self.send("go")  # no status lists it
        self.send("ACTIVE 2.5 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.assertEqual([], self.cancels)

    def test_lost_goal_is_cancelled_on_shutdown(self):
        program = self.programs.program("shutdown_client", "ACTIVE unlisted cancel result:PREEMPTED", "cancels")
        program.expect("LOST goal LOST: the server no longer knows the goal")
        self.assertEqual(0, program.wait(), program)
        self.eventually(lambda: self.results, "a cancel, and the result after it")

    def test_done_cb_of_a_lost_goal_ends_the_program(self):
        program = self.programs.program(
            "shutdown_client", "ACTIVE unlisted cancel result:PREEMPTED", "signals_shutdown")
        program.expect("done_cb")
        begun = time.monotonic()
        self.assertEqual(0, program.wait(), program)
        self.assertLess(time.monotonic() - begun, 1.7, "an outcome would be awaited for 2 s")
        self.eventually(lambda: self.results, "a cancel, and the result after it")

    # A lost server

    def test_silence_of_heartbeat_timeout_is_lost_with_text(self):
        self.connect(heartbeat_timeout=1)
        self.send("ACTIVE silent")
        self.expect(LOST)
        self.assertEqual([(LOST, None)], self.done)
        self.assertRegex(self.client.get_goal_status_text(), r"silent for [12]\.\d s \(heartbeat_timeout is 1 s\)")
        self.eventually(lambda: self.cancels, "a cancel, in case the server is only asleep")
        self.assertEqual([self.client.gh.comm_state_machine.action_goal.goal_id.id], [one.id for one in self.cancels])

    def test_server_silent_before_it_has_listed_the_goal_is_lost(self):
        self.connect(heartbeat_timeout=2)
        self.send("0.3 silent")
        self.expect(LOST)
        self.assertIn("server lost: silent for 2", self.client.get_goal_status_text())

    def test_status_of_other_goals_is_silence(self):
        self.connect(heartbeat_timeout=1)
        self.send("silent" + " others 0.2" * 10)
        self.expect(LOST)

    def test_living_server_that_does_not_list_the_goal_is_named(self):
        self.connect(heartbeat_timeout=1)
        self.send("5")
        self.expect(LOST)
        self.assertRegex(self.client.get_goal_status_text(), "server did not list the goal, nor send feedback, for 1")

    def test_time_for_which_the_client_stood_still_is_no_silence(self):
        self.connect(heartbeat_timeout=2)
        self.send("ACTIVE silent go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        for _ in range(4):
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

    def test_late_result_of_a_lost_goal_changes_nothing(self):
        self.connect(heartbeat_timeout=0.5)
        self.send("ACTIVE silent cancel go result:SUCCEEDED feedback")
        self.expect(LOST)
        self.go()
        self.eventually(lambda: self.feedback, "the last word of the script")
        self.expect(LOST)
        self.assertEqual([(LOST, None)], self.done)

    def test_feedback_and_status_are_signs_of_life(self):
        self.connect(heartbeat_timeout=2)
        self.send("ACTIVE silent 1 feedback 1 feedback 1 ACTIVE 1 feedback 1 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.assertEqual([], self.cancels)

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

    def test_heartbeat_timeout_not_above_0_is_a_value_error(self):
        for wrong in 0, -1, float("nan"):
            with self.assertRaises(ValueError):
                robust.SimpleActionClient("scripted", TestRequestAction, heartbeat_timeout=wrong)

    def test_goal_that_is_listed_again_soon_is_not_lost(self):
        self.connect()
        self.send("ACTIVE others unlisted 0.2 ACTIVE 1.5 unlisted 0.2 ACTIVE 0.1 result:SUCCEEDED")
        self.expect(SUCCEEDED)

    def test_late_result_is_awaited_while_the_server_lives(self):
        for options in {}, {"heartbeat_timeout": 1}:
            self.connect(**options)
            self.send("ACTIVE SUCCEEDED 0.2 unlisted 2.5 result:SUCCEEDED", 5)
            self.expect(SUCCEEDED, 5)
        self.assertEqual([], self.cancels)

    def test_server_that_falls_silent_before_its_result_is_lost(self):
        self.connect(heartbeat_timeout=1)
        self.send("ACTIVE SUCCEEDED 0.2 unlisted silent")
        self.expect(LOST)
        self.assertIn("silent for", self.client.get_goal_status_text())

    def test_goal_never_listed_stays_pending(self):
        self.connect()
        self.send("2 result:SUCCEEDED")
        self.assertFalse(self.client.wait_for_result(1.5))
        self.assertEqual(PENDING, self.client.get_state())
        self.expect(SUCCEEDED)

    def test_goal_no_status_lists_is_lost_5_s_after_its_first_cancel(self):
        self.connect()
        self.send("cancel")
        begun = time.monotonic()
        self.client.cancel_goal()
        self.assertFalse(self.client.wait_for_result(3))
        self.client.cancel_goal()
        self.expect(LOST)
        self.assertTrue(5 <= time.monotonic() - begun < 7)
        self.assertEqual("cancelled, and the server does not list the goal", self.client.get_goal_status_text())

    def test_cancel_of_all_goals_makes_no_unlisted_goal_lost(self):
        self.connect()
        self.send("6 result:SUCCEEDED")
        self.client.cancel_all_goals()
        self.expect(SUCCEEDED)

    # get_failure

    def test_get_failure_of_a_goal_that_succeeded_is_none(self):
        self.connect()
        self.send("result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.assertIsNone(self.client.get_failure())

    def test_get_failure_of_an_outcome_is_state_and_text(self):
        self.connect()
        for words, failure in (("result:ABORTED", "goal ABORTED: by script"),
                               ("text: result:ABORTED", "goal ABORTED: the server gave no reason"),
                               ("text:no_soap result:PREEMPTED", "goal PREEMPTED: no soap")):
            self.send(words)
            self.client.wait_for_result(30)
            self.assertEqual(failure, self.client.get_failure())

    def test_get_failure_without_outcome(self):
        self.connect()
        self.assertEqual("no goal was sent, or it is no longer tracked", self.client.get_failure())
        self.send("0.5 ACTIVE unlisted")
        self.assertEqual("goal PENDING: no outcome so far", self.client.get_failure())
        self.expect(LOST)
        self.assertEqual("goal LOST: the server no longer knows the goal", self.client.get_failure())

    def test_get_failure_without_server(self):
        nobody = robust.SimpleActionClient("nobody", TestRequestAction)
        self.assertFalse(nobody.wait_for_server(0.2))
        self.assertEqual("no server of /nobody within 0.2 s", nobody.get_failure())

    def test_get_failure_after_send_goal_is_of_the_goal(self):
        nobody = robust.SimpleActionClient("nobody", TestRequestAction)
        self.assertFalse(nobody.wait_for_server(0.1))
        nobody.send_goal(script(""))
        self.assertEqual("goal PENDING: no outcome so far", nobody.get_failure())

    def test_get_failure_of_an_outcome_after_a_failed_wait(self):
        late = robust.SimpleActionClient("late", TestRequestAction)
        publisher = rospy.Publisher("late/result", TestRequestActionResult, queue_size=10)
        for state, failure in (SUCCEEDED, None), (ABORTED, "goal ABORTED: the server gave no reason"):
            late.send_goal(script(""))
            self.assertFalse(late.wait_for_server(0.1))
            self.assertEqual("no server of /late within 0.1 s", late.get_failure())
            status = GoalStatus(late.gh.comm_state_machine.action_goal.goal_id, state, "")
            self.eventually(lambda: publisher.publish(status=status) or late.wait_for_result(0.1), "a result")
            self.assertEqual(failure, late.get_failure())

    def test_get_failure_of_a_server_that_has_gone_since(self):
        server = self.programs.scripted_server(ROS_NAMESPACE="/gone")
        client = robust.SimpleActionClient("gone/scripted", TestRequestAction)
        self.assertTrue(client.wait_for_server(30))
        self.assertEqual(SUCCEEDED, client.send_goal_and_wait(script("result:SUCCEEDED"), 30))
        self.assertIsNone(client.get_failure())
        server.stop()
        self.eventually(lambda: not client.wait_for_server(0.1), "no server any more")
        self.assertEqual("no server of /gone/scripted within 0.1 s", client.get_failure())


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_client", TestRobustClient)
