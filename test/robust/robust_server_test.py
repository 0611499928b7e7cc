#!/usr/bin/env python3
"""robust.SimpleActionServer: one test for each thing that it does other than actionlib's, seen on the action's topics.

The client is a RawClient, which sends plain messages. What the server does is the execute_cb in each test.
"""
import logging
import os
import sys
import threading
import time
import unittest

import actionlib
from rosgraph_msgs.msg import Log
import rospy
import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.printed import bowls
from support.processes import Process, eventually
from support.raw_client import RawClient
from support.states import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED


class TestRobustServer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("robust_server_test")
        cls.log = []  # Log
        rospy.Subscriber("/rosout", Log, lambda line: cls.log.append(line) if line.name == rospy.get_name() else None)

    def setUp(self):
        self.namespace = "/" + self.id().split(".")[-1]
        self.name = self.namespace + "/wash_dishes_as"
        self.started = []  # number_of_minutes of each goal that work() was called with
        self.slept = []  # what its sleep() returned
        self.free = threading.Event()  # for work_until_free()

    def serve(self, execute_cb=None, goal_cb=None, preempt_cb=None, kind=robust.SimpleActionServer):
        """Start a server, with goal_cb instead of execute_cb if that is given, and connect self.client."""
        self.server = kind(self.name, WashTheDishesAction, execute_cb, auto_start=False)
        if goal_cb:
            self.server.register_goal_callback(goal_cb)
        self.server.register_preempt_callback(preempt_cb)
        self.server.start()
        self.client = RawClient(self.namespace)
        self.addCleanup(self.client.close)
        self.client.wait_connected()

    def work(self, goal):
        """An execute_cb: 0 minutes SUCCEED at once, others sleep on the server's rate for 100 s or until stopped."""
        self.started.append(goal.number_of_minutes)
        if goal.number_of_minutes:
            self.slept.append(self.server.rate(0.01).sleep())
            self.server.set_preempted(WashTheDishesResult(bowls(goal.number_of_minutes)))
        else:
            self.server.set_succeeded()

    def work_until_free(self, goal):
        """An execute_cb that does not stop before self.free is set."""
        self.started.append(goal.number_of_minutes)
        self.free.wait(30)
        self.server.set_preempted()

    def accept_and_work(self):
        """A goal callback that leaves the work to a thread."""
        goal = self.server.accept_new_goal()
        threading.Thread(target=self.work, args=[goal], daemon=True).start()

    def send_active(self, number_of_minutes, **options):
        """Send a goal and wait until it is ACTIVE. Returns its id."""
        goal = self.client.send(number_of_minutes, **options)
        self.client.wait(lambda: ACTIVE in self.client.states.get(goal, []), "%s ACTIVE" % goal)
        eventually(lambda: number_of_minutes in self.started, "the goal started", self.client)
        return goal

    def expect(self, goal, state, text=None):
        """Wait for the outcome of a goal: its state and, if given, its whole text. Returns the message."""
        message = self.client.wait_result(goal)
        self.assertEqual(state, message.status.status, self.client)
        if text is not None:
            self.assertEqual(text, message.status.text)
        return message

    def wait_log(self, text, level=Log.INFO):
        """Wait for a line of log that holds text."""
        eventually(lambda: any(text in one.msg and one.level == level for one in list(self.log)), "log: " + text)

    # Start

    def test_handle_gives_default_texts(self):
        outcomes = {}

        def goal_cb():
            goal = self.server.accept_new_goal()
            outcomes[goal.number_of_minutes]()

        self.serve(goal_cb=goal_cb)
        outcomes.update({1: lambda: self.server.current_goal.set_succeeded(),
                         2: lambda: self.server.current_goal.set_aborted(),
                         3: lambda: self.server.current_goal.set_canceled()})
        for minutes, state, text in (1, SUCCEEDED, "all done"), (2, ABORTED, "the server gave up"), (
                3, PREEMPTED, "preempted by the server"):
            self.expect(self.client.send(minutes), state, text)

    def test_burst_of_300_goals_gives_300_outcomes(self):
        self.serve(self.work)
        goals = [self.client.send(0) for _ in range(300)]
        for goal in goals:
            self.assertIn(self.client.wait_result(goal).status.status, (SUCCEEDED, RECALLED, PREEMPTED))
        self.expect(goals[-1], SUCCEEDED)

    def test_second_start_does_nothing(self):
        self.serve(self.work)
        self.server.start()
        stamps = set()
        rospy.Subscriber(self.name + "/status", type(self.client.status), lambda one: stamps.add(one.header.stamp))
        rospy.sleep(2)
        self.assertTrue(5 < len(stamps) < 15, "%d statuses in 2 s, should be 5 a second" % len(stamps))

    def test_server_is_an_actionlib_server(self):
        self.serve(self.work)
        self.assertIsInstance(self.server, actionlib.SimpleActionServer)

    def test_shutdown_timeout_below_0_is_a_value_error(self):
        for wrong in -1, float("nan"):
            with self.assertRaises(ValueError):
                robust.SimpleActionServer(self.name, WashTheDishesAction, self.work, False, shutdown_timeout=wrong)

    # rate

    def test_rate_sleeps_its_period_and_returns_true(self):
        seconds = []

        def execute_cb(_):
            rate, begun = self.server.rate(10), time.monotonic()
            for _ in range(10):
                self.slept.append(rate.sleep())
                time.sleep(0.05)  # work, which is no drift
            seconds.append(time.monotonic() - begun)
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([True] * 10, self.slept)
        self.assertGreater(seconds[0], 0.99)
        self.assertLess(seconds[0], 1.4)

    def test_cancel_wakes_rate(self):
        self.serve(self.work)
        goal = self.send_active(2)
        self.client.cancel(goal)
        self.assertEqual(bowls(2), self.expect(goal, PREEMPTED).result.dishes_washed)
        self.assertEqual([False], self.slept)

    def test_loop_that_goes_on_after_a_cancel_keeps_its_pace(self):
        seconds = []

        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            rate = self.server.rate(20)
            while rate.sleep():
                pass
            begun = time.monotonic()
            self.slept += [rate.sleep() for _ in range(10)]  # it slows down
            seconds.append(time.monotonic() - begun)
            self.server.set_preempted()

        self.serve(execute_cb)
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.assertEqual([False] * 10, self.slept)
        self.assertGreater(seconds[0], 0.4)

    def test_rate_made_anew_in_each_turn_keeps_its_pace(self):
        seconds = []

        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            while self.server.rate(20).sleep():
                pass
            begun = time.monotonic()
            self.slept += [self.server.rate(20).sleep() for _ in range(10)]  # it slows down
            seconds.append(time.monotonic() - begun)
            self.server.set_preempted()

        self.serve(execute_cb)
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.assertEqual([False] * 10, self.slept)
        self.assertGreater(seconds[0], 0.4)

    def test_cancel_is_answered_once_in_each_thread(self):
        def sleep():
            self.slept.append(self.server.rate(0.01).sleep())

        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            thread = threading.Thread(target=sleep, daemon=True)
            thread.start()
            thread.join(10)
            sleep()
            self.server.set_preempted()

        self.serve(execute_cb)
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.assertEqual([False, False], self.slept)

    def test_newer_goal_wakes_rate(self):
        self.serve(self.work)
        older = self.send_active(2)
        newer = self.client.send(0)
        self.assertEqual(bowls(2), self.expect(older, PREEMPTED).result.dishes_washed)
        self.expect(newer, SUCCEEDED)
        self.assertEqual([False], self.slept)

    def test_cancel_wakes_rate_of_a_server_with_goal_callback(self):
        self.serve(goal_cb=self.accept_and_work)
        goal = self.send_active(2)
        self.client.cancel(goal)
        self.assertEqual(bowls(2), self.expect(goal, PREEMPTED).result.dishes_washed)

    def test_goal_callback_may_wait_until_the_older_goal_stops(self):
        self.check_waiting_callback("goal_cb")

    def test_preempt_callback_may_wait_until_the_goal_stops(self):
        self.check_waiting_callback("preempt_cb")

    def check_waiting_callback(self, name):
        """A newer goal comes. The callback of this name waits until the rate of the older one has woken."""
        woke = threading.Event()

        def work():
            self.slept.append(self.server.rate(0.01).sleep())
            woke.set()

        def goal_cb():
            if self.started and name == "goal_cb":
                self.slept.append(woke.wait(10))
            goal = self.server.accept_new_goal()
            if goal.number_of_minutes:
                threading.Thread(target=work, daemon=True).start()
                self.started.append(goal.number_of_minutes)
            else:
                self.server.set_succeeded()

        self.serve(goal_cb=goal_cb, preempt_cb=lambda: self.slept.append(woke.wait(10)) if name != "goal_cb" else None)
        older = self.send_active(2)
        newer = self.client.send(0)
        self.expect(older, PREEMPTED, "a newer goal came")
        self.expect(newer, SUCCEEDED)
        self.assertEqual([False, True], self.slept)

    def test_rate_of_a_goal_that_another_thread_ended_wakes(self):
        def goal_cb():
            self.server.accept_new_goal()
            threading.Thread(target=lambda: self.slept.append(self.server.rate(0.01).sleep()), daemon=True).start()
            self.started.append(1)

        self.serve(goal_cb=goal_cb)
        goal = self.send_active(1)
        self.assertEqual([], self.slept)
        self.server.set_aborted()
        self.expect(goal, ABORTED)
        eventually(lambda: self.slept == [False], "a rate that woke", self.client, timeout=10)

    def test_rate_of_a_replaced_goal_is_false_after_its_step(self):
        step = threading.Event()

        def work():
            rate = self.server.rate(20)
            self.started.append(2)
            step.wait(30)
            self.slept.append(rate.sleep())

        def goal_cb():
            if self.server.accept_new_goal().number_of_minutes == 2:
                threading.Thread(target=work, daemon=True).start()

        self.serve(goal_cb=goal_cb)
        self.send_active(2)
        newer = self.client.send(1)
        self.client.wait(lambda: ACTIVE in self.client.states.get(newer, []), "the newer goal is ACTIVE")
        step.set()
        eventually(lambda: self.slept == [False], "a rate that says so", self.client, timeout=10)

    def test_cancel_wakes_rate_after_that_of_a_replaced_goal(self):
        self.serve(goal_cb=lambda: self.started.append(self.server.accept_new_goal().number_of_minutes))
        self.send_active(1)
        older_rate = self.server.rate(0.01)
        goal = self.send_active(2)
        self.assertFalse(older_rate.sleep())
        rate = self.server.rate(0.01)
        threading.Thread(target=lambda: self.slept.append(rate.sleep()), daemon=True).start()
        self.client.cancel(goal)
        eventually(lambda: self.slept == [False], "a rate that woke", self.client, timeout=10)

    def test_rate_made_before_the_first_goal_serves_all(self):
        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            self.slept.append(rate.sleep())
            while goal.number_of_minutes and rate.sleep():
                pass
            (self.server.set_preempted if goal.number_of_minutes else self.server.set_succeeded)()

        self.serve(execute_cb)
        rate = self.server.rate(20)
        for _ in range(2):
            self.expect(self.client.send(0), SUCCEEDED)
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.assertEqual([True, True], self.slept[:2])

    def test_preempt_request_of_the_program_wakes_rate(self):
        self.serve(self.work)
        goal = self.send_active(2)
        self.server.preempt_request = True
        self.expect(goal, PREEMPTED, "preempted by the server")
        self.assertEqual([False], self.slept)

    def test_goal_after_a_cancelled_one_sleeps_its_period(self):
        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            self.slept.append(self.server.rate(0.01 if goal.number_of_minutes else 10).sleep())
            (self.server.set_succeeded if self.slept[-1] else self.server.set_preempted)()

        self.serve(execute_cb)
        goal = self.send_active(2)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([False, True], self.slept)

    def test_is_preempt_requested_after_a_cancel(self):
        asked = []

        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            asked.append(self.server.is_preempt_requested())
            self.server.rate(0.01).sleep()
            asked.append(self.server.is_preempt_requested())
            self.server.set_preempted()

        self.serve(execute_cb)
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.assertEqual([False, True], asked)

    # Outcomes

    def test_execute_cb_without_outcome_is_aborted_and_logged(self):
        self.serve(lambda goal: None)
        message = self.expect(self.client.send(0), ABORTED)
        self.assertIn("returned without a terminal state", message.status.text)
        self.wait_log(self.name + ": execute_cb returned without a terminal state", Log.WARN)

    def test_execute_cb_that_raises_is_aborted_and_next_goal_served(self):
        for error in ValueError("out of soap"), SystemExit("out of soap"), KeyboardInterrupt("out of soap"):
            self.namespace = "/raises_" + type(error).__name__
            self.name = self.namespace + "/wash_dishes_as"

            def execute_cb(goal):
                if goal.number_of_minutes:
                    raise error
                self.server.set_succeeded()

            self.serve(execute_cb)
            message = self.expect(self.client.send(1), ABORTED)
            self.assertIn("%s: out of soap" % type(error).__name__, message.status.text)
            self.wait_log("%s: execute_cb failed\nTraceback" % self.name, Log.ERROR)
            self.expect(self.client.send(0), SUCCEEDED)

    def test_result_that_cannot_be_sent_is_aborted_with_the_reason(self):
        wrong = [WashTheDishesResult([7]), WashTheDishesResult(7), WashTheDishesResult([None])]
        ends = "set_succeeded", "set_aborted", "set_preempted"

        def execute_cb(goal):
            if goal.number_of_minutes < 3:
                getattr(self.server, ends[goal.number_of_minutes])(wrong[goal.number_of_minutes])
            else:
                self.server.set_succeeded(WashTheDishesResult(["whole"]))

        self.serve(execute_cb)
        for number in range(3):
            message = self.expect(self.client.send(number), ABORTED)
            self.assertRegex(message.status.text, "the result cannot be sent: .+")
            self.assertEqual(["whole"], self.expect(self.client.send(3), SUCCEEDED).result.dishes_washed)

    def test_feedback_that_cannot_be_sent_raises_and_spoils_nothing(self):
        def execute_cb(_):
            with self.assertRaises(rospy.ROSSerializationException):
                self.server.publish_feedback(WashTheDishesFeedback(7))
            self.server.publish_feedback(WashTheDishesFeedback("bowl-0"))
            self.server.set_succeeded(WashTheDishesResult(bowls(1)))

        self.serve(execute_cb)
        self.client.check_outcome(self.client.send(1), SUCCEEDED, bowls(1))

    def test_feedback_none_raises_and_spoils_nothing(self):
        def execute_cb(_):
            with self.assertRaises(rospy.ROSSerializationException):
                self.server.publish_feedback(None)
            self.server.publish_feedback(WashTheDishesFeedback("bowl-0"))
            self.server.set_succeeded(WashTheDishesResult(bowls(1)))

        self.serve(execute_cb)
        self.client.check_outcome(self.client.send(1), SUCCEEDED, bowls(1))

    def test_need_to_terminate_ends_the_thread_of_execute_cb(self):
        self.serve(self.work)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.need_to_terminate = True
        self.server.execute_thread.join(10)
        self.assertFalse(self.server.execute_thread.is_alive())
        goal = self.client.send(0)
        self.client.wait(lambda: goal in self.client.states, "the goal in the status")
        self.assertEqual([0], self.started)

    def test_del_in_execute_cb_ends_its_thread_afterwards(self):
        def execute_cb(_):
            self.server.__del__()
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.execute_thread.join(10)
        self.assertFalse(self.server.execute_thread.is_alive())

    def test_constructor_that_fails_says_nothing_else(self):
        program = Process([sys.executable, "-c", """if True:
            from actions_tutorial import msg, robust
            import threading
            for kind, timeout in (int, 1), (msg.WashTheDishesAction, -1), (msg.WashTheDishesAction, 1):
                try:
                    threading.stack_size(1 << 45 if timeout == 1 else 0)  # no thread can be started
                    robust.SimpleActionServer("fails", kind, print, False, shutdown_timeout=timeout)
                except Exception as error:
                    print(type(error).__name__)"""])
        self.addCleanup(program.stop)
        self.assertEqual(0, program.wait(), program)
        self.assertEqual(["ActionException", "ValueError", "RuntimeError"], program.stdout.split())
        self.assertEqual("", program.stderr)

    def test_server_stopped_during_a_goal_can_start_again(self):
        def execute_cb(goal):
            if goal.number_of_minutes:
                self.server.action_server.stop()
                self.server.publish_feedback(WashTheDishesFeedback("bowl-0"))  # which raises
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.client.send(1)
        eventually(lambda: not self.server.action_server.started, "a server that is stopped")
        self.client.close()
        self.server.start()
        self.client = RawClient(self.namespace)
        self.addCleanup(self.client.close)
        self.client.wait_connected()
        self.expect(self.client.send(0), SUCCEEDED)

    def test_text_that_utf8_cannot_hold_is_escaped(self):
        self.serve(lambda goal: self.server.set_aborted(text="soap \udcff, größer"))
        self.expect(self.client.send(0), ABORTED, "soap \\udcff, größer")

    def test_default_texts(self):
        def execute_cb(goal):
            self.started.append(goal.number_of_minutes)
            if goal.number_of_minutes == 9:
                self.server.rate(0.01).sleep()
            ends = self.server.set_succeeded, self.server.set_aborted, self.server.set_preempted
            ends[goal.number_of_minutes % 7]()

        self.serve(execute_cb)
        self.expect(self.client.send(0), SUCCEEDED, "all done")
        self.expect(self.client.send(1), ABORTED, "the server gave up")
        self.expect(self.client.send(2), PREEMPTED, "preempted by the server")
        goal = self.send_active(9)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED, "cancelled")
        self.started.clear()
        goal = self.send_active(9)
        self.client.send(0)
        self.expect(goal, PREEMPTED, "a newer goal came")

    def test_newer_goal_that_was_cancelled_is_still_the_reason(self):
        self.serve(self.work_until_free)
        older = self.send_active(1)
        newer = self.client.send(2)
        self.client.wait(lambda: newer in self.client.states, "a goal that waits")
        self.client.cancel(newer)
        self.expect(newer, RECALLED, "cancelled before it was started")
        self.free.set()
        self.expect(older, PREEMPTED, "a newer goal came")

    def test_cancel_that_comes_before_its_goal_is_the_reason(self):
        self.serve(self.work)
        self.client.cancel("early")
        self.client.wait(lambda: "early" in self.client.states, "a status that lists the cancel")
        self.client.send(1, goal_id="early")
        self.expect("early", RECALLED, "cancelled before it was started")
        self.assertEqual([], self.started)

    def test_goal_that_a_subclass_refuses_is_asked_for_with_pauses(self):
        asked = []

        class Refuses(robust.SimpleActionServer):

            def accept_new_goal(self):
                asked.append(time.monotonic())
                return super().accept_new_goal() if len(asked) > 20 else None

        self.serve(self.work, kind=Refuses)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertGreater(asked[20] - asked[0], 0.1)

    # Stamps and ids

    def test_goal_with_an_earlier_stamp_takes_over(self):
        self.serve(self.work)
        older = self.send_active(2)
        newer = self.client.send(0, stamp=rospy.Time.now() - rospy.Duration(100))
        self.expect(older, PREEMPTED)
        self.expect(newer, SUCCEEDED)

    def test_goal_after_one_with_a_stamp_in_the_future_is_served(self):
        self.serve(self.work)
        older = self.send_active(2, stamp=rospy.Time.now() + rospy.Duration(1000))
        self.expect(self.client.send(0), SUCCEEDED)
        self.expect(older, PREEMPTED)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_goal_after_a_cancel_stamped_in_the_future_is_served(self):
        self.serve(self.work)
        goal = self.send_active(2)
        self.client.cancel(stamp=rospy.Time.now() + rospy.Duration(1000))
        self.expect(goal, PREEMPTED)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_goal_stamped_before_a_future_cancel_is_recalled(self):
        self.serve(self.work)
        stamp = rospy.Time.now()
        goal = self.send_active(2)
        self.client.cancel(stamp=stamp + rospy.Duration(1000))
        self.expect(goal, PREEMPTED)
        self.expect(self.client.send(0, stamp=stamp), RECALLED)

    def test_repeated_id_is_logged_and_not_executed(self):
        self.serve(self.work)
        for _ in range(2):
            self.client.send(0, goal_id="twice\033[2J")
        self.wait_log(r"'twice\x1b[2J'", Log.WARN)
        self.expect("twice\033[2J", SUCCEEDED)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([0, 0], self.started)
        lines = [line.msg for line in self.log if self.name + ": goal ignored" in line.msg]
        self.assertEqual(1, len(lines), lines)

    # A goal that is over while it waits

    def test_waiting_goal_is_recalled_for_a_newer_one(self):
        self.serve(self.work_until_free)
        older = self.send_active(1)
        waiting = self.client.send(2)
        self.client.wait(lambda: waiting in self.client.states, "a goal that waits")
        self.client.send(3)
        self.expect(waiting, RECALLED, "a newer goal came")
        self.assertNotIn(older, self.client.results, "RECALLED at once")
        self.free.set()

    def test_stamp_of_a_goal_that_was_recalled_is_forgotten(self):
        self.serve(goal_cb=lambda: self.started.append("came"))
        waiting = self.client.send(1, stamp=rospy.Time.now() + rospy.Duration(1000))
        eventually(lambda: self.started, "a goal", self.client)
        self.client.cancel(waiting)
        self.expect(waiting, RECALLED)
        self.server.register_goal_callback(lambda: (self.server.accept_new_goal(), self.server.set_succeeded()))
        self.expect(self.client.send(0), SUCCEEDED)

    def test_accept_new_goal_of_a_goal_cancelled_is_none(self):
        self.serve(goal_cb=lambda: self.started.append("came"))
        goal = self.client.send(2)
        eventually(lambda: self.started, "a goal", self.client)
        self.client.cancel(goal)
        self.expect(goal, RECALLED)
        self.assertIsNone(self.server.accept_new_goal())
        self.assertFalse(self.server.is_new_goal_available())

    # Callbacks that raise

    def test_goal_callback_that_raises_before_it_accepts_is_recalled(self):
        self.check_goal_callback(False, RECALLED)

    def test_goal_callback_that_raises_after_it_accepted_is_aborted(self):
        self.check_goal_callback(True, ABORTED)

    def check_goal_callback(self, accepts, state):
        errors = [ValueError("out of soap"), SystemExit("out of soap"), None]

        def goal_cb():
            error = errors.pop(0)
            if accepts or not error:
                self.server.accept_new_goal()
            if error:
                raise error
            self.server.set_succeeded()

        self.serve(goal_cb=goal_cb)
        for kind in "ValueError", "SystemExit":
            message = self.expect(self.client.send(1), state)
            self.assertIn(kind + ": out of soap", message.status.text)
        self.wait_log("%s: the goal callback failed\nTraceback" % self.name, Log.ERROR)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_preempt_callback_that_raises_is_logged(self):
        def preempt_cb():
            raise SystemExit("no brake")

        self.serve(self.work, preempt_cb=preempt_cb)
        goal = self.send_active(2)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        self.wait_log("no brake", Log.ERROR)
        self.expect(self.client.send(0), SUCCEEDED)

    # Log

    def test_log_handler_may_wait_for_a_call_of_the_server(self):
        active = []

        class Handler(logging.Handler):
            def emit(_, record):
                if "without a terminal state" in record.getMessage():
                    thread = threading.Thread(target=lambda: active.append(self.server.is_active()))
                    thread.start()
                    thread.join(5)
                    active.append("logged")

        handler = Handler()
        logging.getLogger("rosout").addHandler(handler)
        self.addCleanup(logging.getLogger("rosout").removeHandler, handler)
        self.serve(lambda goal: None)
        self.expect(self.client.send(0), ABORTED)
        eventually(lambda: len(active) == 2, "a line of log", self.client)
        self.assertEqual([False, "logged"], active)

    def test_start_and_outcomes_are_not_logged_above_debug(self):
        self.serve(self.work)
        self.expect(self.client.send(0), SUCCEEDED)
        older = self.send_active(1)
        goal = self.send_active(2)
        self.expect(older, PREEMPTED)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED)
        rospy.loginfo("the end of " + self.name)
        self.wait_log("the end of " + self.name)
        self.assertEqual(["the end of " + self.name], [line.msg for line in self.log if self.name in line.msg])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_server", TestRobustServer)
