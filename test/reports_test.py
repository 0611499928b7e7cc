#!/usr/bin/python3
"""What users of actionlib in Python have reported: a test names its threads on GitHub, doc/robust.md lists them.

ACTIONLIB=plain tries actionlib itself; the page says how each test ends there.
"""
import contextlib
import os
import signal
import socket
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from rospy.impl.tcpros_base import get_tcpros_server_address
from std_msgs.msg import String

from raw_client import ABORTED, ACTIVE, PENDING, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED
from actions_tutorial.msg import WashTheDishesGoal
from scenes import SLACK, NodeCase, check_quiet, concurrently
from processes import PACKAGE, Group, Master, bowls, eventually
from raw_server import PATIENCE, RawServer, client_of
from reports_programs import forward

LOST, REJECTED = GoalStatus.LOST, GoalStatus.REJECTED
PROGRAMS = os.path.join(PACKAGE, "test", "reports_programs.py")


class Place(Group):
    """A namespace (str) on this process's master; alone(): a master of its own."""

    def __init__(self, namespace):
        super().__init__(ROS_NAMESPACE=namespace)
        self.namespace, self._ends = namespace, contextlib.ExitStack()

    def meet(self, **options):
        """A server that does as it is told, and its client with these options. -> RawServer"""
        server = RawServer(self.namespace + "/raw", **options)
        self._ends.callback(server.close)
        return server

    def alone(self, simulated=False):
        """-> Master, with simulated time if asked for"""
        master = self._ends.enter_context(Master())
        master.api.setParam("/use_sim_time", simulated)
        return master

    def stop(self):
        super().stop()
        self._ends.close()


@concurrently(Place)
class Reports(NodeCase):

    def ends(self, raw, state=SUCCEEDED, result=bowls(1)):
        """The goal has ended so, its client knows, and has been told once."""
        self.assertTrue(raw.client.wait_for_result(PATIENCE), raw)
        self.assertEqual((state, result), (raw.client.get_state(), raw.client.get_result().dishes_washed), raw)
        self.assertEqual((state, result), raw.done[-1], raw)

    def prints(self, node, *lines, timeout=60):
        """The node (Process) ends well within timeout (s), having printed these lines (str), and no error."""
        self.assertEqual(0, node.wait(timeout), node)
        self.assertEqual(list(lines), node.stdout.splitlines(), node)
        check_quiet(node)

    def works(self, place, **options):
        """A server of actionlib's, and a client with these options that has found it. -> Process, client"""
        server = place.start(PROGRAMS, "works")
        server.expect("ready")
        client = client_of(place.namespace + "/works", **options)
        self.assertTrue(client.wait_for_server(PATIENCE), server)
        return server, client

    # --- waiting ---

    def test_second_try_right_after_a_time_out_is_not_lost(self, place):
        server, client = self.works(place, heartbeat_timeout=1.5)
        server.signal(signal.SIGSTOP)
        eventually(lambda: server.usage.status() == "stopped", "a server that is frozen", server)
        client.send_goal(WashTheDishesGoal(0))
        self.assertFalse(client.wait_for_result(PATIENCE), server)
        self.assertEqual(LOST, client.get_state(), server)
        client.send_goal(WashTheDishesGoal(0))
        self.assertEqual(PENDING, client.get_state(), server)
        self.assertFalse(client.wait_for_server(0.1), server)
        server.signal(signal.SIGCONT)
        self.assertTrue(client.wait_for_result(PATIENCE), server)
        self.assertIsNone(client.get_failure(), server)

    def test_server_that_works_in_its_goal_callback_is_waited_for_and_a_frozen_one_is_lost(self, place):
        server, client = self.works(place, heartbeat_timeout=1.0)
        client.send_goal(WashTheDishesGoal(2))
        self.assertTrue(client.wait_for_result(PATIENCE), server)
        self.assertEqual(SUCCEEDED, client.get_state(), server)
        client.send_goal(WashTheDishesGoal(60))
        eventually(lambda: server.stdout.count("works") == 2, "the server at work", server)
        server.signal(signal.SIGSTOP)
        self.assertFalse(client.wait_for_result(PATIENCE), server)
        self.assertEqual(LOST, client.get_state(), server)
        self.assertFalse(client.wait_for_server(rospy.Duration(0.5)), server)

    def test_failure_is_told_for_no_server_for_no_end_and_for_a_goal_that_was_not_sent(self, place):
        nobody = client_of(place.namespace + "/nobody")
        self.assertFalse(nobody.wait_for_server(rospy.Duration(0.1)))
        self.assertRegex(nobody.get_failure(), "/nobody.* 0.1 s")
        self.assertEqual((False, None), (nobody.wait_for_result(), nobody.get_result()))
        nobody.cancel_goal()
        nobody.send_goal(WashTheDishesGoal(1))
        self.assertIn("PENDING", nobody.get_failure())
        with self.assertRaises(rospy.ROSSerializationException):
            nobody.send_goal(WashTheDishesGoal("many"))
        self.assertEqual(LOST, nobody.get_state())
        self.assertIn("cannot be sent", nobody.get_failure())
        raw = place.meet()
        goal = raw.send()
        self.assertIn("PENDING", raw.client.get_failure())
        raw.status((goal, ACTIVE))
        self.assertIn("ACTIVE", raw.client.get_failure())
        raw.result(goal)
        self.ends(raw)
        self.assertIsNone(raw.client.get_failure())

    def test_client_that_was_stopped_loses_its_goal_without_an_error_and_sends_none(self, place):
        raw = place.meet(heartbeat_timeout=0.5)
        raw.send()
        raw.client.action_client.stop()
        self.assertFalse(raw.client.wait_for_result(PATIENCE), raw)
        self.assertEqual(LOST, raw.client.get_state(), raw)
        with self.assertRaises(rospy.ROSException):
            raw.client.send_goal(WashTheDishesGoal(1))

    def test_server_is_found_when_its_results_and_feedback_get_here_and_not_before(self, place):
        raw = place.meet()
        for topic in "result", "feedback":
            raw.unpublish(topic)
            self.assertFalse(raw.client.wait_for_server(0.3), topic)
            raw.publish(topic)
            self.assertTrue(raw.client.wait_for_server(PATIENCE), topic)

    def test_silent_peer_of_a_node_of_rospys_keeps_no_client_from_its_server(self, place):
        place.meet()
        with socket.create_connection(("localhost", get_tcpros_server_address()[1])):
            self.works(place)

    def found_until_it_is_killed(self, place):
        """Returns a client whose goal has SUCCEEDED, and whose server is there no more."""
        server, client = self.works(place)
        client.send_goal(WashTheDishesGoal(0))
        self.assertTrue(client.wait_for_result(PATIENCE))
        server.stop()
        eventually(lambda: not client.wait_for_server(rospy.Duration(0.3)), "no server any more", timeout=10)
        return client

    def test_server_that_was_killed_is_not_found_before_it_is_back(self, place):
        client = self.found_until_it_is_killed(place)
        place.start(PROGRAMS, "works").expect("ready")
        self.assertTrue(client.wait_for_server(PATIENCE))
        client.send_goal(WashTheDishesGoal(0))
        self.assertTrue(client.wait_for_result(PATIENCE))
        self.assertEqual(SUCCEEDED, client.get_state())

    def test_failure_to_find_a_server_is_told_after_a_goal_that_succeeded(self, place):
        self.assertRegex(str(self.found_until_it_is_killed(place).get_failure()), "/works.* 0.3 s")

    def test_seconds_are_a_time_as_well_as_a_duration_is(self, place):
        """ros/ros_comm #1658, #1703, which gave rospy the other half of it"""
        nobody = client_of(place.namespace + "/nobody")
        for timeout in 0.1, -1:
            self.assertFalse(nobody.wait_for_server(timeout))
        raw = place.meet()
        self.assertTrue(raw.client.wait_for_server(30))
        goal = raw.send()
        for timeout in 0.2, 1, rospy.Duration(0.2):
            begun = time.monotonic()
            self.assertFalse(raw.client.wait_for_result(timeout))
            self.assertGreater(time.monotonic() - begun, 0.15, timeout)
        raw.result(goal)
        for timeout in 30, 30.0, 0, rospy.Duration(30), rospy.Duration():
            self.assertTrue(raw.client.wait_for_result(timeout), timeout)
        self.assertEqual(PENDING, raw.client.send_goal_and_wait(WashTheDishesGoal(1), 0.2, 0.2))

    def clock_begins(self, place, what, answer):
        self.prints(place.alone(simulated=True).start(PROGRAMS, "clock_begins", what), "[%s]" % answer)

    def test_clock_that_begins_does_not_end_the_wait_for_a_result(self, place):
        """ros/actionlib #58"""
        self.clock_begins(place, "result", True)

    def test_clock_that_begins_does_not_end_the_wait_for_a_server(self, place):
        """ros/actionlib #19, #137, #138; ros/ros_comm #354, #1839"""
        self.clock_begins(place, "server", True)

    def test_wait_for_a_server_ends_without_a_clock(self, place):
        """ros/actionlib #19, #137"""
        self.clock_begins(place, "nothing", False)

    def test_short_waits_for_a_server_far_away_find_it_and_leave_no_threads(self, place):
        master = place.alone()
        address = "localhost", int(master.uri.rpartition(":")[2])
        with forward(address, 0.05) as port:
            self.prints(master.start(PROGRAMS, "short_waits", ROS_MASTER_URI="http://localhost:%d" % port), "True")

    def test_two_threads_that_wait_return_when_done_cb_has_and_the_state_can_be_asked_for_meanwhile(self, place):
        """ros/actionlib #150, #155, #176"""
        raw, inside, go_on, waited = place.meet(), threading.Event(), threading.Event(), []

        def done_cb(state, result):
            inside.set()
            go_on.wait(30)
            raw.hear_done(state, result)

        goal = raw.send(done_cb=done_cb)
        threads = [threading.Thread(target=lambda: waited.append(raw.client.wait_for_result(PATIENCE)), daemon=True)
                   for _ in range(2)]
        [thread.start() for thread in threads]
        raw.result(goal, wait=False)
        self.assertTrue(inside.wait(30), raw)
        try:
            self.assertEqual(SUCCEEDED, raw.client.get_state())
            self.assertEqual(bowls(1), raw.client.get_result().dishes_washed)
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.5)), raw)
            self.assertEqual([], waited)
        finally:
            go_on.set()
        [thread.join(30) for thread in threads]
        self.assertEqual([True, True], waited, raw)
        self.ends(raw)

    # --- callbacks ---

    def test_goal_sent_from_done_cb_is_told_of_its_end_and_waited_for(self, place):
        """ros/actionlib #193"""
        raw, sent = place.meet(), threading.Event()

        def again(state, result):
            raw.hear_done(state, result)
            raw.client.send_goal(WashTheDishesGoal(2), again if len(raw.done) < 3 else raw.hear_done)
            sent.set()
            time.sleep(0.2)  # the fault itself: who waits looks meanwhile

        raw.send(done_cb=again)
        for count in range(1, 4):
            sent.clear()
            with ThreadPoolExecutor(1) as thread:
                waited = thread.submit(raw.client.wait_for_result, PATIENCE)
                raw.result(raw.ids[-1], count=count, wait=False)
                self.assertTrue(waited.result(), raw)
            self.assertTrue(sent.is_set(), raw)
            raw.eventually(lambda: len(raw.ids) == count + 1, "the next goal")
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.3)), raw)
        raw.result(raw.ids[-1], count=4)
        self.ends(raw, result=bowls(4))
        self.assertEqual([(SUCCEEDED, bowls(count)) for count in range(1, 5)], raw.done, raw)

    def test_done_cb_that_takes_its_time_holds_up_no_news_of_the_next_goal(self, place):
        raw, free = place.meet(), threading.Event()
        self.addCleanup(free.set)
        raw.result(raw.send(done_cb=lambda *_: raw.client.send_goal(WashTheDishesGoal(2)) or free.wait(50)), wait=False)
        raw.eventually(lambda: len(raw.ids) == 2, "the next goal")
        raw.status((raw.ids[1], ACTIVE), wait=False)
        raw.eventually(lambda: raw.client.get_state() == ACTIVE, "the news", timeout=20)

    def test_goal_that_done_cb_sends_when_the_server_is_lost_is_looked_after_meanwhile(self, place):
        raw, ends = place.meet(heartbeat_timeout=1.0), []

        def done(state, _):
            ends.append(state)
            if len(ends) == 1:
                raw.client.send_goal(WashTheDishesGoal(2), done)
                raw.client.wait_for_result(PATIENCE)

        raw.send(done_cb=done)
        raw.eventually(lambda: raw.status(wait=False) or len(ends) == 2, "two ends", timeout=20)
        self.assertEqual([LOST, LOST], ends, raw)

    def test_shutdown_waits_for_no_callback_of_the_client(self, place):
        for state, callback in (ACTIVE, "active_cb"), (SUCCEEDED, "done_cb"):
            raw, free, said = place.meet(), threading.Event(), []
            self.addCleanup(free.set)
            goal = raw.send(**{callback: lambda *_: said.append("begun") or free.wait(20) or said.append("over")})
            if state == ACTIVE:
                raw.status((goal, ACTIVE), wait=False)
            else:
                raw.result(goal, wait=False)
            raw.eventually(lambda: said, "the callback")
            raw.client._SimpleActionClient__end_goal(time.monotonic())
            raw.eventually(lambda: raw.cancels == [goal] * (state == ACTIVE), "a cancel of what runs")
            self.assertEqual(["begun"], said, raw)

    def test_callback_that_raises_spoils_nothing(self, place):
        raw, errors = place.meet(), (RuntimeError, SystemExit)
        for name, error in [(name, error) for name in ("active_cb", "feedback_cb", "done_cb") for error in errors]:
            def broken(*_):
                raise error("by the test's own callback")

            goal, fed = raw.send(**{name: broken}), len(raw.fed) + (name != "feedback_cb")
            raw.feedback(goal, "bowl-0", wait=False)
            raw.result(goal, wait=False)  # also ACTIVE by it
            self.assertTrue(raw.client.wait_for_result(PATIENCE), "%s: %s" % (name, raw))
            raw.eventually(lambda: len(raw.fed) == fed, "its feedback, which the result may have overtaken")
            self.assertEqual(SUCCEEDED, raw.client.get_state(), name)
        goal = raw.send()
        raw.feedback(goal, "bowl-1", wait=False)
        raw.result(goal, wait=False)
        self.ends(raw)
        raw.eventually(lambda: raw.fed == ["bowl-0"] * 4 + ["bowl-1"], "the last feedback")
        self.assertEqual((5, 5), (len(raw.done), len(raw.active)), raw)

    def test_last_feedback_is_heard_though_its_callback_is_slow(self, place):
        """ros/actionlib #213"""
        raw, go_on = place.meet(), threading.Event()
        goal = raw.send(feedback_cb=lambda one: [go_on.wait(30), raw.fed.append(one.last_dish_washed)])
        for bowl in bowls(3):
            raw.feedback(goal, bowl, wait=False)
        raw.status((goal, ACTIVE))
        raw.result(goal)
        self.ends(raw)
        go_on.set()
        raw.eventually(lambda: raw.fed == bowls(3), "feedback of %s" % bowls(3))

    def test_nothing_of_an_older_goal_reaches_the_newer_one(self, place):
        """ros/actionlib #57, #177, and a comment in #213"""
        raw = place.meet()
        older, handle = raw.send(done_cb=lambda *_: raw.fed.append("done"), active_cb=lambda: raw.fed.append("active"),
                                 feedback_cb=lambda _: raw.fed.append("fed")), raw.client.gh
        newer = raw.send()
        raw.feedback(older, "bowl-0")
        raw.status((older, ACTIVE), (newer, PENDING))
        handle.cancel()
        raw.eventually(lambda: raw.cancels == [older], "a cancel of the older goal, and no other")
        raw.status((older, PREEMPTING), (newer, PENDING))
        raw.result(older, PREEMPTED)
        self.assertEqual((PENDING, PREEMPTED), (raw.client.get_state(), handle.get_goal_status()), raw)
        self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.2)))
        raw.result(newer)
        self.ends(raw)
        self.assertEqual([], raw.fed, raw)

    def test_answer_that_comes_before_send_goal_returns_is_heard(self, place):
        """ros/actionlib #206; in roscpp #64, #66, #75"""
        raw, answers = place.meet(), []

        def answer():
            raw.eventually(lambda: raw.ids, "a goal")
            goal = raw.ids[0]
            raw.feedback(goal, "bowl-0")
            raw.status((goal, ACTIVE))
            raw.result(goal)

        def publish(goal):
            answers.append(threading.Thread(target=answer, daemon=True))
            answers[0].start()
            raw.client.action_client.pub_goal.publish(goal)
            answers[0].join(1)  # or what comes is kept until we are back, which is well

        raw.client.action_client.manager.register_send_goal_fn(publish)
        raw.send()
        answers[0].join(30)
        self.ends(raw)
        self.assertEqual(([(SUCCEEDED, bowls(1))], [True], ["bowl-0"]), (raw.done, raw.active, raw.fed), raw)

    def test_goals_of_two_threads_each_hear_their_own_end_or_none(self, place):
        """ros/actionlib #206"""
        raw, inside, done = place.meet(), threading.Semaphore(0), []

        def publish(goal):
            inside.release()
            raw.client.action_client.pub_goal.publish(goal)
            if goal.goal.number_of_minutes == 1:
                time.sleep(0.5)  # so that the other one is sent meanwhile, unless somebody sees to it that it is not

        raw.client.action_client.manager.register_send_goal_fn(publish)
        threads = [threading.Thread(target=raw.client.send_goal, daemon=True, args=[
            WashTheDishesGoal(number), lambda state, result, number=number: done.append(
                (number, len(result.dishes_washed)))]) for number in (1, 2)]
        threads[0].start()
        inside.acquire()
        threads[1].start()
        [thread.join(30) for thread in threads]
        raw.eventually(lambda: len(raw.ids) == 2, "both goals")
        for goal in raw.goals:
            raw.result(goal.goal_id.id, count=goal.goal.number_of_minutes)
        self.assertTrue(raw.client.wait_for_result(PATIENCE), raw)
        self.assertEqual([(2, 2)], done, "minutes and bowls: %s" % raw)
        self.assertEqual(bowls(2), raw.client.get_result().dishes_washed)

    def test_questions_while_a_goal_is_sent_are_answered_for_the_older_or_the_newer_one(self, place):
        raw, said, threads = place.meet(), {}, []
        raw.result(raw.send(3))
        self.ends(raw)
        older = raw.client.get_result()

        def publish(goal):
            for name in "get_state", "get_result", "get_goal_status_text":
                threads.append(threading.Thread(target=lambda name=name: said.update(
                    {name: getattr(raw.client, name)()}), daemon=True))
                threads[-1].start()
            threads[0].join(0.5)  # or it waits until the goal is sent, which is well
            raw.client.action_client.pub_goal.publish(goal)

        raw.client.action_client.manager.register_send_goal_fn(publish)
        raw.send()
        [thread.join(30) for thread in threads]
        self.assertIn(said.get("get_state"), (SUCCEEDED, PENDING), raw)
        self.assertIn(said.get("get_result", "nothing"), (older, None), raw)
        self.assertEqual("", said.get("get_goal_status_text"), raw)

    def test_goal_that_cannot_be_sent_does_not_spoil_the_next(self, place):
        raw = place.meet()
        for wrong in WashTheDishesGoal("many"), WashTheDishesGoal(2**40), String("wash"):
            with self.assertRaises(Exception):
                raw.client.send_goal(wrong)
            self.assertEqual(LOST, raw.client.get_state(), "without a goal after %s" % wrong)
            raw.result(raw.send())
            self.ends(raw)
        self.assertEqual(3, len(raw.ids), raw)

    # --- what is sent, in whatever order ---

    def test_older_goal_is_not_told_to_the_callbacks_of_the_newer_one_which_is_sent_meanwhile(self, place):
        raw, reads, told = place.meet(), threading.Event(), []

        def done_cb(client):
            reads.set()
            time.sleep(0.3)
            return vars(client)["done_cb"]

        raw.client.__class__ = type("Slow", (type(raw.client),), {
            "done_cb": property(done_cb, lambda client, callback: vars(client).update(done_cb=callback))})
        raw.result(raw.send(), wait=False)
        self.assertTrue(reads.wait(30), raw)
        raw.client.send_goal(WashTheDishesGoal(2), *[lambda *_: told.append(True)] * 2)
        raw.result("nobody's")  # the topic keeps its order: the other one was heard
        self.assertEqual([], told, raw)

    def test_state_is_an_ending_when_the_result_is_there_and_not_before(self, place):
        """ros/actionlib #116"""
        raw = place.meet()
        for before, state, meanwhile in (
                ((), SUCCEEDED, ACTIVE), ((ACTIVE,), SUCCEEDED, ACTIVE), ((PENDING, ACTIVE), ABORTED, ACTIVE),
                ((ACTIVE, PREEMPTING), PREEMPTED, ACTIVE), ((), PREEMPTED, ACTIVE), ((PENDING,), REJECTED, PENDING),
                ((), RECALLED, PENDING), ((PENDING, GoalStatus.RECALLING), RECALLED, PENDING)):
            goal = raw.send()
            for one in before + (state,):
                raw.status((goal, one))
            self.assertEqual((meanwhile, None), (raw.client.get_state(), raw.client.get_result()), raw)
            self.assertFalse(raw.client.wait_for_result(rospy.Duration(0.1)))
            raw.result(goal, state)
            self.ends(raw, state)
        self.assertEqual(8, len(raw.done), raw)

    def test_result_ends_the_goal_whatever_status_came_before_it_and_comes_after_it(self, place):
        raw = place.meet()
        for state in SUCCEEDED, ABORTED, PREEMPTED, RECALLED, REJECTED:
            for before, after in (((), (ACTIVE, state)), ((PENDING,), (ACTIVE,)), ((ACTIVE,), (PREEMPTING, state)),
                                  ((ACTIVE, PENDING), ()), ((PREEMPTING,), (state,)), ((state,), (state,))):
                goal = raw.send()
                for one in before:
                    raw.status((goal, one))
                raw.result(goal, state)
                self.ends(raw, state)
                for one in after:
                    raw.status((goal, one))
                raw.status()  # as of a server that has forgotten it
                raw.result(goal, state)
                self.ends(raw, state)
        self.assertEqual((30, 24), (len(raw.done), len(raw.active)), raw)

    def test_cancel_after_the_end_changes_nothing_and_is_not_sent(self, place):
        """ros/actionlib #126, #130"""
        raw = place.meet()
        goal = raw.send()
        raw.status((goal, ACTIVE))
        raw.result(goal)
        self.ends(raw)
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
        raw.result(goal, PREEMPTED)
        self.ends(raw, PREEMPTED)

    def test_goal_that_a_server_started_anew_does_not_know_is_lost_and_stays_so(self, place):
        """PR2/pr2_common #139; in roscpp ros/actionlib #175"""
        raw = place.meet()
        goal = raw.send()
        raw.status((goal, ACTIVE))
        raw.status()
        self.assertFalse(raw.client.wait_for_result(PATIENCE), raw)
        self.assertIn("no longer knows the goal", raw.client.get_failure())
        raw.status((goal, ACTIVE))
        raw.result(goal)
        self.assertEqual((LOST, None, [(LOST, None)]), (raw.client.get_state(), raw.client.get_result(), raw.done), raw)
        raw.result(raw.send())
        self.ends(raw)

    def test_goal_whose_result_got_lost_does_not_wait_for_ever(self, place):
        """ros/actionlib #181; in roscpp #75, #119"""
        raw, waited = place.meet(heartbeat_timeout=2.0), []
        goal = raw.send()
        for state in ACTIVE, SUCCEEDED:
            raw.status((goal, state))
        waiting = threading.Thread(target=lambda: waited.append(raw.client.wait_for_result()), daemon=True)
        waiting.start()
        raw.eventually(lambda: raw.status() or waited, "an end of the wait", timeout=2 + SLACK)
        self.assertEqual((LOST, [(LOST, None)]), (raw.client.get_state(), raw.done), raw)
        raw.eventually(lambda: raw.cancels == [goal], "a cancel, in case the server is only asleep")

    def test_goal_that_got_lost_is_sent_again_as_it_was_though_its_message_has_changed(self, place):
        """ros/actionlib #46"""
        raw, goal = place.meet(), WashTheDishesGoal(3)
        raw.client.send_goal(goal)
        goal.number_of_minutes = 9
        raw.eventually(lambda: len(raw.goals) > 1, "the goal once more", timeout=10)
        first, second = raw.goals[:2]
        self.assertEqual((first.goal_id, 3), (second.goal_id, second.goal.number_of_minutes))

    def test_goal_of_which_nothing_is_heard_is_not_sent_for_longer_than_a_server_remembers_it(self, place):
        raw, begun = place.meet(), time.monotonic()
        raw.send()
        raw.eventually(lambda: time.monotonic() - begun > 10, "some time")
        self.assertLessEqual(len(raw.goals), 5, raw)

    def test_goal_that_was_just_sent_is_not_sent_again(self, place):
        """The client looks at its goal twice a second."""
        raw, late = place.meet(), 0
        for _ in range(10):
            begun, goal = time.monotonic(), raw.send()
            time.sleep(0.2)  # the server thinks
            raw.result(goal)
            late += time.monotonic() - begun >= 1
        self.assertLessEqual(len(raw.goals), 10 + late, raw)

    # --- in programs ---

    def test_goals_that_follow_each_other_fast_are_not_complained_of_and_the_last_one_ends(self, place):
        """ros/actionlib #4, #177, #206"""
        node = place.start(PROGRAMS, "fast")
        self.prints(node, "True SUCCEEDED")
        self.assertEqual(0, node.stderr.count("not tracking") + node.stderr.count("simple state"), node)

    def test_server_takes_goals_up_without_a_pause(self, place):
        """ros/actionlib #212"""
        self.prints(place.start(PROGRAMS, "pauses"), "True")

    def test_topics_may_be_renamed_one_by_one(self, place):
        """ros/ros_comm #209"""
        place.start(PROGRAMS, "server", "there").expect("ready")
        self.prints(place.start(PROGRAMS, "client", "here", *("here/%s:=there/%s" % (topic, topic) for topic in (
            "goal", "cancel", "status", "feedback", "result"))), "SUCCEEDED")

    def test_stopped_clients_and_servers_leave_nothing(self, place):
        """ros/actionlib #48, #142; ros/ros_comm #544"""
        self.prints(place.start(PROGRAMS, "leave_nothing"), "nothing", timeout=120)

    def served_on_a_clock_that_was_set_back_after(self, place, before):
        self.prints(place.alone(simulated=True).start(PROGRAMS, "clock_set_back", before), "SUCCEEDED")

    def test_goal_on_a_clock_that_was_set_back_after_a_goal_is_served(self, place):
        """ros/actionlib #117, #128"""
        self.served_on_a_clock_that_was_set_back_after(place, "ended")

    def test_goal_on_a_clock_that_was_set_back_after_a_cancel_up_to_then_is_served(self, place):
        """ros/actionlib #203"""
        self.served_on_a_clock_that_was_set_back_after(place, "cancelled")

    def test_goal_on_a_clock_that_was_set_back_during_a_goal_is_served(self, place):
        """ros/actionlib #117, #203"""
        self.served_on_a_clock_that_was_set_back_after(place, "running")

    def test_heart_beats_on_on_a_clock_that_was_set_back(self, place):
        """ros/ros_comm #1083"""
        self.served_on_a_clock_that_was_set_back_after(place, "heartbeat")

    def test_two_clients_of_a_name_have_ids_of_their_own_in_a_moment_of_simulated_time(self, place):
        master = place.alone(simulated=True)
        master.start(PROGRAMS, "clock_and_server", "work").expect("ready")
        for _ in range(2):
            self.prints(master.start(PROGRAMS, "client", "work"), "SUCCEEDED")

    def test_program_that_fails_after_it_has_started_a_server_ends(self, place):
        """ros/actionlib #146"""
        node = place.start(PROGRAMS, "fails")
        self.assertEqual(1, node.wait(), node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "reports", Reports)
