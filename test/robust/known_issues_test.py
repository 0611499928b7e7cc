#!/usr/bin/env python3
"""What users of actionlib in Python have reported: one test for each row of doc/known_issues.md, named by the report.

ACTIONLIB=plain in the environment tries actionlib instead of robust, and each test fails, some only by chance. The name
of a test begins with its repository: actionlib, ros_comm, pr2_common; own: found by us.
"""
import os
import sys
import threading
import time
from unittest import mock

import actionlib
from actionlib import CommState, SimpleGoalState
from actionlib.msg import TestRequestAction, TestRequestGoal
from actionlib_msgs.msg import GoalStatus
import rospy
import rostest

from actions_tutorial import msg, robust

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import eventually
from support.raw_client import RawClient
from support.scripted import Programs, ScriptedCase, script
from support.states import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED

LOST = GoalStatus.LOST


class TestKnownIssues(ScriptedCase):

    library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust
    patience = 5

    def finding(self, name, *arguments, simulated=True, status=0):
        """Run a program of known_issue in programs.py, in simulated time. Returns what it prints last."""
        programs = Programs()
        self.addCleanup(programs.stop)
        if simulated:
            rospy.set_param("/use_sim_time", True)
        try:
            program = programs.program("known_issue", name, *arguments)
            program.expect("^ready")
        finally:
            if simulated:
                rospy.delete_param("/use_sim_time")
        self.assertEqual(status, program.wait(25), program)
        return [line for line in program.stdout.splitlines() if not line.startswith("[INFO]")][-1]

    def serve(self, name, execute_cb=None, goal_cb=None):
        """Start a server here, and connect self.raw. Without a callback: the goal SUCCEEDS at once."""
        self.a_server = self.library.SimpleActionServer(
            name + "/wash_dishes_as", msg.WashTheDishesAction,
            None if goal_cb else execute_cb or (lambda _: self.a_server.set_succeeded()), auto_start=False)
        self.a_server.register_goal_callback(goal_cb) if goal_cb else None
        self.a_server.start()
        self.raw = RawClient("/" + name).wait_connected()
        self.addCleanup(self.raw.close)

    # Servers

    def test_actionlib_117_goal_after_the_clock_was_set_back(self):
        self.assertEqual("SUCCEEDED", self.finding("clock_set_back_after_a_goal"))

    def test_actionlib_203_clock_set_back_during_a_goal(self):
        self.assertEqual("SUCCEEDED", self.finding("clock_set_back_during_a_goal"))

    def test_actionlib_203_clock_set_back_after_a_cancel(self):
        self.assertEqual("SUCCEEDED", self.finding("clock_set_back_after_a_cancel"))

    def test_ros_comm_1083_status_after_the_clock_was_set_back(self):
        self.assertEqual("status goes on", self.finding("clock_set_back_and_status"))

    def test_actionlib_146_program_that_raises_ends(self):
        for callback in "goal_callback", "execute_cb":
            self.finding("main_thread_raises_after_" + callback, simulated=False, status=1)

    def test_actionlib_164_idle_server_does_not_poll(self):
        program = self.programs.program("known_issue", "idle")
        program.expect("^ready")

        def wakes():
            folder, counts = "/proc/%d/task" % program.usage.pid, {}
            for thread in os.listdir(folder):
                with open("%s/%s/status" % (folder, thread)) as file:
                    counts[thread] = int(dict(line.split(":", 1) for line in file)["voluntary_ctxt_switches"])
            return counts

        time.sleep(1)  # it starts
        before = wakes()
        time.sleep(2)
        often = {thread: count - before.get(thread, count) for thread, count in wakes().items()}
        program.stop()
        self.assertLess(max(often.values()), 16, "a status is published 5 times a second, actionlib polls 10 times")

    def test_actionlib_196_goal_cancelled_while_it_waits(self):
        started, free = [], threading.Event()

        def execute_cb(goal):
            started.append(goal.number_of_minutes)
            free.wait(30)
            self.a_server.set_succeeded()

        self.serve("issue_196", execute_cb)
        first = self.raw.send(1)
        self.raw.wait(lambda: started, "a first goal")
        waiting = self.raw.send(2)
        self.raw.wait(lambda: waiting in self.raw.states, "a goal that waits")
        self.raw.cancel(waiting)
        self.raw.wait(lambda: self.raw.states[waiting][-1] in (GoalStatus.RECALLING, RECALLED), "a cancel")
        self.assertNotIn(first, self.raw.results, "RECALLED at once, not after the first")
        free.set()
        self.raw.wait_result(first)
        self.assertEqual(RECALLED, self.raw.wait_result(waiting).status.status)
        self.assertEqual([1], started)

    def test_actionlib_212_pause_between_two_goals(self):
        def execute_cb(_):
            self.a_server.set_succeeded()
            time.sleep(0.02)  # the next goal comes meanwhile

        self.serve("issue_212", execute_cb)
        begun = time.monotonic()
        for _ in range(20):
            self.raw.wait_result(self.raw.send(0))
        self.assertLess(time.monotonic() - begun, 1.6)

    # Waiting for a server

    def test_actionlib_19_wait_for_server_without_a_clock_ends(self):
        self.assertEqual("ends", self.finding("no_clock_while_waiting_for_server"))

    def test_actionlib_137_clock_that_begins_ends_no_wait(self):
        self.assertEqual("[True]", self.finding("clock_begins_while_waiting_for_server"))

    def test_actionlib_35_wrong_name_of_an_action_is_logged(self):
        nobody = self.library.SimpleActionClient("nobody", TestRequestAction)
        self.assertFalse(nobody.wait_for_server(rospy.Duration(5.5)))
        self.assertTrue([line for line in self.log if "/nobody" in line.msg], "a line that names it")

    # Goal and outcome

    def test_actionlib_58_clock_that_begins_ends_no_wait_for_result(self):
        self.assertEqual("True", self.finding("clock_begins_while_waiting_for_result"))

    def test_actionlib_116_terminal_state_before_the_result(self):
        self.connect()
        self.send("ACTIVE 0.3 SUCCEEDED go result:SUCCEEDED", 1)
        self.wait_state(ACTIVE)
        self.client.wait_for_result(rospy.Duration(1))
        self.assertEqual(ACTIVE, self.client.get_state())
        self.go()
        self.expect(SUCCEEDED, 1)

    def test_actionlib_126_cancel_after_the_end(self):
        self.connect()
        self.send("ACTIVE result:SUCCEEDED go unlisted feedback")
        self.expect(SUCCEEDED)
        self.client.cancel_goal()
        self.go()
        self.eventually(lambda: self.client.wait_for_result(rospy.Duration(0.5)), "the last word of the script")
        self.expect(SUCCEEDED)
        self.assertEqual(([], CommState.DONE), (self.cancels, self.client.gh.get_comm_state()))

    @mock.patch.object(robust, "RESULT_WITHIN", 2.0)
    def test_actionlib_181_result_that_got_lost(self):
        self.connect()
        self.send("ACTIVE SUCCEEDED 0.2 unlisted")
        self.expect(LOST)
        self.assertRegex(self.client.get_goal_status_text(), "reported SUCCEEDED, and no result came within 2 s")

    def test_pr2_common_139_restarted_server(self):
        self.connect()
        self.send("ACTIVE 0.2 unlisted go result:SUCCEEDED")
        self.expect(LOST)
        self.go()
        self.eventually(lambda: self.results, "a late result")
        self.client.wait_for_result(rospy.Duration(0.3))
        self.expect(LOST)
        self.assertEqual("the server no longer knows the goal", self.client.get_goal_status_text())
        self.assertEqual(([(LOST, None)], []), (self.done, self.cancels))

    def test_ros_comm_1658_timeouts_in_seconds(self):
        self.connect()
        self.assertTrue(self.client.wait_for_server(5))
        self.assertEqual(SUCCEEDED, self.client.send_goal_and_wait(script("0.1 result:SUCCEEDED"), 5, 5.0))

    # Callbacks

    def test_actionlib_193_goal_sent_from_done_cb(self):
        self.connect()
        self.send("0.1 result:ABORTED", done_cb=lambda *_: self.send("go result:SUCCEEDED", 2))
        self.client.wait_for_result(rospy.Duration(5))
        self.assertEqual(SimpleGoalState.PENDING, self.client.simple_state)
        self.go()
        self.expect(SUCCEEDED, 2)
        self.assertEqual([(SUCCEEDED, 2)], self.done)

    def test_actionlib_213_last_feedback_of_a_slow_callback(self):
        self.connect()
        self.send("ACTIVE feedback feedback feedback result:SUCCEEDED",
                  feedback_cb=lambda feedback: time.sleep(0.2) or self.feedback.append(feedback))
        self.expect(SUCCEEDED)
        self.client.wait_for_result(rospy.Duration(1))
        eventually(lambda: len(self.feedback) == 3, "feedback three times", self.server, timeout=5)

    def test_own_callback_that_raises(self):
        self.connect()
        for callback in "active_cb", "feedback_cb", "done_cb":
            for error in ValueError, SystemExit:
                def broken(*_):
                    raise error("of %s" % callback)

                self.send("ACTIVE feedback 0.1 result:SUCCEEDED", 3, **{callback: broken})
                self.expect(SUCCEEDED, 3)
                self.wait_log("%s: of %s" % (error.__name__, callback))

    def test_own_done_cb_and_preempt_callback_do_not_deadlock(self):
        in_done, in_preempt, ended = threading.Event(), threading.Event(), threading.Event()

        def done_cb(*_):
            in_done.set()
            in_preempt.wait(5)
            self.a_server.set_preempted()
            ended.set()

        def preempt_cb():
            in_preempt.set()
            time.sleep(0.2)
            self.client.cancel_goal()

        self.connect()
        self.serve("issue_deadlock", goal_cb=lambda: self.a_server.accept_new_goal())
        self.a_server.register_preempt_callback(preempt_cb)
        goal = self.raw.send(1)
        self.raw.wait(lambda: ACTIVE in self.raw.states.get(goal, []), "an active goal")
        self.send("ACTIVE 0.2 result:ABORTED", done_cb=done_cb)
        self.assertTrue(in_done.wait(30))
        self.raw.cancel(goal)
        self.assertTrue(ended.wait(5))
        self.assertEqual(PREEMPTED, self.raw.wait_result(goal).status.status)

    # Goals that follow each other fast

    def test_actionlib_177_complaints_of_untracked_goals(self):
        self.connect()
        for _ in range(200):
            self.send("result:SUCCEEDED")
            self.client.wait_for_result(rospy.Duration(self.patience))
        self.assertEqual([], [line.msg for line in self.log if "tracking" in line.msg])

    def test_actionlib_206_answer_before_send_goal_returns(self):
        self.connect()
        for _ in range(300):
            self.send("result:SUCCEEDED")
            self.expect(SUCCEEDED)

    def test_actionlib_206_goals_of_two_threads(self):
        self.connect()
        wrong = []

        def send(numbers):
            for number in numbers:
                self.send("result:SUCCEEDED", number, done_cb=lambda _, result, sent=number: wrong.append(
                    (sent, result.the_result)) if result.the_result != sent else None)

        threads = [threading.Thread(target=send, args=[range(start, start + 50)]) for start in (100, 200)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30)
        self.client.wait_for_result(rospy.Duration(5))
        self.assertEqual([], wrong)

    def test_actionlib_206_state_while_a_goal_is_sent(self):
        self.connect()
        self.send("result:SUCCEEDED")
        self.expect(SUCCEEDED)
        over, states = threading.Event(), set()

        def ask():
            while not over.is_set():
                states.add(self.client.get_state())

        thread = threading.Thread(target=ask)
        thread.start()
        for _ in range(50):
            self.send("")
        over.set()
        thread.join()
        self.assertNotIn(LOST, states)

    # Messages

    def test_own_status_from_before_the_goal(self):
        self.connect()
        self.send("0.2 others 0.2 ACTIVE cancel result:PREEMPTED")
        self.client.cancel_goal()
        self.client.wait_for_result(rospy.Duration(1))
        self.expect(PREEMPTED)

    def test_own_goal_that_cannot_be_sent_spoils_the_next(self):
        self.connect()
        with self.assertRaises(rospy.ROSSerializationException):
            self.client.send_goal(TestRequestGoal(the_result="many"))
        self.send("0.1 result:ABORTED", 4)
        self.expect(ABORTED, 4)

    def test_own_same_id_in_a_moment_of_simulated_time(self):
        for _ in range(2):
            self.assertEqual("sent", self.finding("goal_in_a_moment_of_simulated_time"))
        self.eventually(lambda: len(self.results) == 2, "two results")
        self.assertNotEqual(self.results[0].status.goal_id.id, self.results[1].status.goal_id.id)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "known_issues", TestKnownIssues)
