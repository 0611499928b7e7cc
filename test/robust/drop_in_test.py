#!/usr/bin/env python3
"""What programs rely on in actionlib, such as attributes, waits and subclasses: each test passes on both libraries.

ACTIONLIB=plain in the environment tries actionlib. drop_in.test runs both.
"""
import os
import signal
import subprocess
import sys
import threading
import time
import weakref

import actionlib
from actionlib import CommState, SimpleGoalState
from actionlib.msg import (
    TestRequestAction, TestRequestActionFeedback, TestRequestActionGoal, TestRequestActionResult, TestRequestGoal)
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from parameterized import parameterized
import rospy
import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import Master
from support.scripted import PROGRAMS, ScriptedCase, script
from support.server_case import ServerCase
from support.states import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED

LIBRARY = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust
TOPICS = {"goal": lambda name: rospy.Subscriber(name, TestRequestActionGoal),
          "cancel": lambda name: rospy.Subscriber(name, GoalID),
          "status": lambda name: rospy.Publisher(name, GoalStatusArray, latch=True, queue_size=1),
          "feedback": lambda name: rospy.Publisher(name, TestRequestActionFeedback, queue_size=1),
          "result": lambda name: rospy.Publisher(name, TestRequestActionResult, queue_size=1)}


class TestClient(ScriptedCase):
    """The scripts begin with 0.2: actionlib's client loses an answer that comes before send_goal returns."""

    library = LIBRARY

    def setUp(self):
        super().setUp()
        self.connect()

    # Attributes

    def test_callbacks_of_a_subclass_are_called(self):
        calls = []

        class Guard(self.library.SimpleActionClient):

            def done_cb(self, state, result):
                calls.append("done")

            def active_cb(self):
                calls.append("active")

            def feedback_cb(self, feedback):
                calls.append("feedback")

        client = Guard("scripted", TestRequestAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(30)))
        client.send_goal(script("0.2 ACTIVE 0.2 feedback 0.2 result:SUCCEEDED"), client.done_cb, client.active_cb,
                         client.feedback_cb)
        self.assertTrue(client.wait_for_result(rospy.Duration(30)))
        self.assertEqual(["active", "feedback", "done"], calls)

    def test_callbacks_are_attributes_and_may_be_set_after_send_goal(self):
        calls = []
        self.client.send_goal(script("go ACTIVE 0.2 feedback 0.2 result:SUCCEEDED"))
        self.assertIsNone(self.client.done_cb)
        self.client.active_cb = lambda: calls.append("active")
        self.client.feedback_cb = lambda _: calls.append("feedback")
        self.client.done_cb = lambda *_: calls.append("done")
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual(["active", "feedback", "done"], calls)

    def test_simple_state_is_pending_then_active_then_done(self):
        self.assertEqual(SimpleGoalState.DONE, self.client.simple_state)
        self.send("0.2 PENDING go ACTIVE go result:ABORTED")
        self.assertEqual(SimpleGoalState.PENDING, self.client.simple_state)
        for state in SimpleGoalState.ACTIVE, SimpleGoalState.DONE:
            self.go()
            self.eventually(lambda: self.client.simple_state == state, "simple_state %d" % state)

    # An older goal

    def test_older_goal_is_freed(self):
        self.send("0.2 ACTIVE 0.1 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        older = weakref.ref(self.client.gh.comm_state_machine)
        self.send("0.2 ACTIVE 0.1 result:SUCCEEDED")
        self.expect(SUCCEEDED)
        self.wait_freed(older)

    def test_older_goal_calls_no_callbacks_and_its_gh_is_updated(self):
        self.send("0.2 PENDING go ACTIVE feedback 0.1 result:ABORTED", 1)
        older = self.client.gh
        self.eventually(lambda: older.get_comm_state() == CommState.PENDING, "a status")
        self.send("0.2 PENDING go 0.5 result:RECALLED", 2)
        self.go()
        self.expect(RECALLED, 2)
        self.assertEqual((ABORTED, 1), (older.get_terminal_state(), older.get_result().the_result))
        self.assertEqual(([], [], [(RECALLED, 2)]), (self.active, self.feedback, self.done))

    def test_outcome_of_an_older_gh_is_delivered(self):
        self.send("0.2 ACTIVE go 0.1 result:ABORTED", 1)
        self.wait_state(ACTIVE)
        older = self.client.gh
        self.send("0.2 ACTIVE")
        self.wait_state(ACTIVE)
        self.client.gh = older
        self.go()
        self.expect(ABORTED, 1)
        self.assertEqual([(ABORTED, 1)], self.done)

    # Send

    def test_id_is_the_node_a_counter_and_the_stamp(self):
        begun, counters = rospy.Time.now(), []
        for _ in range(2):
            self.send("0.2 result:SUCCEEDED")
            self.expect(SUCCEEDED)
        for goal in self.goals:
            node, counter, stamp = goal.goal_id.id.split("-")
            self.assertEqual(rospy.get_name(), node)
            self.assertAlmostEqual(goal.goal_id.stamp.to_sec(), float(stamp), delta=0.001)
            for time_sent in goal.goal_id.stamp, goal.header.stamp:
                self.assertTrue(begun <= time_sent <= rospy.Time.now())
            counters.append(int(counter))
        self.assertEqual([counters[0], counters[0] + 1], counters)

    def test_none_is_an_empty_goal(self):
        self.client.send_goal(None)
        self.eventually(lambda: self.goals, "a goal")
        self.assertEqual(TestRequestGoal(), self.goals[0].goal)

    # Cancel

    def test_cancel_of_a_goal_that_the_client_calls_lost_is_sent(self):
        self.send("0.2 ACTIVE 0.2 unlisted cancel feedback")
        self.expect(GoalStatus.LOST)
        self.client.cancel_goal()
        self.eventually(lambda: self.cancels, "a cancel")

    def test_comm_state_waits_for_cancel_ack_though_active_is_listed(self):
        self.send("0.2 ACTIVE cancel 0.3 PREEMPTING go result:PREEMPTED")
        self.wait_state(ACTIVE)
        seen = []
        rospy.Subscriber("scripted/status", GoalStatusArray, lambda message: seen.append(
            (self.client.gh.get_comm_state(), message.status_list[0].status)))
        self.client.cancel_goal()
        self.eventually(lambda: (CommState.WAITING_FOR_CANCEL_ACK, ACTIVE) in seen[1:], "it waits")
        self.eventually(lambda: self.client.gh.get_comm_state() == CommState.PREEMPTING, "PREEMPTING")
        self.go()
        self.expect(PREEMPTED)

    # Waits

    @parameterized.expand(list(TOPICS))
    def test_server_is_not_connected_without_its_topic(self, missing):
        action = "without_" + missing
        topics = {topic: make(action + "/" + topic) for topic, make in TOPICS.items() if topic != missing}
        client = self.library.SimpleActionClient(action, TestRequestAction)
        if missing != "status":
            topics["status"].publish()
        self.assertFalse(client.wait_for_server(rospy.Duration(0.7)))
        topics[missing] = TOPICS[missing](action + "/" + missing)
        topics["status"].publish()
        self.assertTrue(client.wait_for_server(rospy.Duration(30)))

    def test_wait_for_result_follows_a_goal_that_is_sent_meanwhile(self):
        self.send("0.2 ACTIVE go result:PREEMPTED")
        self.wait_state(ACTIVE)
        ended = []
        thread = threading.Thread(target=lambda: ended.append(
            (self.client.wait_for_result(rospy.Duration(30)), self.client.get_state())))
        thread.start()
        self.assertFalse(self.client.wait_for_result(rospy.Duration(0.25)))
        older = self.client.gh.comm_state_machine.action_goal.goal_id.id
        self.send("0.2 ACTIVE 0.5 result:ABORTED")
        self.go_pub.publish(older)  # which is over soon, as on a server with one goal at a time
        thread.join(30)
        self.assertEqual([(True, ABORTED)], ended)

    def test_done_cb_is_called_when_active_cb_has_returned(self):
        self.send("0.2 ACTIVE 0.1 result:SUCCEEDED", active_cb=lambda: time.sleep(0.5) or self.active.append(True),
                  done_cb=lambda *_: self.done.append(list(self.active)))
        self.expect(SUCCEEDED)
        self.assertEqual([[True]], self.done)

    def test_done_condition_is_notified_when_the_goal_is_over(self):
        woken = []

        def wait():
            with self.client.done_condition:
                waiting.set()
                self.client.done_condition.wait(30)
                woken.append(self.client.simple_state)

        waiting, thread = threading.Event(), threading.Thread(target=wait)
        thread.start()
        waiting.wait()
        with self.client.done_condition:  # the thread waits
            pass
        self.send("0.2 ACTIVE go result:SUCCEEDED")
        self.wait_state(ACTIVE)
        self.go()
        thread.join(30)
        self.assertEqual([SimpleGoalState.DONE], woken)

    def test_done_condition_may_be_held_during_all_calls(self):
        def work():
            with self.client.done_condition:
                for number in range(20):
                    self.client.send_goal(script("0.05 ACTIVE 0.01 result:SUCCEEDED", number))
                    self.client.get_state()
                    if self.client.wait_for_result(rospy.Duration(10)):
                        results.append(self.client.get_result().the_result)

        results, thread = [], threading.Thread(target=work, daemon=True)
        thread.start()
        thread.join(30)
        self.assertEqual(list(range(20)), results)


class TestServer(ServerCase):

    library = LIBRARY

    # Subclasses

    def test_constructor_does_not_call_start_of_a_subclass(self):
        calls = []

        class Subclass(LIBRARY.SimpleActionServer):
            def start(self):
                calls.append("start")

        self.serve(self.work_until_free, kind=Subclass, auto_start=True)
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([], calls)

    def test_accept_new_goal_calls_no_set_preempted_of_a_subclass(self):
        calls = []

        class Subclass(LIBRARY.SimpleActionServer):
            def set_preempted(self, *_):
                calls.append("set_preempted")

        self.serve(goal_cb=self.accept, kind=Subclass)
        older = self.send_active(1)
        self.client.send(2)
        self.expect(older, PREEMPTED)
        self.assertEqual([], calls)

    def test_set_aborted_of_a_subclass_is_called_with_no_lock_held(self):
        acquired = []

        class Subclass(LIBRARY.SimpleActionServer):
            def set_aborted(self, *args):
                thread = threading.Thread(target=another)
                thread.start()
                thread.join(5)
                super().set_aborted(*args)

        def another():
            with self.server.action_server.lock:
                acquired.append(self.server.current_goal.get_goal_status().status)

        def execute_cb(_):
            raise ValueError("out of soap")

        self.serve(execute_cb, kind=Subclass)
        self.expect(self.client.send(0), ABORTED)
        self.assertEqual([ACTIVE], acquired, "before the goal was over")

    def test_server_with_an_action_server_of_its_own_serves_goals(self):
        class Subclass(LIBRARY.SimpleActionServer):

            def __init__(self, name, *args):
                super().__init__(name, *args)
                self.action_server = actionlib.ActionServer(
                    name, WashTheDishesAction, self.internal_goal_callback, self.internal_preempt_callback, False)

        self.serve(self.work_until_free, kind=Subclass)
        older = self.send_active(1)
        newer = self.client.send(0)
        self.client.wait(lambda: self.server.is_preempt_requested(), "a newer goal")
        self.free.set()
        self.expect(older, PREEMPTED)
        self.expect(newer, SUCCEEDED)

    # A lock that the program puts in the place of actionlib's

    def test_execute_cb_with_a_lock_of_its_own(self):
        self.serve(self.work_until_free)
        self.server.lock = threading.Lock()
        goal = self.send_active(1)
        self.client.cancel(goal)
        self.client.wait(lambda: self.server.is_preempt_requested(), "a cancel")
        self.free.set()
        self.expect(goal, PREEMPTED)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.set_preempted()  # no goal runs: an error in the log, and no deadlock

    def test_goal_callbacks_with_a_lock_of_its_own(self):
        self.serve(goal_cb=self.accept)
        self.server.lock = threading.Lock()
        older, newer = self.send_active(1), self.send_active(2)
        self.expect(older, PREEMPTED)
        self.server.set_preempted()
        self.expect(newer, PREEMPTED)

    # The end of a server, and its attributes

    def test_del_waits_for_the_goal_that_runs_and_no_other_starts(self):
        self.serve(self.work_until_free)
        goal = self.send_active(1)
        thread = threading.Thread(target=self.server.__del__, daemon=True)
        thread.start()
        thread.join(0.5)
        self.assertTrue(thread.is_alive())
        self.free.set()
        thread.join(30)
        self.assertFalse(thread.is_alive() or self.server.execute_thread.is_alive())
        self.expect(goal, PREEMPTED)
        self.send_waiting(2)
        self.assertEqual([1], self.started)

    def test_preempt_request_of_the_program_is_read(self):
        self.serve(self.work_until_free)
        self.send_active(1)
        self.assertIs(False, self.server.is_preempt_requested())
        self.server.preempt_request = True
        self.assertIs(True, self.server.is_preempt_requested())

    def test_execute_condition_may_be_waited_on_by_the_program(self):
        waits = threading.Event()

        def wait():
            with self.server.execute_condition:
                waits.set()
                self.server.execute_condition.wait(30)

        self.serve(self.work_until_free)
        threading.Thread(target=wait, daemon=True).start()
        self.assertTrue(waits.wait(30))
        for _ in range(2):  # a notification for one thread would miss that of execute_cb once
            self.expect(self.client.send(0), SUCCEEDED)

    def test_next_goal_starts_though_the_master_hangs(self):
        with Master() as master:
            program = master.start(sys.executable, PROGRAMS, "next_goal", stdin=subprocess.PIPE)
            program.expect("executes 1")
            master.processes[0].signal(signal.SIGSTOP)
            program.type("\n")
            program.expect("executes 2", timeout=10)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "drop_in", "drop_in_test")
