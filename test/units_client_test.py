#!/usr/bin/python3
"""What a client does without a server."""
import contextlib
import functools
import threading
import time
from concurrent.futures import ThreadPoolExecutor, TimeoutError
from unittest import mock

import actionlib
import rospy
import rosunit
from actionlib import CommState
from actionlib.action_client import CommStateMachine
from actionlib.msg import TestAction, TestActionFeedback, TestActionGoal, TestActionResult, TestGoal
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from actions_tutorial import robust
from actions_tutorial.robust import client, node, peers, shutdown
from units import Connection, UnitCase, is_free


class ClientUnits(UnitCase):

    def goal_and_result(self, told=None, send_cancel=None):
        """Returns a goal that calls these functions with its handle and with a cancel, and its result, SUCCEEDED."""
        result = TestActionResult(status=GoalStatus(GoalID(id="id"), GoalStatus.SUCCEEDED, ""))
        goal = client._Goal(TestActionGoal(goal_id=GoalID(id="id")), told, None, None, send_cancel)
        goal.begin("/result", False)
        return goal, result

    def watch(self, *goals, **client_s):
        """Have a client, which has these attributes, look after goals (mock.Mock), one at each look. Returns it."""
        def tracked(goals=iter([*goals, None])):
            mutex = one.action_client.manager.list_mutex
            self.assertFalse(is_free(mutex), "another thread may send the next goal just now")
            return next(goals)

        one = self.client()
        vars(one).update(_SimpleActionClient__goal=tracked, **client_s)
        with mock.patch.object(client, "LOOKS", 0.01):
            one._SimpleActionClient__watch()
        return one

    def test_heartbeat_timeout_that_is_no_number_above_0_is_a_value_error(self):
        for wrong in 0, -1, float("nan"), True, "5":
            with self.assertRaisesRegex(ValueError, "^heartbeat_timeout is .*above 0$", msg=wrong):
                robust.SimpleActionClient("work", None, heartbeat_timeout=wrong)

    def test_clock_that_is_set_back_adds_no_patience_and_a_goal_sent_while_the_older_is_lost_is_looked_after(self):
        goal, older, newer = mock.Mock(silence=1.0), mock.Mock(silence=100.0, ignored=100.0), mock.Mock(silence=0.0)
        rospy.rostime._set_rostime(rospy.Time(1000))
        goal.look.side_effect = lambda _: rospy.rostime._set_rostime(rospy.Time(10))
        self.watch(goal, goal)
        self.watch(older, newer, newer)
        self.assertEqual([mock.call(0)] * 3, goal.look.mock_calls + newer.look.mock_calls)

    def test_watcher_of_goals_ends_when_there_is_none_that_runs_and_with_the_node(self):
        for goal, rospy.core._shutdown_flag in (
                (None, False), (mock.Mock(simple_state=SimpleGoalState.DONE), False), (mock.Mock(), True)):
            with mock.patch.object(time, "sleep") as sleep:
                self.assertFalse(self.watch(goal)._SimpleActionClient__is_watched, "who would look after the next goal")
            sleep.assert_called_once_with(0.01)

    def test_goal_that_nobody_confirms_is_sent_again_each_second_for_4_s_or_while_the_server_speaks_of_others(self):
        for speaks_of_others, begun, sent, count in (
                (False, 3, 0.5, 0), (False, 3, 1.5, 1), (False, 9, 1.5, 0), (True, 9, 1.5, 1)):
            goal, now = mock.Mock(silence=0.0, state=CommState.WAITING_FOR_GOAL_ACK), time.monotonic()
            goal.look.return_value, goal.begun_at, goal.sent_at = speaks_of_others, now - begun, now - sent
            self.watch(goal)
            self.assertEqual(count, goal.send_again.call_count, (speaks_of_others, begun, sent))

    def test_goal_that_waited_for_a_busy_server_is_not_lost_when_that_speaks_of_others_at_last(self):
        goal, _ = self.goal_and_result()
        for passed_over, mentioned, silence, ignored in (
                (False, False, 5, 0), (True, False, 10, 5), (True, False, 15, 10), (True, True, 0, 0)):
            goal.passed_over, goal.mentioned = passed_over, mentioned
            self.assertEqual(passed_over and not mentioned, goal.look(5))
            self.assertEqual((silence, ignored, False), (goal.silence, goal.ignored, goal.passed_over))
        other, ignored = self.goal_and_result()[0], []
        for other.topic in "elsewhere", goal.topic:  # where the result waits behind the callback
            goal.passed_over, goal.mentioned = True, False
            other.call(lambda: ignored.append(goal.look(5) and goal.ignored))
        self.assertEqual([5, 5], ignored)
        busy, lives = mock.Mock(silence=9, ignored=1, **{"look.side_effect": [True, False]}), mock.Mock()
        self.watch(busy, busy, _SimpleActionClient__server_lives=lives)
        self.assertEqual(([], 1), (busy.lose.mock_calls, lives.call_count))

    def test_goal_is_lost_after_30_s_unless_a_callback_holds_up_the_statuses_of_a_server_that_lives(self):
        for held_up, speaks_of_others, lives, is_lost in (
                (False, False, True, True), (True, False, True, False), (True, False, False, True),
                (True, True, True, True)):
            goal, _ = self.goal_and_result(lambda gh: gh.comm_state_machine.call(
                lambda: heard.append("/result" in client._running)), mock.Mock())
            heard, goal.silence, goal.state = [], 31, CommState.ACTIVE
            goal.look = mock.Mock(return_value=speaks_of_others)
            with mock.patch.object(client, "_running", [goal.topic] * held_up):
                self.watch(*[goal] * 3, _SimpleActionClient__server_lives=lambda: lives)  # one is not asked for
            self.assertEqual([held_up] * is_lost, heard, (held_up, speaks_of_others, lives))

    def test_feedback_and_status_of_the_goal_not_of_another_are_words_about_it_and_a_callback_is_no_silence(self):
        goal, _ = self.goal_and_result()
        goal.feedback_cb = mock.Mock()
        with ThreadPoolExecutor(1) as thread:
            for goal_id, held, silence in ("other", None, 5), ("id", None, 0), ("other", goal.mutex, 0):
                status = GoalStatus(goal_id=GoalID(id=goal_id))
                for hear, message in ((goal.update_feedback, TestActionFeedback(status=status)),
                                      (goal.update_status, GoalStatusArray(status_list=[status]))):
                    goal.silence, goal.mentioned = 0, False
                    hear(message)
                    with held or contextlib.nullcontext():  # as active_cb is called
                        thread.submit(goal.look, 5).result()
                    self.assertEqual(silence, goal.silence, (goal_id, message))
        self.assertEqual(float("inf"), goal.sent_at, "it has come, and is not sent again")

    def test_news_of_other_goals_and_of_one_that_has_ended_wait_for_none_of_its_callbacks(self):
        goal, result = self.goal_and_result()
        with ThreadPoolExecutor(1) as thread, goal.mutex:  # as done_cb is called
            thread.submit(goal.update_result, TestActionResult()).result(10)
            goal.state = CommState.DONE
            for hear, news in (goal.update_result, result), (goal.update_status, GoalStatusArray()):
                thread.submit(hear, news).result(10)

    def test_callback_that_fails_is_named_in_the_log(self):
        said, (goal, _) = self.logged(), self.goal_and_result()
        goal.call(lambda: 1 / 0)
        self.assertRegex(said[0], "^the callback <lambda> failed: (?s:.*)ZeroDivisionError")

    def test_feedback_that_nobody_wants_is_no_error(self):
        one = self.client()
        one.send_goal(TestGoal())
        one._handle_feedback(one.gh, None)

    def test_goal_of_a_handle_that_a_subclass_has_made_as_actionlib_does_has_feedback_and_its_end(self):
        for base in actionlib.SimpleActionClient, robust.SimpleActionClient:
            one, (goal, result) = self.client(base), self.goal_and_result()
            one.done_cb, one.active_cb, one.feedback_cb = heard = mock.Mock(), mock.Mock(), mock.Mock()
            one.simple_state = SimpleGoalState.PENDING
            machine = CommStateMachine(goal.action_goal, one._handle_transition, one._handle_feedback, None, None)
            one.gh = actionlib.ClientGoalHandle(machine)
            machine.update_feedback(TestActionFeedback(status=result.status))
            machine.update_result(result)
            self.assertEqual([1, 1, 1], [each.call_count for each in heard], base)
            self.assertTrue(one.wait_for_result(rospy.Duration(1)))

    def test_client_whose_topics_are_closed_while_it_starts_says_that_it_was_interrupted(self):
        self.client()  # with which there are parameters
        rospy.Subscriber("closed/status", GoalStatusArray).impl.close()
        with mock.patch.object(peers, "serve_all_peers") as mended:
            for rospy.core._in_shutdown, words in (False, r".*/closed/status.*closed"), (True, "interrupted"):
                with self.assertRaisesRegex(rospy.ROSInitException, "^the client of /closed cannot start: %s$" % words):
                    robust.SimpleActionClient("closed", TestAction)
        self.assertEqual(2, mended.call_count)

    def test_server_is_told_of_its_client_once_more_after_3_s_also_where_no_master_answers(self):
        one = self.client()
        one._SimpleActionClient__registered = 0
        with mock.patch.object(rospy.core, "_uri", "uri"), mock.patch.object(client, "ask", wraps=client.ask) as ask:
            for _ in range(2):
                one._SimpleActionClient__register_again([one.action_client.pub_goal, one.action_client.pub_cancel])
        self.assertEqual(2, ask.call_count)

    def heard(self):
        """Returns a client of a server, /server, that has sent a status."""
        one = self.client()
        one.action_client.last_status_msg = GoalStatusArray()
        one.action_client.last_status_msg._connection_header = {"callerid": "/server"}
        for publisher in one.action_client.pub_goal, one.action_client.pub_cancel:
            publisher.impl.connections = [Connection("/server")]
        return one

    def test_server_is_there_when_it_sends_its_results_and_feedback_here_not_elsewhere(self):
        one, me, ago = self.heard(), rospy.get_name(), time.monotonic() - 60
        here, elsewhere = ([(1, me, "o", "TCPROS", "/work/result"), (2, peer, "o", "TCPROS", "/work/feedback")]
                           for peer in (me, "/elsewhere"))
        unnamed = [(1, "::ffff:127.0.0.1:5", "o", "TCPROS", "/work/result", True)]  # rosnodejs
        for connections, registered, is_there in (
                (here, ago, True), (elsewhere, ago, False), ([], ago, True), ([], time.monotonic(), False),
                (0, ago, True), (unnamed, ago, True), ([(1, "http://me", "i", "TCPROS", "/work/result")], ago, False)):
            one._SimpleActionClient__registered = registered
            with mock.patch.object(client, "ask_node", return_value=connections):
                self.assertEqual(is_there, one._SimpleActionClient__is_connected(), connections)
        one._SimpleActionClient__registered = time.monotonic()
        for publisher in one.action_client.pub_goal, one.action_client.pub_cancel:
            with mock.patch.object(client, "ask_node", return_value=here), \
                    mock.patch.object(publisher.impl, "connections", [Connection("/other")]):
                self.assertFalse(one._SimpleActionClient__is_connected(), "it does not hear of goals, or of cancels")
        one._SimpleActionClient__silent = one.action_client.last_status_msg  # since the server is lost
        self.assertFalse(one._SimpleActionClient__is_connected())

    def test_shutdown_cancels_the_client_s_goal_but_none_that_a_hook_has_sent(self):
        one = self.client()
        for in_hook in False, True:
            goal = mock.Mock(in_hook=in_hook, simple_state=SimpleGoalState.DONE)
            one._SimpleActionClient__goal = lambda goal=goal: goal
            one._SimpleActionClient__end_goal(0)
            self.assertEqual(not in_hook, goal.cancel.called)

    def test_goal_that_is_sent_while_the_node_ends_is_a_hook_s_and_no_other_thread_forgets_it_meanwhile(self):
        def send(*_):
            with self.assertRaises(TimeoutError):
                thread.submit(one.stop_tracking_goal).result(0.05)
            return actionlib.ClientGoalHandle(self.goal_and_result()[0])

        one = self.client()
        one.action_client.send_goal, one._SimpleActionClient__set_up = send, mock.Mock()
        for shutdown.hooks_thread, rospy.core._in_shutdown in (
                (None, False), (threading.get_ident(), True), (None, True)):
            with mock.patch.object(shutdown, "unfinished") as unfinished, ThreadPoolExecutor(1) as thread:
                one.send_goal(None)
            self.assertEqual(rospy.core._in_shutdown, unfinished.add.mock_calls[0][1][0].in_hook)
        for shutdown.hooks_thread, rospy.core._shutdown_flag in (-1, False), (None, True):  # they have run; it is down
            self.assertRaises(rospy.ROSInitException, one.send_goal, None)
        self.assertEqual(5, one._SimpleActionClient__set_up.call_count, "a subclass may have an __init__ of its own")

    def test_time_out_for_a_result_ends_with_the_tick_of_a_simulated_clock_on_which_it_falls(self):
        one = self.client()
        one.send_goal(TestGoal())
        rospy.rostime._set_rostime(rospy.Time(0, 900000000))
        ticks = iter([rospy.Time(1, 200000000)])
        one.done_condition.wait = lambda _: rospy.rostime._set_rostime(next(ticks))
        with mock.patch.object(shutdown, "let_loops_see_it") as waits:
            self.assertFalse(one.wait_for_result(rospy.Duration(0, 300000000)))
        waits.assert_not_called()
        one.done_condition.wait = mock.Mock(side_effect=lambda _: one.stop_tracking_goal())
        self.assertFalse(one.wait_for_result())
        one.done_condition.wait.assert_called_once_with(0.1)  # below 0 it would return at once

    def test_short_wait_for_a_server_far_away_finds_it_and_a_look_does(self):
        for timeout in 0.001, -1:
            self.assertTrue(node.wait_for("server", lambda: time.sleep(0.01) or True, timeout))
            self.assertFalse(node.wait_for("server", lambda: False, timeout))

    def test_server_lives_if_its_node_answers_at_the_other_end_of_a_connection(self):
        one, ours, topic = self.heard(), Connection("/server"), self.client().action_client.status_sub.impl
        lives = one._SimpleActionClient__server_lives
        for connections, answers in ([ours, ours], True), ([ours], False), ([Connection()] * 2, False), ([], False):
            topic.connections = connections
            with mock.patch.object(client, "ask", side_effect=[OSError, 1]) as ask:
                self.assertEqual(answers, lives(), connections)
        self.assertFalse(ask.called)
        topic.connections, one.action_client.last_status_msg = [ours], None
        self.assertFalse(lives(), "it never spoke")
        one.action_client.stop()
        self.assertFalse(lives())
        with mock.patch.object(one.action_client, "status_sub"):
            del one.action_client.status_sub  # as programs do that are older than stop()
            self.assertFalse(lives())

    def test_wait_for_a_server_before_init_node_does_not_begin(self):
        one = self.client()
        rospy.rostime.set_rostime_initialized(False)
        one._SimpleActionClient__set_up = mock.Mock()
        with self.assertRaisesRegex(rospy.ROSInitException, "init_node"):
            one.wait_for_server(0.1)
        one._SimpleActionClient__set_up.assert_called_once()  # a subclass may have an __init__ of its own

    def test_goal_that_is_lost_while_its_result_comes_or_while_a_callback_takes_its_time_has_one_ending(self):
        def enter(_):
            goal.mutex = mutex
            first()

        for is_lost, ending in (True, (GoalStatus.LOST, "why")), (False, (GoalStatus.SUCCEEDED, "")):
            goal, result = self.goal_and_result(send_cancel=mock.Mock())
            ways = functools.partial(goal.update_result, result), functools.partial(goal.lose, "why")
            first, second = reversed(ways) if is_lost else ways
            mutex, goal.mutex = goal.mutex, mock.MagicMock(__enter__=enter)  # as if the other had it, in another thread
            second()
            self.assertEqual(ending, (goal.latest_goal_status.status, goal.why))
            goal.feedback_cb = mock.Mock()
            for stamp, calls in (1, 0), (0, not is_lost):  # sent after the result, and before
                feedback = TestActionFeedback(status=result.status)
                feedback.header.stamp = rospy.Time(stamp)
                goal.update_feedback(feedback)
                self.assertEqual(calls, goal.feedback_cb.call_count, "feedback of %d s, LOST: %s" % (stamp, is_lost))


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_client", ClientUnits)
