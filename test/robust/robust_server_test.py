#!/usr/bin/env python3
"""robust.SimpleActionServer: one test for each thing that it does other than actionlib's, seen on the action's topics.

What the server does is the execute_cb or goal callback in each test. robust_action.test has what users of any server
expect: a cancel, a newer goal, a goal cancelled before it comes.
"""
import contextlib
import io
import logging
import os
import sys
import threading
import time

from parameterized import parameterized
from rosgraph_msgs.msg import Log
import rospy
import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.printed import bowls
from support.processes import eventually
from support.server_case import ServerCase
from support.states import ABORTED, PREEMPTED, RECALLED, SUCCEEDED


class TestRobustServer(ServerCase):

    library = robust

    def setUp(self):
        super().setUp()
        self.slept = []  # what sleep() of a rate returned

    def work(self, goal):
        """An execute_cb: 0 minutes SUCCEED at once, others sleep on the server's rate for 100 s or until stopped."""
        self.started.append(goal.number_of_minutes)
        if goal.number_of_minutes:
            self.server.rate(0.01).sleep()
            self.server.set_preempted()
        else:
            self.server.set_succeeded()

    def send_and_cancel(self, number_of_minutes):
        """Send a goal, cancel it when it is ACTIVE, and expect it PREEMPTED."""
        goal = self.send_active(number_of_minutes)
        self.client.cancel(goal)
        self.expect(goal, PREEMPTED, "cancelled")

    # Start and end of a server

    @parameterized.expand([("below_0", -1), ("nan", float("nan"))])
    def test_wrong_shutdown_timeout_raises_and_prints_nothing(self, _, timeout):
        with contextlib.redirect_stderr(io.StringIO()) as stderr:  # Python prints there what __del__ raises
            with self.assertRaises(ValueError):
                robust.SimpleActionServer(self.name, WashTheDishesAction, print, False, shutdown_timeout=timeout)
        self.assertEqual("", stderr.getvalue())

    def test_second_start_does_nothing(self):
        self.serve(self.work)
        self.server.start()
        stamps = []
        rospy.Subscriber(self.name + "/status", type(self.client.status), lambda one: stamps.append(one.header.stamp))
        eventually(lambda: len(stamps) >= 10, "ten statuses")
        self.assertGreater((stamps[9] - stamps[0]).to_sec(), 1.3, "a status each 0.2 s")

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
        self.connect()
        self.expect(self.client.send(0), SUCCEEDED)

    def test_need_to_terminate_ends_the_thread_of_execute_cb(self):
        self.serve(self.work)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.need_to_terminate = True
        self.server.execute_thread.join(10)
        self.assertFalse(self.server.execute_thread.is_alive())

    def test_del_in_execute_cb_ends_its_thread_afterwards(self):
        def execute_cb(_):
            self.server.__del__()
            self.server.set_succeeded()

        self.serve(execute_cb)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.execute_thread.join(10)
        self.assertFalse(self.server.execute_thread.is_alive())

    # rate

    def test_rate_sleeps_its_period_and_returns_true(self):
        self.serve(self.work)
        rate, begun = self.server.rate(10), time.monotonic()
        for _ in range(10):
            self.assertIs(True, rate.sleep())
            time.sleep(0.05)  # work, which is no drift
        self.assertTrue(0.99 < time.monotonic() - begun < 1.4)

    @parameterized.expand([("one_rate", False), ("a_rate_in_each_turn", True)])
    def test_loop_after_a_cancel_keeps_its_pace(self, _, anew):
        seconds = []

        def execute_cb(goal):
            def sleep():
                return (self.server.rate(20) if anew else rate).sleep()

            self.started.append(goal.number_of_minutes)
            rate = self.server.rate(20)
            while sleep():
                pass
            begun = time.monotonic()
            self.slept += [sleep() for _ in range(10)]  # as a robot that slows down; each takes its period
            seconds.append(time.monotonic() - begun)
            self.server.set_preempted()

        self.serve(execute_cb)
        self.send_and_cancel(1)
        self.assertEqual([False] * 10, self.slept)
        self.assertGreater(seconds[0], 0.4)

    def test_cancel_ends_a_sleep_at_once_in_each_thread(self):
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
        self.send_and_cancel(1)
        self.assertEqual([False, False], self.slept)

    @parameterized.expand([
        ("a_cancel", lambda self, goal: self.client.cancel(goal)),
        ("a_newer_goal", lambda self, goal: self.client.send(2)),
        ("an_outcome", lambda self, goal: self.server.set_aborted()),
        ("preempt_request_of_the_program", lambda self, goal: setattr(self.server, "preempt_request", True))])
    def test_rate_in_another_thread_wakes_for(self, _, act):
        self.serve(goal_cb=self.accept)
        goal, rate = self.send_active(1), self.server.rate(0.01)
        thread = threading.Thread(target=lambda: self.slept.append(rate.sleep()), daemon=True)
        thread.start()
        thread.join(0.2)
        self.assertEqual([], self.slept)
        act(self, goal)
        thread.join(10)
        self.assertEqual([False], self.slept)

    def test_rate_of_a_replaced_goal_is_false_and_the_next_true(self):
        self.serve(goal_cb=self.accept)
        self.send_active(1)
        older = self.server.rate(0.01)
        self.send_active(2)
        newer = self.server.rate(20)
        self.assertEqual([False, True], [older.sleep(), newer.sleep()])

    def test_rate_made_before_the_first_goal_serves_all(self):
        self.serve(goal_cb=self.accept)
        rate = self.server.rate(20)
        for number in 1, 2:
            goal = self.send_active(number)
            self.assertTrue(rate.sleep())
            self.client.cancel(goal)
            eventually(lambda: not rate.sleep(), "a rate that is False", self.client)
            self.server.set_preempted()
            self.expect(goal, PREEMPTED)

    @parameterized.expand(["goal_callback", "preempt_callback"])
    def test_callback_may_wait_until_the_older_goal_stops(self, waiting):
        woke = threading.Event()

        def work():
            self.slept.append(self.server.rate(0.01).sleep())
            woke.set()

        def goal_cb():
            if self.started and waiting == "goal_callback":
                self.slept.append(woke.wait(10))
            self.accept()
            if self.started == [2]:
                threading.Thread(target=work, daemon=True).start()
            else:
                self.server.set_succeeded()

        def preempt_cb():
            if waiting == "preempt_callback":
                self.slept.append(woke.wait(10))

        self.serve(goal_cb=goal_cb, preempt_cb=preempt_cb)
        older = self.send_active(2)
        newer = self.client.send(0)
        self.expect(older, PREEMPTED, "a newer goal came")
        self.expect(newer, SUCCEEDED)
        self.assertEqual([False, True], self.slept)

    # Outcomes

    @parameterized.expand([
        ("succeeded", lambda server: server.set_succeeded(), SUCCEEDED, "all done"),
        ("aborted", lambda server: server.set_aborted(), ABORTED, "the server gave up"),
        ("preempted_unasked", lambda server: server.set_preempted(), PREEMPTED, "preempted by the server"),
        ("by_its_handle", lambda server: server.current_goal.set_aborted(), ABORTED, "the server gave up"),
        ("that_utf8_cannot_hold", lambda server: server.set_aborted(text="soap \udcff, größer"),
         ABORTED, "soap \\udcff, größer")])
    def test_outcome_has_a_text(self, _, end, state, text):
        self.serve(lambda _: end(self.server))
        self.expect(self.client.send(0), state, text)

    def test_text_of_a_goal_that_was_cancelled_before_it_came(self):
        self.serve(self.work)
        self.client.cancel("early")
        self.client.wait(lambda: "early" in self.client.states, "a status that lists the cancel")
        self.client.send(1, goal_id="early")
        self.expect("early", RECALLED, "cancelled before it was started")

    def test_execute_cb_without_outcome_is_aborted_and_logged(self):
        self.serve(lambda _: None)
        self.expect(self.client.send(0), ABORTED, "execute_cb returned without a terminal state")
        self.wait_log(self.name + ": execute_cb returned without a terminal state", Log.WARN)

    @parameterized.expand([
        ("set_succeeded", WashTheDishesResult([7])),
        ("set_aborted", WashTheDishesResult(7)),
        ("set_preempted", WashTheDishesResult([None]))])
    def test_result_that_cannot_be_sent_is_aborted(self, end, wrong):
        def execute_cb(goal):
            if goal.number_of_minutes:
                getattr(self.server, end)(wrong)
            else:
                self.server.set_succeeded(WashTheDishesResult(bowls(1)))

        self.serve(execute_cb)
        message = self.expect(self.client.send(1), ABORTED)
        self.assertRegex(message.status.text, "^the result cannot be sent: .+")
        self.assertEqual(bowls(1), self.expect(self.client.send(0), SUCCEEDED).result.dishes_washed)

    @parameterized.expand([("wrong_field", WashTheDishesFeedback(7)), ("none", None)])
    def test_feedback_that_cannot_be_sent_raises_and_spoils_nothing(self, _, wrong):
        def execute_cb(_):
            with self.assertRaises(rospy.ROSSerializationException):
                self.server.publish_feedback(wrong)
            self.server.publish_feedback(WashTheDishesFeedback("bowl-0"))
            self.server.set_succeeded(WashTheDishesResult(bowls(1)))

        self.serve(execute_cb)
        self.client.check_outcome(self.client.send(1), SUCCEEDED, bowls(1))

    def test_burst_of_300_goals_gives_300_outcomes(self):
        self.serve(self.work)
        goals = [self.client.send(0) for _ in range(300)]
        for goal in goals:
            self.assertIn(self.client.wait_result(goal).status.status, (SUCCEEDED, RECALLED, PREEMPTED))
        self.expect(goals[-1], SUCCEEDED)

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

    @parameterized.expand([("earlier_than_the_older_goal", 0, -100), ("while_the_older_is_from_the_future", 1000, 0)])
    def test_goal_that_comes_last_takes_over(self, _, older_stamp, newer_stamp):
        self.serve(self.work)
        now = rospy.Time.now()
        older = self.send_active(2, stamp=now + rospy.Duration(older_stamp))
        newer = self.client.send(0, stamp=now + rospy.Duration(newer_stamp))
        self.expect(older, PREEMPTED)
        self.expect(newer, SUCCEEDED)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_cancel_stamped_in_the_future_cancels_goals_up_to_now(self):
        self.serve(self.work)
        before = rospy.Time.now()
        goal = self.send_active(2)
        self.client.cancel(stamp=before + rospy.Duration(1000))
        self.expect(goal, PREEMPTED)
        self.expect(self.client.send(0, stamp=before), RECALLED)
        self.expect(self.client.send(0), SUCCEEDED)

    def test_repeated_id_is_logged(self):
        self.serve(self.work)
        for _ in range(2):
            self.client.send(0, goal_id="twice\033[2J")
        self.wait_log(self.name + r": goal ignored: a goal with its id 'twice\x1b[2J' came before", Log.WARN)

    # A goal that is over while it waits

    @parameterized.expand([
        ("a_newer_goal", lambda client, _: client.send(3), "a newer goal came"),
        ("a_cancel", lambda client, waiting: client.cancel(waiting), "cancelled before it was started")])
    def test_goal_that_waits_is_recalled_at_once_for(self, _, act, text):
        self.serve(self.work_until_free)
        older, waiting = self.send_active(1), self.send_waiting(2)
        act(self.client, waiting)
        self.expect(waiting, RECALLED, text)
        self.assertNotIn(older, self.client.results)
        self.free.set()
        self.expect(older, PREEMPTED, "a newer goal came")

    def test_goal_that_was_recalled_is_forgotten(self):
        self.serve(goal_cb=lambda: self.started.append("came"))
        waiting = self.client.send(1, stamp=rospy.Time.now() + rospy.Duration(1000))  # later than the next one's
        eventually(lambda: self.started, "a goal", self.client)
        self.client.cancel(waiting)
        self.expect(waiting, RECALLED)
        self.assertIsNone(self.server.accept_new_goal())
        self.assertFalse(self.server.is_new_goal_available())
        self.server.register_goal_callback(self.accept)
        self.send_active(2)

    # Callbacks that raise

    def check_failure(self, what, error, state):
        """Send goal 1, whose callback raises, and goal 0, which succeeds. what: the callback, in texts."""
        self.expect(self.client.send(1), state, "%s failed: %s: out of soap" % (what, error.__name__))
        self.wait_log("%s: %s failed\nTraceback" % (self.name, what), Log.ERROR)
        self.expect(self.client.send(0), SUCCEEDED)

    @parameterized.expand([
        ("ValueError", ValueError), ("SystemExit", SystemExit), ("KeyboardInterrupt", KeyboardInterrupt)])
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
        ("ValueError_after_it_accepted", ValueError, True, ABORTED),
        ("SystemExit_after_it_accepted", SystemExit, True, ABORTED)])
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

    def test_preempt_callback_that_raises_is_logged(self):
        def preempt_cb():
            raise SystemExit("no brake")

        self.serve(self.work, preempt_cb=preempt_cb)
        self.send_and_cancel(2)
        self.wait_log("%s: the preempt callback failed\nTraceback" % self.name, Log.ERROR)
        self.expect(self.client.send(0), SUCCEEDED)

    # Log

    def on_warning(self, call):
        """Have call() called while the warning of an execute_cb without outcome is logged."""
        handler = logging.Handler()
        handler.emit = lambda record: call() if "without a terminal state" in record.getMessage() else None
        logging.getLogger("rosout").addHandler(handler)
        self.addCleanup(logging.getLogger("rosout").removeHandler, handler)

    def test_log_handler_may_wait_for_a_call_of_the_server(self):
        waits = []

        def ask():
            thread = threading.Thread(target=self.server.is_active, daemon=True)
            thread.start()
            thread.join(5)
            waits.append(thread.is_alive())

        self.on_warning(ask)
        self.serve(lambda _: None)
        self.expect(self.client.send(0), ABORTED)
        eventually(lambda: waits, "a line of log", self.client)
        self.assertEqual([False], waits)

    def test_log_that_raises_affects_no_goal(self):
        def fail():
            raise BrokenPipeError("as with a closed terminal")

        self.on_warning(fail)
        self.serve(lambda _: None)
        for _ in range(2):
            self.expect(self.client.send(0), ABORTED)

    def test_start_and_outcomes_are_not_logged_above_debug(self):
        self.serve(self.work)
        self.expect(self.client.send(0), SUCCEEDED)
        older = self.send_active(1)
        self.send_and_cancel(2)
        self.expect(older, PREEMPTED)
        rospy.loginfo("the end of " + self.name)
        self.wait_log("the end of " + self.name, Log.INFO)
        self.assertEqual(["the end of " + self.name], [line.msg for line in self.log if self.name in line.msg])


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_server", TestRobustServer)
