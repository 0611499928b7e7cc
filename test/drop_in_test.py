#!/usr/bin/env python3
"""What programs for actionlib, and subclasses of its classes, rely on. Each test passes on actionlib and on robust.

ACTIONLIB=plain in the environment tries actionlib instead of robust.
"""
import os
import threading
import unittest

import actionlib
import rospy
import rostest

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
from harness import ABORTED, ACTIVE, PREEMPTED, SUCCEEDED, RawClient, eventually

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


class TestServer(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("drop_in_test")

    def setUp(self):
        self.namespace, self.started, self.free = "/" + self.id().split(".")[-1], [], threading.Event()
        self.addCleanup(lambda: self.server.__del__())  # or the thread of actionlib's server goes on
        self.addCleanup(self.free.set)

    def make(self, kind=None, execute_cb=None, auto_start=False):
        """Make self.server: of this class instead of the library's, without a callback if execute_cb is False."""
        callback = None if execute_cb is False else execute_cb or self.work
        self.server = (kind or library.SimpleActionServer)(
            self.namespace + "/wash_dishes_as", WashTheDishesAction, callback, auto_start)

    def connect(self):
        self.server.action_server.started or self.server.start()
        self.client = RawClient(self.namespace)
        self.addCleanup(self.client.close)
        self.client.wait_connected()

    def work(self, goal):
        """An execute_cb: 0 minutes SUCCEED at once, others when self.free is set."""
        self.started.append(goal.number_of_minutes)
        if goal.number_of_minutes:
            self.free.wait(30)
        self.server.set_succeeded()

    def send_started(self, minutes):
        goal = self.client.send(minutes)
        eventually(lambda: minutes in self.started, "the goal started", self.client)
        return goal

    def expect(self, goal, state):
        self.assertEqual(state, self.client.wait_result(goal).status.status, self.client)

    # Subclasses

    def test_constructor_does_not_call_start_of_a_subclass(self):
        calls = []

        class Subclass(library.SimpleActionServer):
            def start(self):
                calls.append("start")

        self.make(Subclass, auto_start=True)
        self.connect()
        self.expect(self.client.send(0), SUCCEEDED)
        self.assertEqual([], calls)

    def test_accept_new_goal_calls_no_set_preempted_of_a_subclass(self):
        calls = []

        class Subclass(library.SimpleActionServer):
            def set_preempted(self, *_):
                calls.append("set_preempted")

        self.make(Subclass, execute_cb=False)
        self.server.register_goal_callback(self.server.accept_new_goal)
        self.connect()
        older = self.client.send(1)
        self.client.wait(lambda: ACTIVE in self.client.states.get(older, []), "an active goal")
        self.client.send(2)
        self.expect(older, PREEMPTED)
        self.assertEqual([], calls)

    def test_set_aborted_of_a_subclass_is_called_with_no_lock_held(self):
        acquired = []

        class Subclass(library.SimpleActionServer):
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

        self.make(Subclass, execute_cb)
        self.connect()
        goal = self.client.send(0)
        self.expect(goal, ABORTED)
        self.assertEqual([ACTIVE], acquired, "before the goal was over")

    def test_server_with_a_lock_of_its_own_serves_goals(self):
        self.check_lock(threading.Lock())

    def test_server_with_an_rlock_of_its_own_serves_goals(self):
        self.check_lock(threading.RLock())

    def check_lock(self, lock):
        self.make()
        self.server.lock = lock
        self.connect()
        goal = self.send_started(1)
        self.client.cancel(goal)
        self.client.wait(lambda: self.server.is_preempt_requested(), "a cancel")
        self.free.set()
        self.expect(goal, SUCCEEDED)
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.set_preempted()  # no goal runs: an error in the log, and no deadlock

    def test_goal_callbacks_with_a_lock_of_its_own(self):
        self.make(execute_cb=False)
        self.server.lock = threading.Lock()
        self.server.register_goal_callback(lambda: self.started.append(self.server.accept_new_goal().number_of_minutes))
        self.connect()
        older = self.send_started(1)
        newer = self.send_started(2)
        self.expect(older, PREEMPTED)
        self.server.set_preempted()
        self.expect(newer, PREEMPTED)

    # The end of a server

    def test_del_ends_the_execution_of_goals(self):
        self.make()
        self.connect()
        self.expect(self.client.send(0), SUCCEEDED)
        self.server.__del__()
        self.assertFalse(self.server.execute_thread.is_alive())
        goal = self.client.send(1)
        self.client.wait(lambda: goal in self.client.states, "the goal in the status")
        self.assertEqual([0], self.started)

    def test_del_returns_when_the_goal_that_runs_is_over(self):
        self.make()
        self.connect()
        goal = self.send_started(1)
        thread = threading.Thread(target=self.server.__del__, daemon=True)
        thread.start()
        thread.join(0.5)
        self.assertTrue(thread.is_alive())
        self.free.set()
        thread.join(30)
        self.assertFalse(thread.is_alive())
        self.expect(goal, SUCCEEDED)

    def test_del_without_execute_cb_returns_at_once(self):
        self.make(execute_cb=False)
        self.server.__del__()

    # Attributes

    def test_preempt_request_of_the_program_is_read(self):
        self.make()
        self.connect()
        self.send_started(1)
        self.assertIs(False, self.server.is_preempt_requested())
        self.server.preempt_request = True
        self.assertIs(True, self.server.is_preempt_requested())
        self.free.set()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "drop_in", "drop_in_test")
