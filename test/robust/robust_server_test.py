#!/usr/bin/env python3
"""What the server of robust does other than actionlib's, seen on the topics of its action.

What a server does with a goal is the execute_cb or goal callback in each test. ACTIONLIB=plain in the environment tries
actionlib, on which these tests fail.
"""
import logging
import os
import threading
import time

import actionlib
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesFeedback, WashTheDishesResult
from parameterized import parameterized
from rosgraph_msgs.msg import Log
import rospy
import rostest

from support.printed import bowls
from support.processes import Group, eventually
from support.server_case import PROGRAM, ServerCase
from support.states import ABORTED, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


def in_thread(function):
    """Call a function in another thread. Returns what it returned, or "waits" if it does not return within 10 s."""
    returned = ["waits"]
    thread = threading.Thread(target=lambda: returned.append(function()), daemon=True)
    thread.start()
    thread.join(10)
    return returned[-1]


class TestRate(ServerCase):

    library = library

    def test_sleep_is_true_after_the_period_without_drift(self):
        self.serve(goal_cb=self.accept)
        rate, begun = self.server.rate(10), time.monotonic()
        for _ in range(10):
            self.assertIs(True, rate.sleep())
            time.sleep(0.05)  # work, which is no drift
        self.assertTrue(0.99 < time.monotonic() - begun < 1.4)

    @parameterized.expand([
        ("a_cancel", lambda self, goal: self.client.cancel(goal)),
        ("a_newer_goal", lambda self, goal: self.client.send(2)),
        ("an_outcome", lambda self, goal: self.server.set_aborted()),
        ("preempt_request_of_the_program", lambda self, goal: setattr(self.server, "preempt_request", True))])
    def test_sleep_is_false_at_once_for(self, _, act):
        self.serve(goal_cb=self.accept)
        goal, rate, slept = self.send_active(1), self.server.rate(0.01), []
        thread = threading.Thread(target=lambda: slept.append(rate.sleep()), daemon=True)
        thread.start()
        thread.join(0.2)
        self.assertEqual([], slept)
        act(self, goal)
        thread.join(10)
        self.assertEqual([False], slept)

    def test_sleep_is_false_at_once_in_each_thread(self):
        self.serve(goal_cb=self.accept)
        self.send_active(1)
        self.server.preempt_request = True
        self.assertEqual([False, False], [in_thread(self.server.rate(0.01).sleep) for _ in range(2)])

    def test_cancel_between_look_and_wait_of_a_sleep_wakes_it(self):
        class CancelledMeanwhile(robust.SimpleActionServer):

            @robust.SimpleActionServer.preempt_request.getter
            def preempt_request(self):
                before = robust.SimpleActionServer.preempt_request.fget(self)
                while cancels:
                    cancel = cancels.pop()
                    cancel.start()
                    cancel.join(0.5)
                return before

        cancels = []
        self.serve(goal_cb=self.accept, kind=CancelledMeanwhile)
        self.send_active(1)
        cancels.append(threading.Thread(target=setattr, args=[self.server, "preempt_request", True], daemon=True))
        self.assertIs(False, in_thread(self.server.rate(0.01).sleep))

    @parameterized.expand([("one_rate", False), ("a_rate_in_each_turn", True)])
    def test_loop_after_a_cancel_keeps_its_pace_with(self, _, anew):
        self.serve(goal_cb=self.accept)
        self.send_active(1)
        rate = self.server.rate(20)
        self.server.preempt_request = True
        rate.sleep()  # at once
        begun = time.monotonic()
        slept = [(self.server.rate(20) if anew else rate).sleep() for _ in range(10)]
        self.assertEqual([False] * 10, slept)
        self.assertGreater(time.monotonic() - begun, 0.4)

    def test_rate_of_a_goal_that_is_over_is_false_beside_a_newer(self):
        self.serve(goal_cb=self.accept)
        self.send_active(1)
        older = self.server.rate(0.01)
        self.send_active(2)
        newer = self.server.rate(20)
        self.assertEqual([False, True], [in_thread(older.sleep), newer.sleep()])

    def test_rate_made_before_the_first_goal_serves_all(self):
        self.serve(goal_cb=self.accept)
        rate, begun = self.server.rate(0.1), time.monotonic()
        for number in 1, 2:
            self.send_active(number)
            self.server.preempt_request = True
            self.assertIs(False, rate.sleep())
        self.assertLess(time.monotonic() - begun, 8, "its period is 10 s")

    def test_rate_serves_the_goal_that_its_thread_accepts_next(self):
        def execute_cb(_):
            rate = self.server.rate(20)
            while rate.sleep():
                pass
            newer = self.server.accept_new_goal()  # as move_base does
            self.started.append((newer.number_of_minutes, rate.sleep()))
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.client.send(1)
        eventually(self.server.is_active, "a goal that runs", self.client)
        self.expect(self.client.send(2), SUCCEEDED)
        self.assertEqual([(2, True)], self.started)

    def test_sleep_wakes_while_a_callback_holds_the_locks(self):
        slept = []
        self.serve(goal_cb=self.accept, preempt_cb=lambda: slept.append(in_thread(self.server.rate(0.01).sleep)))
        self.client.cancel(self.send_active(1))
        eventually(lambda: slept, "a preempt callback", self.client)
        self.assertEqual([False], slept)


class TestGoals(ServerCase):

    library = library

    # Start

    def test_next_goal_starts_at_once(self):
        def execute_cb(_):
            self.server.set_succeeded()
            time.sleep(0.02)  # the next goal comes meanwhile

        self.serve(execute_cb)
        begun = time.monotonic()
        for _ in range(20):
            self.client.wait_result(self.client.send(0))
        self.assertLess(time.monotonic() - begun, 1.6)

    def test_idle_server_does_not_poll(self):
        self.check_program("idle", 0)

    def test_program_whose_main_thread_raises_ends(self):
        self.check_program("raise_in_main_thread", 1)

    def check_program(self, name, status):
        """Run a function of server_programs.py to its end. Expect its exit status."""
        with Group() as programs:
            self.assertEqual(status, programs.start(*PROGRAM, name).wait(20))

    @parameterized.expand([("alone", 0), ("beside_one_that_waits", 2)])
    def test_server_stopped_during_a_goal_starts_again(self, _, waiting):
        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            if goal.number_of_minutes:
                self.free.wait(30)
                self.server.publish_feedback(WashTheDishesFeedback())  # which raises while the server is stopped
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.send_active(1)
        if waiting:
            self.send_waiting(waiting)
        self.server.action_server.stop()
        self.free.set()
        eventually(lambda: not self.server.is_active(), "the end of the goal")
        self.server.execute_thread.join(0.5)  # the time in which it would end, or start the goal that waits
        self.assertEqual([1], self.started)
        self.client.close()
        self.server.start()
        self.connect()
        self.expect(self.client.send(0), SUCCEEDED)

    # The goal that comes last wins

    def test_goal_stamped_before_the_last_one_is_served(self):
        self.serve(self.work_until_free)
        self.expect(self.client.send(0), SUCCEEDED)
        self.expect(self.client.send(0, stamp=rospy.Time.now() - rospy.Duration(100)), SUCCEEDED)

    def test_goal_stamped_before_the_one_that_runs_takes_over(self):
        self.serve(self.work_until_free)
        older = self.send_active(1)
        newer = self.send_waiting(0, stamp=rospy.Time.now() - rospy.Duration(100))
        self.free.set()
        self.expect(newer, SUCCEEDED)
        self.expect(older, PREEMPTED, "a newer goal came")

    def test_goal_that_waits_is_recalled_for_a_newer_one(self):
        self.serve(self.work_until_free)
        older, waiting = self.send_active(1), self.send_waiting(2)
        newer = self.client.send(0)
        self.expect(waiting, RECALLED, "a newer goal came")
        self.assertNotIn(older, self.client.results)
        self.free.set()
        self.expect(newer, SUCCEEDED)

    def test_goal_cancelled_while_it_waits_is_recalled_at_once(self):
        self.serve(self.work_until_free)
        older, waiting = self.send_active(1), self.send_waiting(2)
        self.client.cancel(waiting)
        self.client.wait(lambda: waiting in self.client.results, "the outcome of the goal that waits", timeout=10)
        self.expect(waiting, RECALLED, "cancelled before it was started")
        self.assertNotIn(older, self.client.results)
        self.free.set()
        self.expect(older, PREEMPTED)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([1, 0], self.started)

    def test_goal_that_was_recalled_is_forgotten(self):
        self.serve(goal_cb=lambda: self.started.append("came"))
        waiting = self.client.send(1, stamp=rospy.Time.now() + rospy.Duration(1000))  # later than the next one's
        eventually(lambda: self.started, "a goal", self.client)
        self.client.cancel(waiting)
        self.expect(waiting, RECALLED)
        self.assertEqual((None, False), (self.server.accept_new_goal(), self.server.is_new_goal_available()))
        self.server.register_goal_callback(self.accept)
        self.send_active(2)

    def test_cancel_stamped_in_the_future_shuts_nobody_out(self):
        self.serve(self.work_until_free)
        before = rospy.Time.now()
        self.client.cancel(stamp=before + rospy.Duration(1000))
        self.client.cancel("unknown")
        self.client.wait(lambda: "unknown" in self.client.states, "a status that lists the later cancel")
        self.expect(self.client.send(0, stamp=before), RECALLED)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_burst_of_300_goals_gives_300_outcomes(self):
        self.free.set()
        self.serve(self.work_until_free)
        goals = [self.client.send(0) for _ in range(300)]
        for goal in goals:
            self.assertIn(self.client.wait_result(goal).status.status, (SUCCEEDED, RECALLED, PREEMPTED))
        self.expect(goals[-1], SUCCEEDED)

    # Texts

    @parameterized.expand([
        ("succeeded", lambda server: server.set_succeeded(), SUCCEEDED, "all done"),
        ("aborted", lambda server: server.set_aborted(), ABORTED, "the server gave up"),
        ("preempted_unasked", lambda server: server.set_preempted(), PREEMPTED, "preempted by the server"),
        ("of_the_program", lambda server: server.set_succeeded(None, "größer "), SUCCEEDED, "größer ")])
    def test_text_of_an_outcome(self, _, end, state, text):
        self.serve(lambda _: end(self.server))
        self.expect(self.client.send(0), state, text)

    @parameterized.expand([
        ("newer_goal", False, "a newer goal came"), ("newer_goal_after_a_cancel", True, "cancelled")])
    def test_text_of_a_goal_that_stops_for_a(self, _, is_cancelled, text):
        self.serve(self.work_until_free)
        older = self.send_active(1)
        if is_cancelled:
            self.client.cancel(older)
            self.client.wait(lambda: PREEMPTING in self.client.states[older], "a cancel")
        self.send_waiting(0)
        self.free.set()
        self.expect(older, PREEMPTED, text)

    def test_text_of_a_goal_that_another_one_is_accepted_for(self):
        self.serve(goal_cb=self.accept)
        older = self.send_active(1)
        self.send_active(2)
        self.expect(older, PREEMPTED, "a newer goal came")

    def test_text_of_a_goal_that_was_cancelled_before_it_came(self):
        self.serve(self.work_until_free)
        self.client.cancel("early")
        self.client.wait(lambda: "early" in self.client.states, "a status that lists the cancel")
        self.client.send(1, goal_id="early")
        self.expect("early", RECALLED, "cancelled before it was started")

    # What the program does wrong

    def test_execute_cb_without_outcome_is_aborted_and_logged(self):
        self.serve(lambda _: None)
        self.expect(self.client.send(0), ABORTED, "execute_cb returned without a terminal state")
        self.wait_log(f"{self.name}: execute_cb returned without a terminal state", Log.WARN)

    @parameterized.expand([("ValueError", ValueError), ("SystemExit", SystemExit)])
    def test_execute_cb_that_raises_is_aborted_and_logged(self, _, error):
        def execute_cb(goal):
            if goal.number_of_minutes:
                raise error("out of soap")
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.check_failure("execute_cb", error, ABORTED)

    @parameterized.expand([
        ("ValueError_before_it_accepts", ValueError, False, RECALLED),
        ("SystemExit_before_it_accepts", SystemExit, False, RECALLED),
        ("ValueError_after_it_accepted", ValueError, True, ABORTED)])
    def test_goal_callback_that_raises_ends_its_goal(self, _, error, accepts, state):
        errors = [error("out of soap")]

        def goal_cb():
            if accepts or not errors:
                self.server.accept_new_goal()
            if errors:
                raise errors.pop()
            self.server.set_succeeded()

        self.serve(goal_cb=goal_cb)
        self.check_failure("the goal callback", error, state)

    def check_failure(self, what, error, state):
        """Send goal 1, whose callback raises, and goal 0, which succeeds. what: the callback, in texts."""
        self.expect(self.client.send(1), state, f"{what} failed: {error.__name__}: out of soap")
        self.wait_log(f"{self.name}: {what} failed\nTraceback", Log.ERROR)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_result_that_cannot_be_sent_is_aborted(self):
        self.serve(lambda goal: self.server.set_succeeded(WashTheDishesResult([7] * goal.number_of_minutes)))
        message = self.expect(self.client.send(1), ABORTED)
        self.assertRegex(message.status.text, "^the result cannot be sent: .+")
        self.expect(self.client.send(0), SUCCEEDED)

    @parameterized.expand([("wrong_field", WashTheDishesFeedback(7)), ("none", None)])
    def test_feedback_that_cannot_be_sent_raises_and_spoils_nothing(self, _, wrong):
        def execute_cb(_):
            with self.assertRaises(rospy.ROSSerializationException):
                self.server.publish_feedback(wrong)
            self.server.publish_feedback(WashTheDishesFeedback("bowl-0"))
            self.server.set_succeeded(WashTheDishesResult(bowls(1)))

        self.serve(execute_cb)
        self.client.check_outcome(self.client.send(1), SUCCEEDED, bowls(1))

    # Log

    @parameterized.expand([
        ("execute_cb_that_returns", {"execute_cb": lambda _: None}),
        ("execute_cb_that_raises", {"execute_cb": lambda _: 1 / 0}),
        ("goal_callback_that_raises", {"goal_cb": lambda: 1 / 0})])
    def test_server_is_not_locked_while_a_line_is_logged_of_an(self, _, callbacks):
        answers, handler = [], logging.Handler(logging.WARNING)
        handler.emit = lambda _: answers.append(in_thread(self.server.action_server.publish_status))
        logging.getLogger("rosout").addHandler(handler)
        self.addCleanup(logging.getLogger("rosout").removeHandler, handler)
        self.serve(**callbacks)
        self.client.send(0)
        eventually(lambda: answers, "a line of log", self.client)
        self.assertNotIn("waits", answers)

    def test_start_and_outcomes_are_not_logged_above_debug(self):
        self.serve(self.work_until_free)
        self.expect(self.client.send(0), SUCCEEDED)
        self.client.cancel(self.send_active(1))
        self.send_waiting(2)
        newest = self.client.send(0)
        self.free.set()
        self.expect(newest, SUCCEEDED)
        rospy.loginfo(f"the end of {self.name}")
        self.wait_log(f"the end of {self.name}", Log.INFO)
        self.assertEqual([f"the end of {self.name}"], [line.msg for line in self.log if self.name in line.msg])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_server", "robust_server_test")
