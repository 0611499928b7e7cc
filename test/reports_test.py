#!/usr/bin/python3
"""What users of actionlib in Python have reported: doc/robust.md lists their threads on GitHub, with the tests' names.

ACTIONLIB=plain tries actionlib itself; the page says how most tests end there.
"""
import itertools
import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor, wait
from unittest import mock

import genpy
import rospy
import rostest
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalStatus
from std_msgs.msg import String

from raw_client import ABORTED, ACTIVE, PENDING, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED
from actions_tutorial.msg import WashTheDishesGoal, WashTheDishesResult
from scenes import SLACK, NodeCase, check_quiet, concurrently
from processes import PACKAGE, Group, Master, bowls, eventually
from raw_server import PATIENCE, RawServer, client_of

LOST, REJECTED, RECALLING = GoalStatus.LOST, GoalStatus.REJECTED, GoalStatus.RECALLING
PROGRAMS = os.path.join(PACKAGE, "test", "reports_programs.py")


class Place(Group):
    """A namespace (str) on this process's master."""

    def __init__(self, namespace):
        super().__init__(ROS_NAMESPACE=namespace)
        self.namespace = namespace

    def meet(self, **options):
        """A server that does as it is told, and its client with these options. -> RawServer"""
        self.processes.append(RawServer(self.namespace + "/raw", **options))
        return self.processes[-1]

    def works(self, **options):
        """A server of actionlib's, and its client with these options, which has found it. -> Process, client"""
        server, client = self.start(PROGRAMS, "works"), client_of(self.namespace + "/works", **options)
        assert client.wait_for_server(PATIENCE), server
        return server, client


def in_program(program, prints="SUCCEEDED", simulated=False):
    """A test of a program of ours, on a master of its own."""
    def test(self, _):
        with Master() as master:
            master.api.setParam("/use_sim_time", simulated)
            self.prints(master.start(PROGRAMS, program), prints)
    return test


@concurrently(Place)
class Reports(NodeCase):

    def ends(self, raw, goal=None, state=SUCCEEDED, count=1):
        """The goal has ended so, by the result that is sent now if this is its id; its client knows, and was told."""
        if goal:
            raw.result(goal, state, count)
        self.assertTrue(raw.client.wait_for_result(PATIENCE), raw)
        ending = state, bowls(count)
        self.assertEqual(ending, (raw.client.get_state(), raw.client.get_result().dishes_washed), raw)
        self.assertEqual(ending, raw.done[-1], raw)

    def prints(self, node, said):
        """The node (Process) ends well, having printed this (str), and said nothing else."""
        self.assertEqual(0, node.wait(120), node)
        self.assertEqual(said + "\n", node.stdout, node)
        check_quiet(node)
        self.assertNotRegex(node.stderr, "not tracking|simple state", node)

    # --- waiting ---

    def test_server_that_was_killed_is_not_found_one_at_work_is_waited_for_and_a_frozen_one_is_lost(self, place):
        server, client = place.works(heartbeat_timeout=4.0)
        server.stop()
        eventually(lambda: not client.wait_for_server(rospy.Duration(0.3)), "no server any more", timeout=10)
        server, _ = place.works()
        self.assertTrue(client.wait_for_server(PATIENCE), server)
        client.send_goal(WashTheDishesGoal(5))
        self.assertTrue(client.wait_for_result(PATIENCE), server)
        self.assertEqual(SUCCEEDED, client.get_state(), server)
        client.send_goal(WashTheDishesGoal(5))
        eventually(lambda: server.stdout.count("works") == 2, "the server at work", server)
        server.signal(signal.SIGSTOP)
        self.assertFalse(client.wait_for_result(PATIENCE), server)
        self.assertEqual(LOST, client.get_state(), server)
        self.assertIn("server lost: silent for", client.get_goal_status_text(), server)
        client.send_goal(WashTheDishesGoal(0))  # a second try has a time-out of its own
        self.assertEqual(PENDING, client.get_state(), server)
        self.assertFalse(client.wait_for_server(3.0), server)  # a question may take 2 s
        server.signal(signal.SIGCONT)
        self.assertTrue(client.wait_for_result(PATIENCE), server)
        self.assertIsNone(client.get_failure(), server)

    def test_failure_is_told_of_a_server_that_is_none_or_not_heard_of_a_goal_without_an_end_and_of_one_not_sent(
            self, place):
        nobody = client_of(place.namespace + "/nobody")
        self.assertEqual("no goal was sent", nobody.get_failure())
        self.assertIn("no goal", nobody.get_goal_status_text())
        for seconds, said in (-1, "0"), (0.1, "0.1"):
            self.assertFalse(nobody.wait_for_server(seconds))
            self.assertRegex(nobody.get_failure(), "/nobody within %s s$" % said)
        self.assertEqual((False, None), (nobody.wait_for_result(), nobody.get_result()))
        nobody.cancel_goal()
        nobody.send_goal(WashTheDishesGoal(1))
        self.assertEqual("goal PENDING: no ending so far", nobody.get_failure())
        with self.assertRaises(rospy.ROSSerializationException):
            nobody.send_goal(WashTheDishesGoal("many"))
        self.assertEqual(LOST, nobody.get_state())
        self.assertIn("cannot be sent", nobody.get_failure())
        raw = place.meet()
        goal = raw.send()
        self.assertIn("PENDING", raw.client.get_failure())
        raw.status((goal, ACTIVE))
        self.assertIn("ACTIVE", raw.client.get_failure())
        self.ends(raw, goal, ABORTED)
        self.assertEqual("goal ABORTED: the server does not say why", raw.client.get_failure())
        raw.result(raw.send(), ABORTED, text="\x1b[2J\nfake")
        self.ends(raw, state=ABORTED)
        self.assertEqual(r"goal ABORTED: \x1b[2J\nfake", raw.client.get_failure(), "which is to be shown")
        self.ends(raw, raw.send())
        for topic in "result", "feedback":
            self.assertIsNone(raw.client.get_failure(), topic)
            raw.publishers[topic].unregister()
            self.assertFalse(raw.client.wait_for_server(0.3), topic)
            self.assertRegex(str(raw.client.get_failure()), "/raw.* 0.3 s")
            raw.publish(topic)
            self.assertTrue(raw.client.wait_for_server(PATIENCE), topic)
        self.assertIsNone(raw.client.get_failure())

    def test_seconds_are_a_time_as_well_as_a_duration_is(self, place):
        raw = place.meet()
        self.assertTrue(raw.client.wait_for_server(30))
        goal = raw.send()
        for timeout in 0.2, 1, rospy.Duration(0.2):
            begun = time.monotonic()
            self.assertFalse(raw.client.wait_for_result(timeout))
            self.assertGreater(time.monotonic() - begun, 0.15, timeout)
        begun = time.monotonic()
        self.assertFalse(any(raw.client.wait_for_result(0.001) for _ in range(100)))
        self.assertLess(time.monotonic() - begun, 8, "s for 100 waits of a millisecond")
        with ThreadPoolExecutor() as thread:
            for_ever = thread.submit(raw.client.wait_for_result, -1)  # as actionlib's
            self.assertFalse(wait([for_ever], 0.3).done)
            raw.result(goal)
            self.assertTrue(for_ever.result(30))
        for timeout in 30, 30.0, 0, rospy.Duration(30), rospy.Duration(), genpy.Duration(30):
            self.assertTrue(raw.client.wait_for_result(timeout), timeout)
        self.assertEqual(PENDING, raw.client.send_goal_and_wait(WashTheDishesGoal(1), 0.2, 0.2))

    def test_two_threads_that_wait_return_when_done_cb_has_and_the_state_can_be_asked_for_meanwhile(self, place):
        raw, inside, go_on = place.meet(), threading.Event(), threading.Event()

        def done_cb(state, result):
            inside.set()
            go_on.wait(30)
            raw.hear_done(state, result)

        goal = raw.send(done_cb=done_cb)
        with ThreadPoolExecutor() as threads:
            waits = [threads.submit(raw.client.wait_for_result, PATIENCE) for _ in range(2)]
            raw.result(goal, wait=False)
            self.assertTrue(inside.wait(30), raw)
            self.assertEqual(SUCCEEDED, raw.client.get_state())
            self.assertEqual(bowls(1), raw.client.get_result().dishes_washed)
            begun = time.monotonic()
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.5)), raw)
            self.assertGreater(time.monotonic() - begun, 0.4, raw)
            self.assertFalse(any(one.done() for one in waits), raw)
            go_on.set()
            self.assertEqual([True, True], [one.result() for one in waits], raw)
        self.ends(raw)

    # --- callbacks ---

    def test_goal_sent_from_done_cb_is_told_of_its_end_and_waited_for(self, place):
        raw, waited_inside = place.meet(), []

        def again(state, result):
            raw.hear_done(state, result)
            raw.client.send_goal(WashTheDishesGoal(2), again if len(raw.done) < 3 else raw.hear_done)
            eventually(lambda: raw.client.get_state() == ACTIVE, "news of it, though this takes its time", raw)
            waited_inside.append(raw.client.wait_for_result(rospy.Duration(0.2)))

        goal = raw.send(done_cb=again)
        for count in range(1, 4):
            with ThreadPoolExecutor(1) as thread:
                waited = thread.submit(raw.client.wait_for_result, PATIENCE)
                raw.result(goal, count=count, wait=False)
                raw.eventually(lambda: len(raw.ids) == count + 1, "the next goal")
                goal = raw.ids[-1]
                raw.status((goal, ACTIVE), wait=False)
                self.assertTrue(waited.result(), raw)
            self.assertEqual(SimpleGoalState.ACTIVE, raw.client.simple_state, "that of the next goal")
            self.assertEqual([False] * count, waited_inside, raw)
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.3)), raw)
        self.ends(raw, goal, count=4)
        self.assertEqual([(SUCCEEDED, bowls(count)) for count in range(1, 5)], raw.done, raw)

    def test_goals_that_done_cb_sends_when_the_server_is_lost_are_looked_after_meanwhile(self, place):
        raw = place.meet(heartbeat_timeout=1.0)

        def again(state, result):
            for _ in range(2):
                raw.client.send_goal(WashTheDishesGoal(2), raw.hear_done)
                raw.client.wait_for_result(PATIENCE)
            raw.hear_done(state, result)

        raw.send(done_cb=again)
        raw.eventually(lambda: raw.status(wait=False) or len(raw.ids) == 3, "a third goal", timeout=20)
        for late in 0, 2:
            raw.result(raw.ids[late], wait=False)
        raw.eventually(lambda: len(raw.done) == 3, "three ends", timeout=20)
        self.assertEqual([(LOST, None), (SUCCEEDED, bowls(1)), (LOST, None)], raw.done, raw)

    def test_neither_a_cancel_nor_the_shutdown_waits_for_a_callback_of_the_client(self, place):
        for callback, state, cancels in ("active_cb", ACTIVE, 2), ("done_cb", SUCCEEDED, 0):
            raw, begun, free = place.meet(), threading.Event(), threading.Event()
            self.addCleanup(free.set)

            def block(*_):
                begun.set()
                free.wait(20)

            goal = raw.send(**{callback: block})
            raw.status((goal, state), wait=False)
            if state == SUCCEEDED:
                raw.result(goal, wait=False)
            self.assertTrue(begun.wait(30), raw)
            before = time.monotonic()
            raw.client.cancel_goal()  # as a server's callback for preempts does, for which done_cb may wait
            raw.client._SimpleActionClient__end_goal(before)
            self.assertEqual(state == ACTIVE, "no ending came" in raw.client.get_goal_status_text(), raw)
            self.assertLess(time.monotonic() - before, 10, raw)
            raw.eventually(lambda: raw.cancels == [goal] * cancels, "a cancel of what runs")

    def test_callback_that_raises_spoils_nothing(self, place):
        raw = place.meet()
        for name, error in itertools.product(("active_cb", "feedback_cb", "done_cb"), (RuntimeError, SystemExit)):
            broken = mock.Mock(side_effect=error("by the test's own callback"))
            goal, fed = raw.send(**{name: broken}), len(raw.fed)
            raw.feedback(goal, "bowl-0", wait=False)
            raw.result(goal, wait=False)  # also ACTIVE by it
            self.assertTrue(raw.client.wait_for_result(PATIENCE), "%s: %s" % (name, raw))
            raw.eventually(lambda: broken.called and len(raw.fed) == fed + (name != "feedback_cb"), "its feedback")
            self.assertEqual(SUCCEEDED, raw.client.get_state(), name)
        goal = raw.send()
        raw.feedback(goal, "bowl-1", wait=False)
        raw.result(goal, wait=False)
        self.ends(raw)
        raw.eventually(lambda: raw.fed == ["bowl-0"] * 4 + ["bowl-1"], "the last feedback")
        self.assertEqual((5, 5), (len(raw.done), len(raw.active)), raw)

    def test_last_feedback_is_heard_though_its_callback_is_slow(self, place):
        raw, go_on = place.meet(), threading.Event()

        def slow(feedback):
            go_on.wait(30)
            raw.hear_feedback(feedback)

        goal = raw.send(feedback_cb=slow)
        for bowl in bowls(3):
            raw.feedback(goal, bowl, wait=False)
        raw.status((goal, ACTIVE))
        self.ends(raw, goal)
        go_on.set()
        raw.eventually(lambda: raw.fed == bowls(3), "feedback of %s" % bowls(3))

    def test_callbacks_that_a_program_sets_later_count_and_it_sees_done_when_done_cb_is_through(self, place):
        raw, heard = place.meet(), []
        goal = raw.send()
        raw.client.feedback_cb = lambda feedback: heard.append(feedback.last_dish_washed)
        raw.client.done_cb = lambda *_: heard.append(raw.client.simple_state)
        raw.feedback(goal, "bowl-0")
        raw.status((goal, ACTIVE))
        raw.result(goal)
        self.assertEqual(["bowl-0", SimpleGoalState.ACTIVE], heard, raw)
        self.assertEqual(SimpleGoalState.DONE, raw.client.simple_state, raw)
        raw.result(raw.send(done_cb=lambda *_: raw.client.stop_tracking_goal()))
        self.assertEqual(SimpleGoalState.DONE, raw.client.simple_state, raw)

    def test_nothing_of_an_older_goal_reaches_the_newer_one(self, place):
        raw, told = place.meet(), mock.Mock()
        older, handle = raw.send(done_cb=told, active_cb=told, feedback_cb=told), raw.client.gh
        threads = ThreadPoolExecutor(1)
        self.addCleanup(threads.shutdown)
        waited = threads.submit(raw.client.wait_for_result, PATIENCE)
        self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.2)))
        newer = raw.send()
        raw.feedback(older, "bowl-0")
        raw.status((older, ACTIVE), (newer, PENDING))
        handle.cancel()
        raw.eventually(lambda: raw.cancels == [older], "a cancel of the older goal, and no other")
        raw.status((older, PREEMPTING), (newer, PENDING))
        raw.result(older, PREEMPTED)
        self.assertEqual((PENDING, PREEMPTED), (raw.client.get_state(), handle.get_goal_status()), raw)
        self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.2)))
        self.ends(raw, newer)
        self.assertTrue(waited.result(), "whoever waited for the older goal waits for the newer one: %s" % raw)
        self.assertEqual(([], [], [(SUCCEEDED, bowls(1))]), (told.mock_calls, raw.fed, raw.done), raw)

    def test_answer_that_comes_before_send_goal_returns_is_heard(self, place):
        raw = place.meet()

        def answer():
            raw.eventually(lambda: raw.ids, "a goal")
            raw.feedback(raw.ids[0], "bowl-0")
            raw.status((raw.ids[0], ACTIVE))
            raw.result(raw.ids[0])

        raw.while_sending(answer)
        raw.send()
        self.ends(raw)
        self.assertEqual(([(SUCCEEDED, bowls(1))], [True], ["bowl-0"]), (raw.done, raw.active, raw.fed), raw)

    def test_goals_of_two_threads_each_hear_their_own_end_or_none(self, place):
        raw, done = place.meet(), []

        def send(minutes):
            raw.client.send_goal(WashTheDishesGoal(minutes), lambda *end: done.append((minutes, end)))

        raw.while_sending(lambda: send(2))
        send(1)
        raw.eventually(lambda: len(raw.ids) == 2, "both goals")
        for goal in raw.goals:
            raw.result(goal.goal_id.id, count=goal.goal.number_of_minutes)
        self.assertTrue(raw.client.wait_for_result(PATIENCE), raw)
        result = raw.client.get_result()
        self.assertEqual((bowls(2), [(2, (SUCCEEDED, result))]), (result.dishes_washed, done), raw)

    def test_questions_while_a_goal_is_sent_are_answered_for_the_older_or_the_newer_one(self, place):
        raw, said = place.meet(), []
        for question, *answers in (("get_state", SUCCEEDED, PENDING), ("get_goal_status_text", ""),
                                   ("get_result", WashTheDishesResult(bowls(1)), None)):
            self.ends(raw, raw.send())
            raw.while_sending(lambda: said.append(getattr(raw.client, question)()))
            goal = raw.send()
            raw.eventually(lambda: said, "an answer")
            self.assertIn(said.pop(), answers, raw)
            raw.result(goal)

    def test_goal_that_cannot_be_sent_does_not_spoil_the_next(self, place):
        raw = place.meet()
        for wrong, error in ((WashTheDishesGoal("many"), rospy.ROSSerializationException), (
                WashTheDishesGoal(2**40), rospy.ROSSerializationException), (String("wash"), AttributeError)):
            with self.assertRaises(error):
                raw.client.send_goal(wrong)
            self.assertEqual(LOST, raw.client.get_state(), "without a goal after %s" % wrong)
            self.ends(raw, raw.send())
        self.assertEqual(3, len(raw.ids), raw)

    # --- what is sent, in whatever order ---

    def test_older_goal_is_not_told_to_the_callbacks_of_the_newer_one_which_is_sent_meanwhile(self, place):
        raw, reads, told = place.meet(), threading.Event(), mock.Mock()

        class Slow(type(raw.client)):
            def __getattribute__(self, name):
                if name in ("done_cb", "feedback_cb"):
                    reads.set()
                    time.sleep(0.3)
                return super().__getattribute__(name)

        raw.client.__class__ = Slow
        for hear, *what in (raw.feedback, "bowl-0"), (raw.result,):
            reads.clear()
            hear(raw.send(), *what, wait=False)
            self.assertTrue(reads.wait(30), raw)
            raw.client.send_goal(WashTheDishesGoal(2), told, told, told)
            hear("nobody's", *what)  # the topic keeps its order: the other one was heard
        self.assertEqual([], told.mock_calls, raw)

    def test_state_is_an_ending_when_the_result_is_there_and_not_before(self, place):
        raw = place.meet()
        for meanwhile, *before, state in (
                (ACTIVE, SUCCEEDED), (ACTIVE, ACTIVE, SUCCEEDED), (ACTIVE, PENDING, ACTIVE, ABORTED),
                (ACTIVE, ACTIVE, PREEMPTING, PREEMPTED), (ACTIVE, PREEMPTED), (PENDING, PENDING, REJECTED),
                (ACTIVE, RECALLING, PREEMPTING, PREEMPTED), (PENDING, RECALLED),
                (PENDING, PENDING, RECALLING, RECALLED)):
            goal = raw.send()
            for one in (*before, state):
                raw.status((goal, one))
            self.assertEqual((meanwhile, None), (raw.client.get_state(), raw.client.get_result()), raw)
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.1)))
            self.ends(raw, goal, state)
        self.assertEqual(9, len(raw.done), raw)
        begun, free = threading.Event(), threading.Event()
        goal = raw.send(active_cb=lambda: begun.set() or free.wait(20))
        raw.result(goal, wait=False)
        self.assertTrue(begun.wait(30), raw)
        self.assertEqual((ACTIVE, None), (raw.client.get_state(), raw.client.get_result()), raw)
        free.set()

    def test_result_ends_the_goal_whatever_status_came_before_it_and_comes_after_it(self, place):
        raw = place.meet()
        for state in SUCCEEDED, ABORTED, PREEMPTED, RECALLED, REJECTED:
            for before, after in (((), (ACTIVE, state)), ((PENDING,), (ACTIVE,)), ((ACTIVE,), (PREEMPTING, state)),
                                  ((ACTIVE, PENDING), ()), ((PREEMPTING,), (state,)), ((state,), (state,))):
                goal = raw.send()
                for one in before:
                    raw.status((goal, one))
                self.ends(raw, goal, state)
                for one in after:
                    raw.status((goal, one))
                raw.status()  # as of a server that has forgotten it
                self.ends(raw, goal, state)
        self.assertEqual((30, 24), (len(raw.done), len(raw.active)), raw)

    def test_cancel_after_the_end_changes_nothing_and_is_not_sent(self, place):
        raw = place.meet()
        goal = raw.send()
        raw.status((goal, ACTIVE))
        self.ends(raw, goal)
        raw.client.cancel_goal()
        raw.client.gh.cancel()
        raw.status((goal, PREEMPTING))
        raw.status()
        self.ends(raw)
        self.assertEqual(1, len(raw.done), raw)
        newer = raw.send()
        raw.client.cancel_goal()
        raw.eventually(lambda: newer in raw.cancels, "a cancel")
        self.assertEqual([newer], raw.cancels)

    def test_status_from_before_the_goal_does_not_make_it_lost(self, place):
        raw = place.meet()
        goal = raw.send()
        raw.client.cancel_goal()
        raw.status()
        raw.status(("/another", ACTIVE))
        self.assertEqual(PENDING, raw.client.get_state(), raw)
        raw.status((goal, PREEMPTING))
        self.assertEqual(ACTIVE, raw.client.get_state(), raw)
        self.ends(raw, goal, PREEMPTED)

    def test_goal_that_a_server_started_anew_does_not_know_is_lost_and_stays_so(self, place):
        raw = place.meet()
        goal = raw.send()
        raw.status((goal, ACTIVE))
        raw.status()
        self.assertFalse(raw.client.wait_for_result(PATIENCE), raw)
        self.assertIn("no longer knows the goal", raw.client.get_failure())
        raw.status((goal, ACTIVE))
        raw.result(goal)
        self.assertEqual((LOST, None, [(LOST, None)]), (raw.client.get_state(), raw.client.get_result(), raw.done), raw)
        self.ends(raw, raw.send())

    def test_goal_whose_result_got_lost_does_not_wait_for_ever_nor_does_that_of_a_client_that_was_stopped(self, place):
        raw = place.meet(heartbeat_timeout=1.0)
        goal = raw.send()
        for state in ACTIVE, SUCCEEDED:
            raw.status((goal, state))
        with ThreadPoolExecutor(1) as thread:
            waited = thread.submit(raw.client.wait_for_result, PATIENCE)
            raw.eventually(lambda: raw.status() or waited.done(), "an end of the wait", timeout=1 + SLACK)
        self.assertEqual((LOST, [(LOST, None)]), (raw.client.get_state(), raw.done), raw)
        raw.eventually(lambda: raw.cancels == [goal], "a cancel, in case the server is only asleep")
        raw.send()
        with ThreadPoolExecutor(1) as thread:
            waited = thread.submit(raw.client.wait_for_result, PATIENCE)
            self.assertFalse(raw.client.wait_for_result(0.2), raw)
            raw.client.stop_tracking_goal()
            self.assertFalse(waited.result(), raw)
        raw.send()
        raw.client.action_client.stop()
        self.assertFalse(raw.client.wait_for_result(PATIENCE), raw)
        self.assertEqual([(LOST, None)] * 2, raw.done, raw)
        with self.assertRaises(rospy.ROSException):
            raw.client.send_goal(WashTheDishesGoal(1))

    def test_goal_that_got_lost_is_sent_again_as_it_was_though_its_message_has_changed(self, place):
        raw, goal, begun = place.meet(), WashTheDishesGoal(3), time.monotonic()
        raw.client.send_goal(goal)
        goal.number_of_minutes = 9
        raw.eventually(lambda: len(raw.goals) > 1, "the goal once more", timeout=10)
        self.assertGreater(time.monotonic() - begun, 1, "s after which a goal that was just sent is sent again")
        raw.eventually(lambda: time.monotonic() - begun > 10, "a time after which a server might have forgotten it")
        self.assertLessEqual(len(raw.goals), 5, raw)
        self.assertEqual({(raw.ids[0], 3)}, {(one.goal_id.id, one.goal.number_of_minutes) for one in raw.goals}, raw)
        raw.send()
        raw.client.cancel_goal()
        self.assertFalse(raw.client.wait_for_result(rospy.Duration(2)))
        self.assertEqual(1, len([one for one in raw.goals if one.goal_id.id == raw.ids[-1]]), raw)

    # --- in programs ---

    test_clock_that_begins_ends_no_wait_and_without_a_clock_one_ends = in_program(
        "clock_begins", prints="[False, 'waits', 'waits']\n[False, True, True]", simulated=True)
    test_goals_are_served_and_a_heart_beats_on_on_a_clock_that_was_set_back = in_program(
        "clock_set_back", prints="after a goal: SUCCEEDED\nafter a cancel up to then: SUCCEEDED\n"
                                 "during a goal: SUCCEEDED\nfor a heartbeat: SUCCEEDED", simulated=True)
    test_stopped_clients_and_servers_leave_nothing = in_program("leave_nothing", prints="nothing")
    test_server_takes_goals_up_without_a_pause = in_program("pauses", prints="none")
    test_goals_that_follow_each_other_fast_are_not_complained_of_and_the_last_one_ends = in_program("fast")

    def test_topics_may_be_renamed_one_by_one(self, place):
        place.works()
        self.prints(place.start(PROGRAMS, "client", "here", *("here/%s:=works/%s" % (topic, topic) for topic in (
            "goal", "cancel", "status", "feedback", "result"))), "SUCCEEDED")

    def test_two_clients_of_a_name_have_ids_of_their_own_in_a_moment_of_simulated_time(self, _):
        with Master() as master:
            master.api.setParam("/use_sim_time", True)
            master.start(PROGRAMS, "moment").expect("ready")
            for _ in range(2):
                self.prints(master.start(PROGRAMS, "client", "work"), "SUCCEEDED")

    def test_program_that_fails_after_it_has_started_a_server_ends(self, place):
        node = place.start(PROGRAMS, "fails")
        self.assertEqual(1, node.wait(), node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "reports", Reports)
