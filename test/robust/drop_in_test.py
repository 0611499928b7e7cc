#!/usr/bin/env python3
"""What programs rely on in actionlib, such as attributes and subclasses: each test passes on both libraries.

ACTIONLIB=plain in the environment tries actionlib. drop_in.test runs both.
"""
import os
import threading
import time

import actionlib
from actionlib import CommState, SimpleGoalState
from actionlib.msg import (
    TestRequestAction, TestRequestActionFeedback, TestRequestActionGoal, TestRequestActionResult, TestRequestGoal)
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from actions_tutorial import robust
from parameterized import parameterized
import rospy
import rostest

from support.scripted import ScriptedCase, script
from support.server_case import ServerCase
from support.states import ABORTED, ACTIVE, PREEMPTED, PREEMPTING, SUCCEEDED

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

    @parameterized.expand(list(TOPICS))
    def test_server_is_not_connected_without_its_topic(self, missing):
        action = f"without_{missing}"
        topics = {topic: make(f"{action}/{topic}") for topic, make in TOPICS.items() if topic != missing}
        client = self.library.SimpleActionClient(action, TestRequestAction)
        if missing != "status":
            topics["status"].publish()
        self.assertFalse(client.wait_for_server(rospy.Duration(0.7)))
        topics[missing] = TOPICS[missing](f"{action}/{missing}")
        topics["status"].publish()
        self.assertTrue(client.wait_for_server(rospy.Duration(30)))

    def test_none_is_an_empty_goal(self):
        self.client.send_goal(None)
        self.eventually(lambda: self.goals, "a goal")
        self.assertEqual(TestRequestGoal(), self.goals[0].goal)

    def test_gh_shows_the_goal_and_cancels_it(self):
        self.send("0.2 ACTIVE cancel PREEMPTING go result:PREEMPTED", 4)
        self.wait_state(ACTIVE)
        handle = self.client.gh
        self.assertEqual((CommState.ACTIVE, None), (handle.get_comm_state(), handle.get_result()))
        handle.cancel()
        self.eventually(lambda: handle.get_comm_state() == CommState.PREEMPTING, "PREEMPTING")
        self.assertEqual((ACTIVE, PREEMPTING), (self.client.get_state(), handle.get_goal_status()))
        self.go()
        self.expect(PREEMPTED, 4)
        self.assertEqual((CommState.DONE, PREEMPTED, "cancelled", 4), (
            handle.get_comm_state(), handle.get_terminal_state(), handle.get_goal_status_text(),
            handle.get_result().the_result))

    @parameterized.expand([("another_is_sent", lambda client: client.send_goal(script("0.2 ACTIVE"))),
                           ("stop_tracking_goal", lambda client: client.stop_tracking_goal()),
                           ("gh_is_none", lambda client: setattr(client, "gh", None))])
    def test_goal_goes_on_and_may_be_tracked_again_when(self, _, leave):
        self.send("0.2 ACTIVE go feedback result:ABORTED", 1)
        self.wait_state(ACTIVE)
        older = self.client.gh
        leave(self.client)
        self.go()
        self.eventually(older.get_result, "a result, in the handle that was kept")
        self.assertEqual((ABORTED, CommState.DONE), (older.get_terminal_state(), older.get_comm_state()))
        self.assertEqual(([], [], []), (self.done, self.feedback, self.cancels))
        self.send("0.2 ACTIVE go result:PREEMPTED", 2)
        self.wait_state(ACTIVE)
        kept = self.client.gh
        leave(self.client)
        self.client.gh, self.client.done_cb = kept, lambda *_: self.done.append("kept")
        self.go()
        self.expect(PREEMPTED, 2)
        self.assertEqual(["kept"], self.done)

    def test_callbacks_set_after_send_goal_see_simple_state(self):
        calls = []
        self.client.send_goal(script("go ACTIVE 0.2 feedback 0.2 result:SUCCEEDED"))
        self.assertEqual((None, SimpleGoalState.PENDING), (self.client.done_cb, self.client.simple_state))
        self.client.active_cb = lambda: calls.append(("active", self.client.simple_state))
        self.client.feedback_cb = lambda _: calls.append(("feedback", self.client.simple_state))
        self.client.done_cb = lambda *_: calls.append(("done", self.client.simple_state))
        self.go()
        self.expect(SUCCEEDED)
        self.assertEqual([("active", SimpleGoalState.ACTIVE), ("feedback", SimpleGoalState.ACTIVE),
                          ("done", SimpleGoalState.ACTIVE)], calls)
        self.assertEqual(SimpleGoalState.DONE, self.client.simple_state)

    def test_subclass_that_overrides_methods(self):
        calls = []

        class Subclass(LIBRARY.SimpleActionClient):

            def send_goal(self, goal, *args, **kwargs):
                calls.append("send_goal")
                super().send_goal(goal, self.done_cb, self.active_cb, self.feedback_cb)

            def _handle_transition(self, gh):
                calls.append(gh.get_comm_state())
                super()._handle_transition(gh)

            def active_cb(self):
                time.sleep(0.5)
                calls.append("active_cb")

            def feedback_cb(self, feedback):
                calls.append("feedback_cb")

            def done_cb(self, state, result):
                calls.append("done_cb")

        client = Subclass("scripted", TestRequestAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(30)))
        goal = script("0.2 ACTIVE 0.7 feedback 0.2 result:SUCCEEDED")
        self.assertEqual(SUCCEEDED, client.send_goal_and_wait(goal, rospy.Duration(30)))
        self.assertEqual(["send_goal", CommState.ACTIVE, "active_cb", "feedback_cb", CommState.WAITING_FOR_RESULT,
                          CommState.DONE, "done_cb"], calls)

    def test_cancel_of_a_lost_goal_is_sent(self):
        self.send("0.2 ACTIVE 0.2 unlisted cancel feedback")
        self.expect(GoalStatus.LOST)
        self.client.cancel_goal()
        self.eventually(lambda: self.cancels, "a cancel")

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

    def test_subclass_that_overrides_methods(self):
        calls = []

        class Subclass(LIBRARY.SimpleActionServer):

            def __init__(self, name, action, execute_cb, auto_start):
                super().__init__(name, action, self.execute_cb, auto_start)
                self.lock = threading.Lock()  # of the program, in the place of actionlib's

            def start(self):
                calls.append("start")

            def execute_cb(self, goal):
                calls.append("execute_cb")
                if goal.number_of_minutes:
                    raise ValueError("out of soap")
                self.set_succeeded()

            def set_succeeded(self, *args):
                calls.append("set_succeeded")
                super().set_succeeded(*args)

            def set_aborted(self, *args):
                calls.append("set_aborted")
                thread = threading.Thread(target=acquire)
                thread.start()
                thread.join(5)
                super().set_aborted(*args)

        def acquire():
            with self.server.action_server.lock:
                calls.append("no lock is held")

        self.serve(kind=Subclass, auto_start=True)
        self.expect(self.client.send(0), SUCCEEDED)
        self.expect(self.client.send(1), ABORTED)
        self.assertEqual(["execute_cb", "set_succeeded", "execute_cb", "set_aborted", "no lock is held"], calls)

    def test_subclass_with_goal_callbacks(self):
        calls = []

        class Subclass(LIBRARY.SimpleActionServer):

            def set_preempted(self, *_):
                calls.append("set_preempted")

        self.serve(goal_cb=self.accept, preempt_cb=lambda: calls.append("preempt_cb"), kind=Subclass)
        self.server.lock = threading.Lock()
        older, newer = self.send_active(1), self.send_active(2)
        self.expect(older, PREEMPTED)
        self.client.cancel(newer)
        self.client.wait(lambda: calls == ["preempt_cb", "preempt_cb"], "the preempt callback, not set_preempted")
        self.server.set_succeeded()
        self.expect(newer, SUCCEEDED)

    def test_attributes_that_programs_read_and_set(self):
        def work():
            while True:
                with self.server.execute_condition:
                    while not self.server.new_goal:
                        self.server.execute_condition.wait()
                    self.started.append(self.server.next_goal.get_goal().number_of_minutes)
                    self.server.accept_new_goal()

        self.serve()
        threading.Thread(target=work, daemon=True).start()
        goal = self.send_active(1)
        self.assertEqual((False, goal), (self.server.new_goal, self.server.current_goal.get_goal_id().id))
        self.assertIs(False, self.server.is_preempt_requested())
        self.server.preempt_request = True
        self.assertIs(True, self.server.is_preempt_requested())
        self.server.current_goal.set_succeeded()
        self.expect(goal, SUCCEEDED)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "drop_in", "drop_in_test")
