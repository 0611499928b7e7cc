# SPDX-License-Identifier: BSD-3-Clause
# Copyright (c) 2026, the actions_tutorial maintainers
# All rights reserved.
#
# Redistribution and use in source and binary forms, with or without
# modification, are permitted provided that the following conditions are met:
#
# 1. Redistributions of source code must retain the above copyright notice, this
#    list of conditions and the following disclaimer.
#
# 2. Redistributions in binary form must reproduce the above copyright notice,
#    this list of conditions and the following disclaimer in the documentation
#    and/or other materials provided with the distribution.
#
# 3. Neither the name of the copyright holder nor the names of its
#    contributors may be used to endorse or promote products derived from
#    this software without specific prior written permission.
#
# THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS"
# AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
# IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE
# DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE
# FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
# DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR
# SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION) HOWEVER
# CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY,
# OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE
# OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
"""More reliable action servers and clients: actionlib's classes, with small overrides.

    from actions_tutorial import robust

The docstring of each override says what actionlib does, and what this class does instead. Everything else is inherited
or re-exported unchanged. Importing this module registers one function with rospy.on_shutdown and changes nothing else.
Import it before your program registers its own functions, so that goals are told to stop first.

Internals of actionlib that are used here (actionlib is archived, so they will not change):
* SimpleActionServer: action_server, current_goal, next_goal, new_goal, execute_callback, execute_thread,
  execute_condition, need_to_terminate, preempt_callback, preempt_request. They make it possible to start a goal without
  polling, and to end a waiting goal.
* ActionServer: ns, lock, started, last_cancel, status_timer, status_frequency and the message types; status_tracker of
  a ServerGoalHandle, which can be read without the lock.
* SimpleActionClient: action_client, gh, simple_state, _set_simple_state, done_condition, done_cb.
* ActionClient: ns, manager, ActionGoal; pub_goal, pub_cancel, result_sub, feedback_sub and last_status_msg show whether
  the server is connected.
* GoalManager, which creates the goals of a client: ActionGoal, list_mutex, statuses, send_goal_fn, cancel_fn.
* CommStateMachine, one for each goal of a client, held by a ClientGoalHandle: its constructor, mutex, state,
  transition_to, action_goal, latest_goal_status, latest_result, feedback_cb, send_cancel_fn.
From rospy: rostime.get_rostime_cond(), the condition that every /clock message notifies; last_time and sleep_dur of a
Rate; the connections of a topic. rospy also calls functions that are registered during the shutdown, after all others.

A goal in the server:
    PENDING                 it waits. A newer goal, a cancel or a shutdown makes it RECALLED
    ACTIVE                  it is being executed
    PREEMPTING              it is being executed, and was cancelled
    SUCCEEDED, ABORTED, PREEMPTED, RECALLED, REJECTED       outcomes
A goal in the client (CommState):
    WAITING_FOR_GOAL_ACK    no status has listed it yet
    PENDING, ACTIVE, RECALLING, PREEMPTING                  as the last status shows it
    WAITING_FOR_CANCEL_ACK  a cancel was sent, and no status shows it yet
    WAITING_FOR_RESULT      a status shows its outcome, but the result has not come yet
    DONE                    it has its result, or it is LOST. This state is final

Locks, in the order in which they are taken:
* server: action_server.lock, which guards the goals; then that of execute_condition, which guards new_goal; then the
  condition of the ROS clock, on which rates wait
* client: the mutex of a goal, which guards its state; then manager.list_mutex: answers wait for it while a goal is
  being sent. done_condition and _robust_sent are never held together with another lock
Goal and preempt callbacks run with the server's locks held, and active_cb with its goal's mutex, as in actionlib. No
lock is held during execute_cb, done_cb, feedback_cb, and the preempt callback that a shutdown calls.
"""
from __future__ import annotations

import contextlib
import io
import random
import threading
import time
import traceback
import weakref
from typing import Any, Callable, Optional, Union

import actionlib
import genpy
import rospy
from actionlib import *  # noqa: F401, F403  # what is not replaced below
from actionlib import ActionServer, CommState, SimpleGoalState
from actionlib.action_client import ClientGoalHandle, CommStateMachine, GoalManager
from actionlib_msgs.msg import GoalID, GoalStatus

__all__ = [name for name in vars(actionlib) if not name.startswith("_")]
__version__ = "3.0.0"
Seconds = Union[genpy.Duration, float]

SHUTTING_DOWN = "the server is shutting down"
WARN_EVERY = 5.0  # s between two warnings of wait_for_server
UNLISTED_FOR = 1.0  # s. A goal that has been missing from the server's status for this long is LOST
RESULT_WITHIN = 30.0  # s. As above, if only the result is missing, or if the goal was cancelled and never listed
_TEXTS = {GoalStatus.SUCCEEDED: "all done", GoalStatus.ABORTED: "the server gave up",
          GoalStatus.PREEMPTED: "preempted by the server", GoalStatus.REJECTED: "the server refused the goal",
          GoalStatus.RECALLED: "cancelled before it was started"}
_WAITING = GoalStatus.PENDING, GoalStatus.RECALLING
_RUNNING = GoalStatus.ACTIVE, GoalStatus.PREEMPTING

_stopping = threading.Event()  # set when the node begins to shut down
_alive: weakref.WeakSet = weakref.WeakSet()  # the servers and clients of this process
_settled: weakref.WeakSet = weakref.WeakSet()  # the connections for which wait_for_server has waited 0.2 s


class SimpleActionServer(actionlib.SimpleActionServer):
    """An actionlib.SimpleActionServer that starts and stops goals without delay. Each outcome has a status text.

    name, ActionSpec: the name of the action, and its type, such as WashTheDishesAction.
    execute_cb: called with each goal, one at a time, in a daemon thread. None for servers with goal callbacks.
    auto_start: whether to start at once. False is better: otherwise execute_cb may run before the constructor returns.
    shutdown_timeout: how many seconds a goal is given to stop when the node is shut down. After that it is ABORTED.
    """

    next_goal: actionlib.ServerGoalHandle  # for mypy, like the annotations in the classes below
    execute_callback: Any

    def __init__(self, name: str, ActionSpec: type, execute_cb: Optional[Callable[[Any], Any]] = None,
                 auto_start: bool = True, *, shutdown_timeout: Seconds = 1.0) -> None:
        """actionlib's thread for execute_cb keeps the program alive after its main thread has raised (ros/actionlib
        #146). Here the thread is a daemon, so actionlib's constructor must not start it."""
        self._robust_patience = _seconds(shutdown_timeout)
        super().__init__(name, ActionSpec, execute_cb=None, auto_start=False)
        self._robust_overtaken = None  # the last goal that was told to make way for a newer one
        self._robust_in_thread = threading.local()  # .accepted: its last goal; .told: the last goal told to stop
        self.action_server = _ActionServer(
            name, ActionSpec, self.internal_goal_callback, self.internal_preempt_callback, auto_start=False)
        if execute_cb:
            self.execute_callback = execute_cb
            self.execute_thread = threading.Thread(target=self.executeLoop, daemon=True)
            self.execute_thread.start()
        _alive.add(self)
        if auto_start:
            self.action_server.start()

    def rate(self, hz: float) -> rospy.Rate:
        """Returns a rospy.Rate for the loop that works on a goal. Its sleep() returns True at the end of the period,
        and False at once when the goal should stop, because of a cancel, a newer goal or a shutdown.

        hz: 1/s, on the ROS clock. A loop that goes on after False keeps its pace: sleep() then returns False at the end
        of each period. In the thread that accepts the goals, such as that of execute_cb, a rate serves one goal after
        another. In another thread it belongs to the goal that was active when the rate was created, and sleep() also
        returns False once that goal is over. In that case, return without set_preempted: it would end the newer goal.
        """
        return _Rate(hz, self)

    @property
    def preempt_request(self) -> bool:
        """As in actionlib, but setting it wakes the rates. A shutdown also sets it if a goal is running."""
        return self._robust_preempt_request

    @preempt_request.setter
    def preempt_request(self, value: bool) -> None:
        self._robust_preempt_request = value
        _wake_rates()

    def _robust_running_goal(self):
        """Returns the goal that is ACTIVE or PREEMPTING, or None. Unlike is_active(), it takes no lock."""
        goal = self.current_goal  # it has no status_tracker before the first goal
        return goal if goal.status_tracker and goal.status_tracker.status.status in _RUNNING else None

    def executeLoop(self) -> None:
        """actionlib's loop polls (ros/actionlib #164), notices a new goal up to 0.1 s late (#212), and ends for good
        after SystemExit, or when action_server.stop() is called while a goal runs and another waits. This loop waits
        on the condition, and carries on."""
        while True:
            with self.execute_condition:  # 2 s, since some programs set need_to_terminate without notifying
                self.execute_condition.wait_for(lambda: self.new_goal or _stopping.is_set(), timeout=2)
            if self.need_to_terminate or _stopping.is_set():
                return
            with self.action_server.lock:
                goal = self.accept_new_goal() if self.action_server.started else None
            if goal is None:  # the goal was cancelled meanwhile, or the server was stopped
                time.sleep(0.01)
            else:
                self._robust_execute(goal)

    def _robust_execute(self, goal):
        name, text, has_raised = self._robust_name(), "execute_cb returned without a terminal state", False
        try:
            self.execute_callback(goal)
        except BaseException as error:
            text, has_raised = _failure("execute_cb", error), True
            rospy.logerr("%s: execute_cb failed\n%s", name, traceback.format_exc())
        with contextlib.suppress(rospy.ROSException):  # the program may have called action_server.stop()
            if self.is_active():
                self.set_aborted(None, SHUTTING_DOWN if _stopping.is_set() else text)
                if not has_raised and not _stopping.is_set():
                    rospy.logwarn("%s: %s", name, text)

    def _robust_name(self):
        return rospy.resolve_name(self.action_server.ns)

    def accept_new_goal(self) -> Any:
        """Accept the waiting goal. Returns it, or None if there is none: it may have been cancelled meanwhile. In that
        case actionlib logs an error. actionlib also gives all older goals the same text; here it gives the reason."""
        with self.action_server.lock:
            if not self.new_goal:
                return None
            if self.is_active():
                SimpleActionServer.set_preempted(self)  # like actionlib, this calls no override of a subclass
            goal = super().accept_new_goal()
            self._robust_in_thread.accepted = self.current_goal
            return goal

    def register_goal_callback(self, cb: Optional[Callable[[], Any]]) -> None:
        """In actionlib, a goal whose cb raises gets no outcome, and after SystemExit the server stays locked. Here the
        goal is ABORTED if it was accepted, otherwise RECALLED."""
        super().register_goal_callback(cb and (lambda: self._robust_call_goal_callback(cb)))

    def _robust_call_goal_callback(self, cb):
        goal = self.next_goal
        try:
            cb()
        except BaseException as error:
            # In a thread, because logging may block while the server is locked.
            _start(rospy.logerr, "%s: the goal callback failed\n%s", self._robust_name(), traceback.format_exc())
            text = _failure("the goal callback", error)
            if self.new_goal:
                self._robust_recall(text)
            elif goal is self._robust_running_goal():
                super().set_aborted(None, text)

    def internal_goal_callback(self, goal: actionlib.ServerGoalHandle) -> None:
        """actionlib refuses a goal whose stamp is earlier than the current goal's (ros/actionlib #203). It notifies one
        waiting thread, perhaps the wrong one. Here the goal that arrives last wins, and all threads are notified."""
        if _stopping.is_set():
            goal.set_canceled(None, SHUTTING_DOWN)
            return
        if self.new_goal:
            self._robust_recall("a newer goal came")
        if self.current_goal.get_goal():
            self._robust_overtaken = self.current_goal
            older = self.current_goal.get_goal_id()
            older.stamp = min(older.stamp, goal.get_goal_id().stamp)  # so that actionlib does not refuse the new one
        super().internal_goal_callback(goal)
        with self.execute_condition:
            self.execute_condition.notify_all()

    def internal_preempt_callback(self, preempt: actionlib.ServerGoalHandle) -> None:
        """actionlib starts a goal that was cancelled while it waited (ros/actionlib #196). Here it is RECALLED."""
        if self.new_goal and preempt == self.next_goal:
            self._robust_recall("cancelled before it was started")
        else:
            super().internal_preempt_callback(preempt)

    def _robust_recall(self, text):
        """End the waiting goal. Called with the server's locks held."""
        self.new_goal = False
        if self.next_goal.status_tracker.status.status in _WAITING:  # the goal callback may have rejected it
            self.next_goal.set_canceled(None, text)
        self.next_goal = self.current_goal  # as after accept_new_goal

    def set_preempted(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal as PREEMPTED.

        result: None sends an empty result. text: by default, the reason why the goal should stop.
        actionlib gives no reason. When the node is shut down, it reports PREEMPTED to a client that has cancelled
        nothing. Here that goal is ABORTED with the text "the server is shutting down".
        """
        with self.action_server.lock:
            goal = self._robust_running_goal()  # if there is none, actionlib logs an error
            is_cancelled = goal and goal.status_tracker.status.status == GoalStatus.PREEMPTING
            if _stopping.is_set() and not is_cancelled:
                super().set_aborted(result, f"{SHUTTING_DOWN}: {text}" if text else SHUTTING_DOWN)
            else:
                is_overtaken = goal and goal is self._robust_overtaken
                why = "cancelled" if is_cancelled else "a newer goal came" if is_overtaken else ""
                super().set_preempted(result, text or why)

    def _robust_shut_down(self, deadline):
        """When the node is shut down, actionlib leaves its goals without an outcome. Here the goal is told to stop, and
        ABORTED if it has not stopped by deadline (time.monotonic())."""
        if not self.action_server.started:  # or action_server.stop() was called
            return
        with self.action_server.lock, self.execute_condition:
            if self.new_goal:
                self._robust_recall(SHUTTING_DOWN)
            self.execute_condition.notify_all()  # executeLoop returns
            if self.is_active():
                self.preempt_request = True
                if self.preempt_callback:
                    _start(self.preempt_callback)  # it may block
        while self._robust_running_goal() and time.monotonic() < deadline:
            time.sleep(0.01)
        with self.action_server.lock:
            if self.is_active():
                super().set_aborted(None, SHUTTING_DOWN)


class _ActionServer(ActionServer):
    """The part of a SimpleActionServer that handles the topics."""

    status_timer: rospy.Timer
    last_cancel: rospy.Time

    def publish_result(self, status, result):
        """Publishes every outcome. In actionlib, a client waits forever for a result that cannot be serialized. Here
        the goal is ABORTED instead. An outcome without a status text gets a default one."""
        status.text = status.text or _TEXTS.get(status.status, "")
        try:
            _check(self.ActionResult(status=status, result=result))
        except rospy.ROSSerializationException as error:
            status.status, status.text = GoalStatus.ABORTED, f"the result cannot be sent: {error}"
            result = self.ActionResultType()
        super().publish_result(status, result)
        _wake_rates()  # those of this goal in other threads

    def publish_feedback(self, status, feedback):
        """In actionlib, feedback that cannot be serialized corrupts the next message. Here it only raises
        rospy.ROSSerializationException."""
        message = self.ActionFeedback(status=status)
        message.feedback = feedback  # the constructor would replace None
        _check(message)
        super().publish_feedback(status, feedback)

    def initialize(self):
        """actionlib stops publishing its status when the clock is set back (ros/ros_comm #1083). Here it carries on."""
        super().initialize()
        if self.status_timer:
            self.status_timer.shutdown()
            self.status_timer = rospy.Timer(
                rospy.Duration(1 / self.status_frequency), self.publish_status_async, reset=True)

    def internal_cancel_callback(self, goal_id):
        """After a cancel stamped in the future, actionlib refuses all goals until that time (ros/actionlib #117). Here
        the cancel applies up to now."""
        with self.lock:
            super().internal_cancel_callback(goal_id)
            self.last_cancel = min(self.last_cancel, rospy.Time.now())

    def internal_goal_callback(self, goal):
        """After a cancel, actionlib also refuses all goals if the clock is then set back (ros/actionlib #203). Here
        it is forgotten."""
        with self.lock:
            if self.last_cancel > rospy.Time.now():
                self.last_cancel = rospy.Time()
            super().internal_goal_callback(goal)


class _Rate(rospy.Rate):
    """A rospy.Rate whose sleep() ends early when the goal should stop. See SimpleActionServer.rate."""

    last_time: rospy.Time

    def __init__(self, hz, server):
        super().__init__(hz)
        self._server = server
        self._goal = server._robust_running_goal()  # None: this rate serves all goals

    def sleep(self):
        """rospy.Rate.sleep() cannot be interrupted, and raises when the clock is set back. This one waits on the
        clock's condition, which _wake_rates() also notifies, and begins a new period when the clock is set back."""
        server, clock, called = self._server, rospy.rostime.get_rostime_cond(), rospy.get_rostime()
        thread = server._robust_in_thread
        self._goal = self._goal and getattr(thread, "accepted", self._goal)
        with clock:
            while True:
                is_over = self._goal and self._goal is not server._robust_running_goal()
                should_stop = bool(is_over or server.preempt_request or _stopping.is_set())
                goal = self._goal or server.current_goal
                if should_stop and getattr(thread, "told", None) is not goal:
                    thread.told = goal
                    return False
                called = min(called, rospy.get_rostime())  # the clock may have been set back
                left = self.remaining()
                if left <= rospy.Duration():
                    self.last_time += self.sleep_dur
                    if called - self.last_time > self.sleep_dur * 2:  # too late to catch up, as in rospy.Rate
                        self.last_time = called
                    return not should_stop
                clock.wait(left.to_sec() if rospy.rostime.is_wallclock() else 0.1)


def _wake_rates():
    with rospy.rostime.get_rostime_cond():
        rospy.rostime.get_rostime_cond().notify_all()


class SimpleActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient that keeps state, result and callbacks consistent, and says why a goal failed.

    ns, ActionSpec: the name of the action, and its type, such as WashTheDishesAction.
    heartbeat_timeout: in s. If neither a status that lists the goal nor feedback comes for this long, the goal is LOST,
        and a cancel is sent in case the server is still running. A server sends its status five times a second. Time
        during which the ROS clock or this process is stopped does not count. None: no limit.
    cancel_on_shutdown: whether to cancel the goal when this node is shut down, and wait up to 2 s for its outcome. From
        then on, send_goal raises rospy.ROSInterruptException.
    Timeouts are Durations or seconds. Raises ValueError if heartbeat_timeout is not above 0.
    """

    _robust_patience = 2.0  # s from the cancel on shutdown to the outcome
    _robust_no_server: Optional[str] = None  # why the last wait_for_server failed
    _robust_is_sending = False

    def __init__(self, ns: str, ActionSpec: type, *, heartbeat_timeout: Optional[Seconds] = None,
                 cancel_on_shutdown: bool = False) -> None:
        limit = float("inf") if heartbeat_timeout is None else _seconds(heartbeat_timeout)
        if not limit > 0:
            raise ValueError(f"heartbeat_timeout is {limit:g}, must be above 0, or None")
        super().__init__(ns, ActionSpec)
        self._robust_heartbeat_timeout = limit
        self._robust_cancel_on_shutdown = cancel_on_shutdown
        self._robust_sent = threading.Condition()  # notified when a goal is sent, to end the watch on an older one
        self.action_client.manager = _GoalManager(ActionSpec)  # replaces actionlib's, which has no goals yet
        self.action_client.manager.register_send_goal_fn(self.action_client.pub_goal.publish)
        self.action_client.manager.register_cancel_fn(self.action_client.pub_cancel.publish)
        _alive.add(self)

    def wait_for_server(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until the server is connected.

        timeout: in real time; 0: no limit. Returns False after the timeout, and on shutdown.
        actionlib counts ROS time, so its method never returns while simulated time stands still (ros/actionlib #19),
        and returns at once when simulated time begins (#137). It says nothing while it waits (#35). Early feedback may
        be lost, because rospy reports a connection before messages can pass. Here the limit is in real time, a warning
        is logged every 5 s, and a new connection is given another 0.2 s.
        """
        seconds, begun, warned = _duration(timeout).to_sec(), time.monotonic(), 0.0
        name, topic = rospy.resolve_name(self.action_client.ns), self.action_client.feedback_sub.impl
        rospy.get_rostime()  # raises before init_node
        while not rospy.is_shutdown() and not self._robust_is_connected():
            waited = time.monotonic() - begun
            if 0 < seconds <= waited:
                self._robust_no_server = f"no server of {name} within {seconds:g} s"
                return False
            if waited >= warned + WARN_EVERY:
                warned = waited
                _start(rospy.logwarn, "waiting for the server of %s for %d s", name, waited)  # the master may hang
            time.sleep(0.01)
        connections = list(topic.connections)
        if not _settled.issuperset(connections):
            time.sleep(0.2)
            _settled.update(connections)
        is_interrupted = rospy.is_shutdown()
        self._robust_no_server = f"interrupted while waiting for the server of {name}" if is_interrupted else None
        return not is_interrupted

    def _robust_is_connected(self):
        """Returns whether the node that sent the last status is connected on the other four topics."""
        client = self.action_client
        if not client.last_status_msg:
            return False
        server = client.last_status_msg._connection_header["callerid"]
        return all(end.impl.has_connection(server) for end in (client.pub_goal, client.pub_cancel)) and all(
            any(one.callerid_pub == server for one in end.impl.connections)
            for end in (client.result_sub, client.feedback_sub))

    def send_goal(self, goal: Optional[genpy.Message], done_cb: Optional[Callable[[int, Any], Any]] = None,
                  active_cb: Optional[Callable[[], Any]] = None,
                  feedback_cb: Optional[Callable[[Any], Any]] = None) -> None:
        """Send a goal. An older goal keeps running, but its callbacks are no longer called.

        goal: a message such as WashTheDishesGoal; None sends an empty goal. done_cb: called with the outcome (int, as
        in GoalStatus) and the result, in a thread of its own. active_cb: called when the goal has started.
        feedback_cb: called with each feedback message; the last one may come after done_cb.
        Raises TypeError for a goal of another type, and rospy.ROSSerializationException for one that cannot be sent.
        In actionlib, a goal that cannot be sent corrupts the next one, and an answer that comes before this method
        returns is dropped (ros/actionlib #206). Here the answer waits for list_mutex until gh is set.
        """
        if self._robust_cancel_on_shutdown and _stopping.is_set():  # rospy.is_shutdown() is still False
            raise rospy.ROSInterruptException("no goal is sent while the node is shut down")
        expected, given = self.action_client.ActionGoal().goal._type, getattr(goal, "_type", type(goal).__name__)
        if goal is not None and given != expected:
            raise TypeError(f"the goal must be of type {expected}, not {given}")
        _check(self.action_client.ActionGoal(goal=goal))
        with self.action_client.manager.list_mutex:
            self._robust_is_sending = True  # read if Ctrl-C comes before gh is set
            try:
                super().send_goal(goal, done_cb, active_cb, feedback_cb)
            finally:
                self._robust_is_sending = False
            self._robust_no_server, gh = None, self.gh
        with self._robust_sent:
            self._robust_sent.notify_all()
        if self._robust_heartbeat_timeout < float("inf") or self._robust_cancel_on_shutdown:
            threading.Thread(target=self._robust_watch, args=[gh], daemon=True).start()

    def send_goal_and_wait(self, goal: Optional[genpy.Message], execute_timeout: Seconds = rospy.Duration(),
                           preempt_timeout: Seconds = rospy.Duration()) -> int:
        """As in actionlib, but the timeouts may also be in seconds (ros/ros_comm #1658)."""
        return super().send_goal_and_wait(goal, _duration(execute_timeout), _duration(preempt_timeout))

    def wait_for_result(self, timeout: Seconds = rospy.Duration()) -> bool:
        """As in actionlib, on the ROS clock, but the timeout may be in seconds. With a negative timeout, actionlib
        waits forever, whereas this method returns at once."""
        return super().wait_for_result(_duration(timeout))

    def cancel_goal(self) -> None:
        """actionlib also cancels a goal that is over, and then says that it is LOST (ros/actionlib #126). Here nothing
        is sent or changed. But a LOST goal is cancelled, because the server may still be working on it."""
        gh = self.gh
        if gh and not gh.comm_state_machine.latest_result:
            gh.comm_state_machine.cancel()

    def get_state(self) -> int:
        """In actionlib, the state is terminal before the result arrives (ros/actionlib #116), and LOST while a goal is
        being sent. Here it is PENDING or ACTIVE until the result has arrived."""
        with self.action_client.manager.list_mutex:
            state = super().get_state()
            if self.gh and self.gh.get_comm_state() != CommState.DONE:
                is_waiting = state in (GoalStatus.PENDING, GoalStatus.RECALLED, GoalStatus.REJECTED)
                return GoalStatus.PENDING if is_waiting else GoalStatus.ACTIVE
            return state

    def get_failure(self) -> Optional[str]:
        """Returns None if the goal SUCCEEDED, else one line: its state and the server's text, or why there is no
        outcome."""
        state = self.get_state()
        if self._robust_no_server or not self.gh:
            return self._robust_no_server or "no goal was sent, or it is no longer tracked"
        if state in (GoalStatus.PENDING, GoalStatus.ACTIVE):  # to_string(0) is not "PENDING"
            return f"goal {'ACTIVE' if state == GoalStatus.ACTIVE else 'PENDING'}: no outcome so far"
        text = " ".join(self.get_goal_status_text().split()) or "the server gave no reason"
        return None if state == GoalStatus.SUCCEEDED else f"goal {GoalStatus.to_string(state)}: {text}"

    def _handle_transition(self, gh):
        """actionlib logs an error for a goal that was replaced (ros/actionlib #177), and waits forever after an
        active_cb or done_cb that raises. It calls done_cb in the thread that receives results, so a goal that is sent
        there gets no outcome (#193). Here done_cb runs in its own thread, and what a callback raises is logged."""
        if gh == self.gh and gh.get_comm_state() == CommState.DONE:
            _start(self._robust_done, gh)
        elif gh == self.gh:
            _call(super()._handle_transition, gh)

    def _robust_done(self, gh):
        with self.action_client.manager.list_mutex:
            if gh != self.gh:  # replaced since this thread was started
                return
            done_cb = self.done_cb
        if done_cb:
            _call(done_cb, gh.get_goal_status(), gh.get_result())
        with self.action_client.manager.list_mutex:
            if self.gh and self.gh != gh:  # done_cb has sent another goal
                return
            self._robust_no_server = None  # from now on, get_failure() is about the outcome
            self._set_simple_state(SimpleGoalState.DONE)
        with self.done_condition:
            self.done_condition.notify_all()

    def _handle_feedback(self, gh, feedback):
        """actionlib logs an error for a goal that was replaced. Here only what feedback_cb raises is logged."""
        if gh == self.gh:
            _call(super()._handle_feedback, gh, feedback)

    def _robust_watch(self, gh):
        """actionlib's client waits forever for a server that was killed or that hangs. This thread makes the goal LOST.
        It also keeps the client in memory until the goal is over, so that cancel_on_shutdown works even if the program
        no longer refers to the client."""
        limit, goal, silence = self._robust_heartbeat_timeout, gh.comm_state_machine, 0.0
        tick, now, ros = min(0.5, limit / 4), time.monotonic(), rospy.get_time()
        while True:
            with self._robust_sent:
                if goal.state == CommState.DONE or self.gh is not gh or _stopping.is_set():
                    return
                self._robust_sent.wait(tick)
            before, ros_before, now, ros = now, ros, time.monotonic(), rospy.get_time()
            if goal.is_heard:
                goal.is_heard, silence = False, 0.0
            elif ros != ros_before and now - before < 2 * tick:  # neither the clock nor this process was stopped
                silence += now - before
            if silence >= limit:
                with goal.mutex, self.action_client.manager.list_mutex:  # no other goal is sent meanwhile
                    if self.gh is gh and not goal.is_heard and not _stopping.is_set():
                        goal.cancel()
                        goal.lose(f"server lost: silent for {silence:.1f} s (heartbeat_timeout is {limit:g} s)")

    def _robust_shut_down(self, deadline):
        """When the node is shut down, actionlib leaves the goal running. Here, with cancel_on_shutdown, the goal is
        cancelled, and its outcome awaited until deadline (time.monotonic())."""
        if not self._robust_cancel_on_shutdown:
            return
        goals = [self.gh.comm_state_machine] if self.gh else []
        if self._robust_is_sending:  # Ctrl-C has interrupted send_goal: the older goal may still run
            goals = list(filter(None, (one() for one in self.action_client.manager.statuses)))
        goals = [goal for goal in goals if not goal.latest_result]
        is_awaited = any(goal.state != CommState.DONE for goal in goals)  # else they are LOST: no outcome will come
        for goal in goals:
            goal.cancel()
        while is_awaited and self.simple_state != SimpleGoalState.DONE and time.monotonic() < deadline:
            time.sleep(0.01)
        for goal in goals:
            goal.lose(f"a cancel was sent on shutdown, and no outcome came within {self._robust_patience:g} s")


class _GoalManager(GoalManager):
    """Creates the goals of a client."""

    def _generate_id(self):
        """In actionlib, two nodes with the same name create the same ids while simulated time stands still. Here random
        digits follow the time."""
        goal_id = super()._generate_id()
        goal_id.id += f"{random.SystemRandom().randrange(10**12):012d}"
        return goal_id

    def init_goal(self, goal, transition_cb=None, feedback_cb=None):
        """As in actionlib, but with _CommStateMachine."""
        action_goal = self.ActionGoal(rospy.Header(stamp=rospy.get_rostime()), self._generate_id(), goal)
        sent = _CommStateMachine(action_goal, transition_cb, feedback_cb, self.send_goal_fn, self.cancel_fn)
        with self.list_mutex:
            self.statuses.append(weakref.ref(sent))
        self.send_goal_fn(action_goal)
        return ClientGoalHandle(sent)


class _CommStateMachine(CommStateMachine):
    """What a client knows about a goal that it has sent."""

    is_heard = True  # whether there has been a sign of life since the watch last looked
    unlisted_since: Optional[float] = None  # time.monotonic()

    def update_status(self, status_array):
        """In actionlib, a goal is LOST if one status omits it, even if that status is older than the goal, and a
        lost result is awaited forever (ros/actionlib #181). Here both have time limits."""
        with self.mutex:
            if any(one.goal_id.id == self.action_goal.goal_id.id for one in status_array.status_list):
                self.is_heard, self.unlisted_since = True, None
                super().update_status(status_array)
            elif self.state not in (CommState.WAITING_FOR_GOAL_ACK, CommState.DONE):
                self._update_unlisted()

    def _update_unlisted(self):
        last = self.latest_goal_status
        if self.state == CommState.WAITING_FOR_RESULT:
            self.is_heard = True  # the server is alive
            limit, state = RESULT_WITHIN, GoalStatus.to_string(last.status)
            text = f"the server reported {state}, and no result came within {limit:g} s"
        elif last.goal_id.id:
            limit, text = UNLISTED_FOR, "the server no longer knows the goal"
        else:  # never listed: it may still be on its way
            limit, text = RESULT_WITHIN, "cancelled, and the server never listed the goal"
        self.unlisted_since = self.unlisted_since or time.monotonic()
        if time.monotonic() - self.unlisted_since >= limit:
            self.lose(text)

    def update_result(self, action_result):
        """In actionlib, a late result changes the state of a LOST goal (PR2/pr2_common #139). Here it stays LOST."""
        with self.mutex:
            if self.state != CommState.DONE:
                super().update_result(action_result)

    def update_feedback(self, action_feedback):
        """actionlib drops feedback that is handled after the result (ros/actionlib #213). Here it is delivered."""
        if action_feedback.status.goal_id.id == self.action_goal.goal_id.id:
            self.is_heard = True
            if self.feedback_cb:
                self.feedback_cb(ClientGoalHandle(self), action_feedback.feedback)

    def transition_to(self, state):
        """In actionlib, a cancel makes a goal leave DONE (ros/actionlib #126). Here it stays DONE."""
        with self.mutex:
            if self.state != CommState.DONE:
                super().transition_to(state)

    def cancel(self):
        """If Ctrl-C interrupts ClientGoalHandle.cancel(), rospy's lock stays locked until the shutdown is over, and no
        cancel can be sent. Here another thread sends it, which Ctrl-C does not interrupt."""
        sending = _start(self.send_cancel_fn, GoalID(id=self.action_goal.goal_id.id))
        if sending.is_alive():
            sending.join()
        self.transition_to(CommState.WAITING_FOR_CANCEL_ACK)

    def lose(self, text):
        """End the goal as LOST, unless it is already over."""
        with self.mutex:
            if self.state != CommState.DONE:
                self.latest_goal_status = GoalStatus(self.action_goal.goal_id, GoalStatus.LOST, text)
                self.transition_to(CommState.DONE)


def _seconds(timeout):
    """Returns a timeout (Duration or s) in s."""
    return timeout.to_sec() if isinstance(timeout, genpy.Duration) else timeout + 0.0


def _duration(timeout):
    """Returns a timeout (Duration or s) as a Duration. A negative one becomes 1 ms."""
    duration = timeout if isinstance(timeout, genpy.Duration) else rospy.Duration(timeout)
    return max(duration, rospy.Duration(0, 10**6)) if duration else duration


def _check(message):
    """Serialize a message as a test. If this failed in publish(), rospy would leave half of it in its buffer, and send
    that with the next message. Raises rospy.ROSSerializationException."""
    try:
        message.serialize(io.BytesIO())
    except Exception as error:
        raise rospy.ROSSerializationException(str(error)) from error


def _failure(what, error):
    """Returns the text for the client: what failed, and the error."""
    return f"{what} failed: {''.join(traceback.format_exception_only(type(error), error)).strip()}"


def _call(callback, *args):
    """Call a callback. What it raises, even SystemExit, is logged and does not end the thread."""
    try:
        callback(*args)
    except BaseException as error:
        if not (_stopping.is_set() and isinstance(error, rospy.ROSException)):  # rospy has closed the topics
            rospy.logerr("a callback failed\n%s", traceback.format_exc())


def _start(callback, *args):
    """Call a callback in a daemon thread, and return the thread."""
    thread = threading.Thread(target=_call, args=[callback, *args], daemon=True)
    try:
        thread.start()
    except RuntimeError:  # Python 3.12 cannot start a thread during interpreter shutdown
        thread.run()
    return thread


def _on_shutdown():
    """End the goals of all servers and clients, in parallel. Uses threads, because this function may run in a signal
    handler that has interrupted code which holds a lock. wait() is called after the program's own functions."""
    alive = list(_alive)  # before the watches, which keep clients in memory, end
    _stopping.set()
    _wake_rates()
    deadline, threads = time.monotonic(), []
    for one in alive:
        end = time.monotonic() + one._robust_patience
        deadline = max(deadline, end + 0.3)
        threads.append(_start(one._robust_shut_down, end))

    def wait():
        while any(one.is_alive() for one in threads) and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.1)  # rospy sends from threads of its own

    if threads:
        rospy.on_shutdown(wait)


rospy.on_shutdown(_on_shutdown)
