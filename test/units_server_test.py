#!/usr/bin/python3
"""What a server does, and a rate, without a client."""
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import actionlib
import rospy
import rosunit
from actionlib.msg import TestAction, TestActionGoal, TestFeedback, TestResult
from actionlib.status_tracker import StatusTracker
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from std_msgs.msg import Float64

from actions_tutorial import robust
from actions_tutorial.robust import log, rate, server, shutdown
from processes import eventually
from units import Connection, UnitCase, is_free, send, take_up


def last_result(one):
    """Returns the last ActionResult that was sent."""
    return one.action_server.result_pub.impl.latch


def shown(one):
    """Returns the last status that was sent, as (id, state) of each goal."""
    return [(each.goal_id.id, each.status) for each in one.action_server.status_pub.impl.latch.status_list]


class ServerUnits(UnitCase):

    def test_period_begins_with_a_clock_that_begins_in_a_sleep_or_after_one_set_back_with_its_end_else_as_rospys(self):
        for begin, *seconds, end, next_begins in (
                (0, 0, 100, 100.5, 101, 101), (100, 10, 10.5, 11, 11), (100, 100.25, 203.5, 101)):
            rospy.rostime._set_rostime(rospy.Time(begin))
            looked, a_rate = [], rate.Rate(1, bool)
            a_rate.remaining = lambda a_rate=a_rate: looked.append(1) or rospy.Rate.remaining(a_rate)
            with ThreadPoolExecutor(1) as thread:
                slept = thread.submit(a_rate.sleep)
                for number, second in enumerate([*seconds, end]):
                    eventually(lambda: len(looked) > number, "a look at the clock")
                    self.assertFalse(slept.done(), "ended at %s" % second)
                    rospy.rostime._set_rostime(rospy.Time(second))
                self.assertTrue(slept.result(10))
            self.assertEqual(next_begins, a_rate.last_time.to_sec())
        for late in 1, 2.5, 3, 3.5, 100.5:  # it catches up if it is late by up to two periods
            rospy.rostime._set_rostime(rospy.Time(100))
            both = rate.Rate(1, bool), rospy.Rate(1)
            rospy.rostime._set_rostime(rospy.Time(100 + late))
            for one in both:
                one.sleep()
            self.assertEqual(*(one.last_time for one in both))

    def test_rate_asks_whether_to_stop_without_the_clock_s_lock_and_hears_whoever_wakes_it_meanwhile(self):
        def stop_requested():
            waker = shutdown.aside(rate.wake)  # which takes that lock
            waker.join(5)
            asked.append(waker.is_alive())
            return asked[1:]

        asked = []
        with mock.patch.object(rospy.rostime.get_rostime_cond(), "wait") as wait:
            self.assertFalse(rate.Rate(0.1, stop_requested).sleep())
        wait.assert_not_called()
        self.assertEqual([False, False], asked)

    def test_rate_sleeps_until_its_end_in_real_time_or_news_of_a_simulated_clock_and_does_not_poll(self):
        for clock in None, rospy.Time(1):
            with mock.patch.object(rospy.rostime, "_rostime_current", clock), \
                    mock.patch.object(rospy.rostime.get_rostime_cond(), "wait") as wait:
                self.assertFalse(rate.Rate(0.01, mock.Mock(side_effect=[False, True])).sleep())
            left, = (left for (left,), _ in wait.call_args_list)
            self.assertTrue(left is None if clock else 90 < left <= 100, left)

    def test_whoever_wakes_one_rate_wakes_all(self):
        def sleep():
            with clock:
                asleep.append(1)
                return clock.wait(10)

        clock, asleep = rospy.rostime.get_rostime_cond(), []
        with ThreadPoolExecutor(2) as threads:
            slept = [threads.submit(sleep) for _ in range(2)]
            eventually(lambda: len(asleep) == 2, "two that sleep")
            rate.wake()
            self.assertEqual([True, True], [one.result() for one in slept])

    def test_loop_of_a_server_waits_when_it_looked_in_vain_but_not_if_a_goal_came_meanwhile(self):
        for comes in False, True:
            one = self.server()
            one.is_new_goal_available = lambda: vars(one).update(new_goal=comes, need_to_terminate=True)  # none
            with mock.patch.object(one.execute_condition, "wait") as wait:
                one.executeLoop()
            self.assertEqual([] if comes else [mock.call(0.1)], wait.mock_calls)
        rospy.core._shutdown_flag = True  # before the server was started
        self.server().executeLoop()

    def test_server_that_its_subclass_or_program_starts_in_a_way_of_its_own_begins_once_and_ends_when_told(self):
        class Own(robust.SimpleActionServer):
            start = None  # it means something else by that

        for auto_start, end in (True, Own.__del__), (False, lambda one: setattr(one, "need_to_terminate", True)):
            with mock.patch.object(server._ActionServer, "initialize", autospec=True,
                                   side_effect=self.advertise) as initialize, \
                    mock.patch.object(robust.SimpleActionServer, "_SimpleActionServer__look_for_twins"):
                one = Own("work", TestAction, print, auto_start)
                self.addCleanup(setattr, one, "need_to_terminate", True)
                for _ in range(2):
                    one.action_server.start()
                initialize.assert_called_once()
                thread, one.action_server.started = one.execute_thread, False
                one.action_server.start()  # it was stopped
                self.assertIs(thread, one.execute_thread)
                Own("work", TestAction, print, False).__del__()
                other = Own("work", TestAction)
                self.addCleanup(setattr, other, "need_to_terminate", True)
                self.assertIsNone(other.execute_thread, "it would take the callback's goals")
            one.action_server.status_frequency = 7
            self.assertEqual((7, True), (one.action_server.status_frequency, one.execute_thread.is_alive()))
            shutdown.aside(end, one)
            eventually(lambda: not one.execute_thread.is_alive(), "an end")

    def test_loop_of_a_server_asks_a_subclass_without_a_lock_and_again_each_0_1_s_while_that_lets_a_goal_wait(self):
        def is_new_goal_available():
            free.append(is_free(one.execute_condition) and is_free(one.action_server.lock))
            one.need_to_terminate = len(free) == 2

        one, free = self.server(), []
        one.new_goal, one.is_new_goal_available = True, is_new_goal_available
        with mock.patch.object(one.execute_condition, "wait") as wait:
            one.executeLoop()
        wait.assert_called_with(0.1)
        self.assertEqual([True, True], free)

    def test_result_waits_until_feedback_is_through_but_not_after_a_cancel(self):
        for end, waits in ("set_succeeded", True), ("set_aborted", True), ("set_preempted", False):
            one, free = self.server(), []
            take_up(one)
            with mock.patch.object(server, "time", mock.Mock(  # no time passes, also on a busy machine
                    monotonic=lambda: 7.0, sleep=lambda _: free.append(is_free(one.action_server.lock)))):
                one.publish_feedback(TestFeedback())
                getattr(one, end)(text=end)
            self.assertEqual(end, last_result(one).status.text)
            self.assertEqual([False] * waits, free, "what comes meanwhile comes too late for " + end)

    def test_shutdown_ends_a_goal_aborted_that_no_client_has_cancelled_before(self):
        for cancel, state, text in ([], GoalStatus.ABORTED, "the server is shutting down: parked"), (
                [GoalID()], GoalStatus.PREEMPTED, "parked"):
            one = self.server()
            take_up(one)
            for goal_id in cancel:
                one.action_server.internal_cancel_callback(goal_id)
            one._SimpleActionServer__shutting_down = True
            one.set_preempted(text="parked")
            self.assertEqual((state, text), (last_result(one).status.status, last_result(one).status.text))

    def test_callback_for_goals_that_exits_keeps_no_lock(self):
        one = self.server()
        one.register_goal_callback(sys.exit)
        with self.assertRaises(SystemExit):
            send(one)
        self.assertTrue(is_free(one.execute_condition))

    def test_newer_goal_that_is_accepted_while_the_end_of_the_older_one_waits_for_the_lock_is_not_ended_by_it(self):
        def wait(*_):
            one.action_server.lock = lock
            take_up(one, "newer")

        one = self.server()
        take_up(one, "older")
        lock, one.action_server.lock = one.action_server.lock, mock.MagicMock(__enter__=wait)
        one.set_succeeded()
        ended = last_result(one).status
        self.assertEqual(("older", GoalStatus.PREEMPTED, True), (ended.goal_id.id, ended.status, one.is_active()))

    def test_goals_without_an_ending_are_those_that_came_and_wait_or_run(self):
        one = server._ActionServer.__new__(server._ActionServer)
        one.status_list = [StatusTracker(GoalID(), state) for state in (*range(10), GoalStatus.RECALLING)]
        for tracker in one.status_list[:-1]:  # that is a cancel's
            tracker.goal = TestActionGoal()
        self.assertEqual([GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING],
                         [tracker.status.status for tracker in one.unended()])

    def test_line_on_a_goal_has_its_plain_fields_if_any_and_no_more_than_60_letters_of_each(self):
        said = server._plain_fields(GoalStatus(status=3, text="\x1b" * 1000))
        self.assertEqual(r": status 3, text '\x1b", said[:22])
        self.assertLess(len(said), 100)
        self.assertEqual((": data 0.5", ""), tuple(map(server._plain_fields, (Float64(0.5), GoalStatusArray()))))

    def test_goal_that_is_recalled_while_the_loop_takes_it_up_or_with_the_server_s_stop_is_not_executed(self):
        one = self.server()
        for goal in None, TestActionGoal().goal:
            one._SimpleActionServer__execute(goal)  # which would call nothing, and say that it failed
        self.assertIsNone(one.action_server.status_pub.impl.latch)

    def test_server_names_another_that_serves_in_this_node_or_in_one_that_lives_also_where_no_master_answers(self):
        one, said = self.server(), self.logged()
        for serves_here, state, named in (
                (True, OSError, rospy.get_name()), (False, OSError, r"^\[]$"),
                # The first that is asked is gone.
                (False, ([["/work/result", ["/one", rospy.get_name(), "/other"]]], [], []), "node /(one|other):"),
                (False, ([], [], []), r"^\[]$")):  # of a new master
            with mock.patch.object(server, "ask", side_effect=[state]), \
                    mock.patch.object(server, "ask_node", side_effect=[OSError, 1]):
                one._SimpleActionServer__look_for_twins(serves_here)
            self.assertRegex(str(said), named)
            said.clear()

    def test_goal_that_waits_while_the_node_ends_is_recalled_and_not_taken_up(self):
        def preempt():
            held.append(not is_free(one.action_server.lock) and not is_free(one.execute_condition))

        said, held = self.logged(), []
        for reject in (), [None]:  # as the program may in its goal callback
            one = self.server()
            one.register_preempt_callback(preempt)
            one._SimpleActionServer__ask_to_stop()  # none waits
            send(one)
            for _ in reject:
                one.next_goal.set_rejected()
            one._SimpleActionServer__ask_to_stop()
            self.assertEqual((GoalStatus.REJECTED if reject else GoalStatus.RECALLED, False),
                             (last_result(one).status.status, one.new_goal))
        self.assertEqual(([], []), (said, held))
        take_up(one)
        one.new_goal, one.next_goal = True, None  # of a program that refuses goals
        one._SimpleActionServer__ask_to_stop()
        self.assertEqual([True], held)

    def test_server_ends_with_its_node_also_where_no_thread_can_be_had(self):
        one, said = self.server(), self.logged()
        one.new_goal = True
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError):
            one._SimpleActionServer__shut_down(0)
        self.assertEqual((False, []), (one.action_server.started, said))
        self.assertTrue(one.new_goal, "a callback that is told to stop could hold up whoever calls it")

    def test_goal_that_is_accepted_takes_over_from_one_that_runs_only(self):
        one = self.server()
        for count, callback in enumerate((print, print, one.set_preempted)):  # the last leaves no active goal
            one.register_preempt_callback(callback)
            send(one)
            one.preempt_request &= count == 2  # as programs do that let a goal end first
            for _ in range(2):  # the second time none waits
                one.accept_new_goal()
            self.assertEqual((count, threading.get_ident() if count else None),
                             (one._SimpleActionServer__taken_over, one._SimpleActionServer__taken_by))

    def test_rate_that_serves_several_goals_ends_one_sleep_for_each_that_is_taken_over(self):
        one = self.server()
        take_up(one)
        one.is_active = self.fail  # it waits for a callback, which may wait for the worker
        stop_requested, status = one.rate(1)._stop_requested, one.current_goal.status_tracker.status
        before, one.preempt_request = stop_requested(), True
        for status.status, stops in (GoalStatus.PREEMPTED, True), (GoalStatus.PREEMPTING, True), \
                (GoalStatus.PREEMPTED, False):  # a preempt callback may have ended it before
            self.assertEqual(stops, stop_requested(), "whoever has heard and ended its goal sleeps on")
        with mock.patch.object(rospy.core, "_shutdown_flag", True):
            self.assertTrue(stop_requested(), "the clock may stand still")
        one.current_goal.status_tracker = None
        self.assertFalse(stop_requested(), "there was no goal")
        one.preempt_request, one._SimpleActionServer__taken_over = False, 5
        self.assertFalse(stop_requested(), "by a goal that came since the last stop")
        one._SimpleActionServer__taken_over = 1
        self.assertEqual([False, True, False], [before, stop_requested(), stop_requested()])
        one._SimpleActionServer__taken_over, one._SimpleActionServer__taken_by = 2, threading.get_ident()
        self.assertFalse(stop_requested(), "whoever has taken up the newer goal sleeps on")

    def test_server_that_is_stopped_ends_its_goals_and_each_that_comes_later_and_may_go_on_without_them(self):
        for others in [], [("waits", 2 ** 31)]:  # sent by a clock that is wrong
            one, _ = self.server(), self.server()  # of the same topics, which stay open
            take_up(one, "runs")
            for other in others:
                send(one, *other)
            sending = mock.Mock(side_effect=lambda _: self.assertTrue(one.action_server.result_pub.impl))
            with mock.patch.object(one, "execute_condition", mock.MagicMock()) as lock, \
                    mock.patch.object(time, "sleep", sending), mock.patch.object(rate, "wake") as wake:
                one.action_server.stop()
            self.assertEqual([mock.call(shutdown.SENT_WITHIN)], sending.mock_calls)
            self.assertIsNone(one.action_server.result_pub.impl)
            wake.assert_called_once()
            lock.__enter__.assert_called_once()
            self.advertise(one.action_server)  # what comes while it is stopped finds its topics
            self.assertEqual((False, True), (one.is_new_goal_available(), one.is_preempt_requested()))
            self.assertEqual([("runs", GoalStatus.ABORTED)] + [(each, GoalStatus.RECALLED) for each, _ in others],
                             shown(one))
            send(one, "late")
            self.assertEqual([("late", GoalStatus.RECALLED)], shown(one))
            late = last_result(one)
            self.assertEqual(("late", server.SHUTTING_DOWN), (late.status.goal_id.id, late.status.text))
            self.assertGreater(late.header.stamp, rospy.Time())
            one.action_server.started, one.action_server.status_list_timeout = True, rospy.Duration(-1)  # again
            take_up(one, "next", 1)
            self.assertEqual((True, False), (one.is_active(), one.is_preempt_requested()))
            one.action_server.publish_status()
            self.assertEqual([("next", GoalStatus.ACTIVE)], shown(one))
            with ThreadPoolExecutor(1) as thread:
                thread.submit(one.action_server.lock.acquire).result()  # a callback that never comes back
                one.action_server.close()
            self.assertEqual([("next", GoalStatus.ABORTED)], shown(one))

    def test_goal_comes_and_ends_and_a_heart_beats_with_the_lock(self):
        one = self.server()
        held = mock.Mock(side_effect=lambda: self.assertFalse(is_free(one.action_server.lock)))
        with mock.patch.object(one.action_server, "_look_at_the_clock", held), \
                mock.patch.object(one, "is_active", held):
            take_up(one)
            one.set_succeeded()
            one.action_server.publish_status_async(None)
        self.assertGreaterEqual(held.call_count, 5)

    def test_status_after_a_cancel_shows_what_the_callback_has_made_of_the_goal(self):
        for callback, state in (print, GoalStatus.PREEMPTING), (
                actionlib.ServerGoalHandle.set_canceled, GoalStatus.PREEMPTED):
            one = self.server()
            one.action_server.cancel_callback = callback
            take_up(one, "goal")
            one.action_server.status_pub.impl.latch = None
            one.action_server.internal_cancel_callback(GoalID(id="goal"))
            self.assertEqual([("goal", state)], shown(one))

    def test_feedback_that_waits_while_another_thread_stops_the_server_is_not_sent(self):
        one = self.server()
        take_up(one)
        one.action_server.lock = mock.MagicMock(**{
            "__enter__.side_effect": lambda *_: setattr(one.action_server, "started", False)})
        one.publish_feedback(TestFeedback())
        self.assertIsNone(one.action_server.feedback_pub.impl.latch)

    def test_goal_that_is_older_than_the_one_that_runs_is_recalled_and_one_forgotten_when_it_ends_is_no_error(self):
        one, said = self.server(), self.logged()
        for stamp in 2, 1:
            take_up(one, "of %d" % stamp, stamp)
        self.assertEqual(("of 1", False), (last_result(one).status.goal_id.id, one.is_preempt_requested()))
        one.register_goal_callback(one.action_server.status_list.clear)  # as with a status_list_timeout of 0
        send(one, "forgotten")
        self.assertNotIn("ignored", str(said))

    def test_status_shows_an_ending_also_where_the_clock_leaps_meanwhile_and_for_5_s_after_one_was_set_back(self):
        class Leaps(list):
            def __iter__(self):
                rospy.rostime._set_rostime(rospy.Time.now() + rospy.Duration(10))
                return super().__iter__()

        one = self.server()
        one.action_server.status_list_timeout = rospy.Duration(5)
        program_s = GoalStatus(status=GoalStatus.SUCCEEDED)  # of a goal that is no server's
        one.action_server.publish_result(program_s, None)
        self.assertEqual((GoalStatus.SUCCEEDED, ""), (program_s.status, program_s.text))
        rospy.rostime._set_rostime(rospy.Time(1000))
        take_up(one, "goal", 600)
        send(one, "next")
        one.action_server.status_list = Leaps(one.action_server.status_list)
        one.set_succeeded()
        one.action_server.status_list = list(one.action_server.status_list)
        self.assertEqual([("goal", GoalStatus.SUCCEEDED), ("next", GoalStatus.PENDING)], shown(one))
        goal, following = ("goal", rospy.Time(600)), ("next", rospy.Time())  # whose stamp would be in the future
        for now, shows in (700, [goal, following]), (705, [goal, following]), (706, [following]):
            rospy.rostime._set_rostime(rospy.Time(now))
            one.action_server.publish_status_async(None)
            statuses = one.action_server.status_pub.impl.latch.status_list
            self.assertEqual(shows, [(status.goal_id.id, status.goal_id.stamp) for status in statuses])

    def test_what_is_logged_of_a_goal_holds_up_neither_it_nor_its_ending_and_is_what_came(self):
        one, client, goal_id = self.server(), Connection(), "\x1b" * 1000
        one.action_server.result_pub.impl.connections = [client]
        lines = self.logged(lambda line: (line.getMessage(), is_free(one.action_server.lock), len(client.sent)))
        with mock.patch.object(log, "_taken", [1]), mock.patch.object(rate, "wake", lambda: lines.append("woken")):
            one.execute_thread = threading.current_thread()
            send(one, goal_id)
            one.accept_new_goal().goal = 1
            send(one, goal_id)
            one.set_succeeded(TestResult("no"))
            one.action_server.publish_status_async(None)  # the next heartbeat
            send(one, goal_id)
            self.assertFalse(one.is_new_goal_available())
        ignored, unsent = "/work: goal ignored: its id %.60r is that of a recent goal" % goal_id, lines[4][0][7:]
        self.assertRegex(unsent, "^the result cannot be sent: .*integer")
        self.assertEqual(["woken", "woken", ("/work: goal accepted: goal 0", True, 0), (ignored, True, 0),
                          ("/work: " + unsent, False, 1), ("/work: goal ABORTED: " + unsent, True, 1),
                          "woken", (ignored, True, 1)], lines)

    def test_whoever_wakes_a_rate_waits_for_nobody(self):  # a signal handler of rospy's, say, that holds the lock
        with rospy.rostime.get_rostime_cond():
            before, waker = rate._wakes, shutdown.aside(rate.wake)
            waker.join(5)
            self.assertEqual((False, True), (waker.is_alive(), rate._wakes > before))


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_server", ServerUnits)
