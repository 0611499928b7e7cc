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

Each override says what actionlib does and what it does instead. What is not overridden is actionlib's, and the rest of
actionlib is re-exported. The import registers one function with rospy.on_shutdown and changes nothing else. Import this
module before your program registers its own functions, so that goals are asked to stop first.

Members of actionlib that are used. It is archived, so they stay.
* SimpleActionServer: action_server, current_goal, next_goal, new_goal, execute_callback, execute_thread,
  execute_condition, need_to_terminate, preempt_callback, preempt_request. There is no other way to start a goal without
  polling, or to end one that waits.
* ActionServer: lock, started, last_cancel, status_timer, status_frequency and the message types. status_tracker of a
  ServerGoalHandle is read where a callback may hold the lock.
* SimpleActionClient: action_client, gh, simple_state, done_condition, done_cb. Of its ActionClient: manager, ActionGoal,
  and pub_goal, pub_cancel, result_sub, feedback_sub, last_status_msg, which show whether the server is connected.
* GoalManager: ActionGoal, list_mutex, statuses, send_goal_fn, cancel_fn. It makes the goals of a client.
* CommStateMachine, one for each goal of a client: its constructor, mutex, state, action_goal, latest_goal_status,
  latest_result, feedback_cb, send_cancel_fn, transition_to.
Of rospy: rostime.get_rostime_cond(), a condition that each message of /clock notifies; last_time and sleep_dur of a
Rate; the connections of a topic. A function that is given to rospy.on_shutdown during the shutdown is called last.

The states of a goal in the server, and in the client (CommState):

    PENDING -> ACTIVE -> PREEMPTING (a cancel)         WAITING_FOR_GOAL_ACK -> PENDING -> ACTIVE -> PREEMPTING
      |          '-------> '--> SUCCEEDED, ABORTED,      '-> each -> WAITING_FOR_RESULT -> DONE, with its result
      '-> RECALLED              PREEMPTED                '-> each -> DONE, with the status LOST

Locks, in the order in which they are taken:
* server: action_server.lock, then that of execute_condition, then the ROS clock's condition, on which rates wait
* client: the mutex of a goal, then manager.list_mutex, which guards gh; done_condition by itself
Callbacks for goals and preempts run with the server's locks held, active_cb with its goal's mutex, as in actionlib. No
lock is held during execute_cb, done_cb and feedback_cb.
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
UNLISTED_FOR = 1.0  # s. A goal that the server's status no longer lists for that long is LOST
RESULT_WITHIN = 30.0  # s. The same for a goal whose outcome was seen, but not its result; and if it was never listed
_TEXTS = {GoalStatus.SUCCEEDED: "all done", GoalStatus.ABORTED: "the server gave up",
          GoalStatus.PREEMPTED: "preempted by the server", GoalStatus.REJECTED: "the server refused the goal",
          GoalStatus.RECALLED: "cancelled before it was started"}
_WAITING = GoalStatus.PENDING, GoalStatus.RECALLING
_RUNNING = GoalStatus.ACTIVE, GoalStatus.PREEMPTING

_stopping = threading.Event()  # set when the shutdown of the node begins
_alive: weakref.WeakSet = weakref.WeakSet()  # the servers and clients of this process
_settled: weakref.WeakSet = weakref.WeakSet()  # the connections to which wait_for_server has given 0.2 s


class SimpleActionServer(actionlib.SimpleActionServer):
    """An actionlib.SimpleActionServer that starts and stops goals at once and gives each an outcome with a text.

    name, ActionSpec: the name of the action, and its type, such as WashTheDishesAction.
    execute_cb: called with each goal, one at a time, in a daemon thread. None for servers with goal callbacks.
    auto_start: whether to start at once. False is better, or execute_cb may be called before the constructor returns.
    shutdown_timeout: s after which a goal that has not stopped is ABORTED when the node is shut down.
    """

    next_goal: actionlib.ServerGoalHandle
    execute_callback: Any

    def __init__(self, name: str, ActionSpec: type, execute_cb: Optional[Callable[[Any], Any]] = None,
                 auto_start: bool = True, *, shutdown_timeout: Seconds = 1.0) -> None:
        """actionlib's thread for execute_cb keeps a program alive whose main thread has raised (ros/actionlib #146).
        Here it is a daemon, so it is started here, and not by actionlib's constructor."""
        self._robust_patience = _seconds(shutdown_timeout)
        super().__init__(name, ActionSpec, execute_cb=None, auto_start=False)
        self._robust_overtaken = None  # the last goal that had to stop for a newer one
        self._robust_told = threading.local()  # .goal: in each thread, the one whose rate has last said at once to stop
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
        """Returns a rospy.Rate for the work on a goal: its sleep() returns True at the end of the period, and False at
        once when the goal should stop, because of a cancel, a newer goal or a shutdown.

        A loop that goes on after False keeps its pace, and gets False at the end of each period. Once the goal that ran
        when the rate was made is over, sleep() returns False, too. Then return without calling set_preempted or the
        like, which would end a newer goal.
        """
        return _Rate(hz, self)

    @property
    def preempt_request(self) -> bool:
        """actionlib's attribute. Here it wakes the rates when it is set, and is set on shutdown, too."""
        return self._robust_preempt_request

    @preempt_request.setter
    def preempt_request(self, value: bool) -> None:
        self._robust_preempt_request = value
        _wake_rates()

    def _robust_running_goal(self):
        """Returns the goal that is ACTIVE or PREEMPTING, or None. Needs no lock, unlike is_active()."""
        goal = self.current_goal
        return goal if goal.status_tracker and goal.status_tracker.status.status in _RUNNING else None

    def executeLoop(self) -> None:
        """actionlib's waits up to 0.1 s for a goal that has come (ros/actionlib #212), polls (#164), and ends for good
        after SystemExit, or if action_server.stop() is called while a goal runs and another one waits."""
        while True:
            with self.execute_condition:  # 2 s: some programs set need_to_terminate, and notify nobody
                self.execute_condition.wait_for(lambda: self.new_goal or _stopping.is_set(), timeout=2)
            if self.need_to_terminate or _stopping.is_set():
                return
            with self.action_server.lock:
                goal = self.accept_new_goal() if self.action_server.started else None
            if goal is None:
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
        """actionlib's ends an older goal with a text of its own, and logs an error if no goal waits. Here the text says
        why the older goal had to stop. Returns None if no goal waits: it may have been cancelled meanwhile."""
        with self.action_server.lock:
            if not self.new_goal:
                return None
            if self.is_active():
                SimpleActionServer.set_preempted(self)  # not a subclass's: actionlib's does not call that, either
            return super().accept_new_goal()

    def register_goal_callback(self, cb: Optional[Callable[[], Any]]) -> None:
        """With actionlib's, a goal whose cb raises has no outcome, and after SystemExit the server stays locked. Here
        that goal is ABORTED if it was accepted, else RECALLED."""
        super().register_goal_callback(cb and (lambda: self._robust_call_goal_callback(cb)))

    def _robust_call_goal_callback(self, cb):
        goal = self.next_goal
        try:
            cb()
        except BaseException as error:
            # In a thread: the server is locked, and to log a line may take long.
            _start(rospy.logerr, "%s: the goal callback failed\n%s", self._robust_name(), traceback.format_exc())
            text = _failure("the goal callback", error)
            if self.new_goal:
                self._robust_recall(text)
            elif goal is self._robust_running_goal():
                super().set_aborted(None, text)

    def internal_goal_callback(self, goal: actionlib.ServerGoalHandle) -> None:
        """actionlib's refuses a goal with an earlier stamp than the last one's (ros/actionlib #203). Here the goal that
        comes last wins. And it wakes one thread that waits for the condition, perhaps one of the program's."""
        if _stopping.is_set():
            goal.set_canceled(None, SHUTTING_DOWN)
            return
        if self.new_goal:
            self._robust_recall("a newer goal came")
        if self.current_goal.get_goal():
            self._robust_overtaken = self.current_goal
            older = self.current_goal.get_goal_id()
            older.stamp = min(older.stamp, goal.get_goal_id().stamp)
        super().internal_goal_callback(goal)
        with self.execute_condition:
            self.execute_condition.notify_all()

    def internal_preempt_callback(self, preempt: actionlib.ServerGoalHandle) -> None:
        """actionlib's starts a goal that was cancelled while it waited (ros/actionlib #196). Here it is RECALLED."""
        if self.new_goal and preempt == self.next_goal:
            self._robust_recall("cancelled before it was started")
        else:
            super().internal_preempt_callback(preempt)

    def _robust_recall(self, text):
        """End the goal that waits."""
        self.new_goal = False
        if self.next_goal.status_tracker.status.status in _WAITING:  # the goal callback may have rejected it
            self.next_goal.set_canceled(None, text)
        self.next_goal = self.current_goal  # as after accept_new_goal

    def set_preempted(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal PREEMPTED. actionlib's gives no reason, and says PREEMPTED to a client that has not asked for it
        when the node is shut down. Here such a goal is ABORTED, "the server is shutting down".

        result: None is an empty one. text: by default why the goal had to stop.
        """
        with self.action_server.lock:
            goal = self._robust_running_goal()
            is_cancelled = goal and goal.status_tracker.status.status == GoalStatus.PREEMPTING
            if _stopping.is_set() and not is_cancelled:
                super().set_aborted(result, f"{SHUTTING_DOWN}: {text}" if text else SHUTTING_DOWN)
            else:
                is_overtaken = goal and goal is self._robust_overtaken
                why = "cancelled" if is_cancelled else "a newer goal came" if is_overtaken else ""
                super().set_preempted(result, text or why)

    def _robust_shut_down(self, deadline):
        """When the node is shut down, actionlib's server leaves its goals without an outcome. Here they are asked to
        stop, and ABORTED at deadline (time.monotonic())."""
        if not self.action_server.started:  # or action_server.stop() was called
            return
        with self.action_server.lock, self.execute_condition:
            if self.new_goal:
                self._robust_recall(SHUTTING_DOWN)
            self.execute_condition.notify_all()  # the thread of execute_cb ends
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
    """The part of a SimpleActionServer that talks to the topics."""

    status_timer: rospy.Timer
    last_cancel: rospy.Time

    def publish_result(self, status, result):
        """Each outcome passes here. actionlib's client waits forever for a result that cannot be serialized. Here the
        goal is ABORTED. And an outcome without a text gets one."""
        status.text = status.text or _TEXTS.get(status.status, "")
        try:
            _check(self.ActionResult(status=status, result=result))
        except rospy.ROSSerializationException as error:
            status.status, status.text = GoalStatus.ABORTED, f"the result cannot be sent: {error}"
            result = self.ActionResultType()
        super().publish_result(status, result)
        _wake_rates()  # of this goal, in another thread

    def publish_feedback(self, status, feedback):
        """With actionlib's, feedback that cannot be serialized spoils the next one. Here it only raises."""
        message = self.ActionFeedback(status=status)
        message.feedback = feedback  # the constructor would replace None
        _check(message)
        super().publish_feedback(status, feedback)

    def initialize(self):
        """actionlib's status ends when the clock is set back (ros/ros_comm #1083). Here the timer goes on."""
        super().initialize()
        if self.status_timer:
            self.status_timer.shutdown()
            self.status_timer = rospy.Timer(
                rospy.Duration(1 / self.status_frequency), self.publish_status_async, reset=True)

    def internal_cancel_callback(self, goal_id):
        """After a cancel with a stamp in the future, actionlib's refuses all goals until then (ros/actionlib #117)."""
        with self.lock:
            super().internal_cancel_callback(goal_id)
            self.last_cancel = min(self.last_cancel, rospy.Time.now())

    def internal_goal_callback(self, goal):
        """The same after a cancel, if the clock was set back since (ros/actionlib #203)."""
        with self.lock:
            if self.last_cancel > rospy.Time.now():
                self.last_cancel = rospy.Time()
            super().internal_goal_callback(goal)


class _Rate(rospy.Rate):
    """A rospy.Rate whose sleep() ends early when the goal should stop. See SimpleActionServer.rate."""

    last_time: rospy.Time

    def __init__(self, hz, server):
        super().__init__(hz)
        self._server, self._goal = server, server._robust_running_goal()  # goal: None for a rate of all goals

    def sleep(self):
        """rospy's cannot be woken. This one waits on the clock's condition, which _wake_rates() notifies, too."""
        server, clock, called = self._server, rospy.rostime.get_rostime_cond(), rospy.get_rostime()
        with clock:
            while True:
                is_over = self._goal and self._goal is not server._robust_running_goal()
                should_stop = bool(is_over or server.preempt_request or _stopping.is_set())
                goal = self._goal or server.current_goal
                if should_stop and getattr(server._robust_told, "goal", None) is not goal:
                    server._robust_told.goal = goal
                    return False
                called, left = min(called, rospy.get_rostime()), self.remaining()  # the clock may have been set back
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
    """An actionlib.SimpleActionClient whose state, result and callbacks agree, and that says why a goal failed.

    ns, ActionSpec: the name of the action, and its type, such as WashTheDishesAction.
    heartbeat_timeout: s. A goal without status or feedback for that long is LOST, and a cancel is sent in case the
        server still works. Only time that passes both on the ROS clock and in reality counts. None: no limit.
    cancel_on_shutdown: whether to cancel the goal when this node is shut down, and wait up to 2 s for its outcome.
    Timeouts are Durations or seconds. Raises ValueError for a heartbeat_timeout that is not above 0.
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
        self._robust_sent = threading.Condition()  # notified when a goal is sent: the watch of an older one ends
        self.action_client.manager = _GoalManager(ActionSpec)
        self.action_client.manager.register_send_goal_fn(self.action_client.pub_goal.publish)
        self.action_client.manager.register_cancel_fn(self.action_client.pub_cancel.publish)
        _alive.add(self)

    def wait_for_server(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until the server is connected.

        timeout: in real time; 0: no limit. Returns False after the timeout, and on shutdown.
        actionlib's counts ROS time, so it never ends while simulated time stands still (ros/actionlib #19), and ends at
        once when that begins (#137). It says nothing while it waits (#35). And feedback may be lost after it, since
        rospy counts a connection a moment before messages pass. This one waits 0.2 s more for new connections.
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
        if not _settled.issuperset(topic.connections):
            time.sleep(0.2)
            _settled.update(topic.connections)
        is_interrupted = rospy.is_shutdown()
        self._robust_no_server = f"interrupted while waiting for the server of {name}" if is_interrupted else None
        return not is_interrupted

    def _robust_is_connected(self):
        """Returns whether the node that has sent the last status has the other four topics, too."""
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
        """Send a goal. An older one goes on, but its callbacks are no longer called.

        Raises TypeError for a goal of another type, and rospy.ROSSerializationException for one that cannot be sent.
        actionlib's drops an answer that comes before it returns (ros/actionlib #206). Here the answer waits for
        list_mutex until gh is set. And a goal that cannot be sent spoils the next one.
        """
        expected, given = self.action_client.ActionGoal().goal._type, getattr(goal, "_type", type(goal).__name__)
        if goal is not None and given != expected:
            raise TypeError(f"the goal must be of type {expected}, not {given}")
        _check(self.action_client.ActionGoal(goal=goal))
        with self.action_client.manager.list_mutex:
            self._robust_is_sending = True  # if Ctrl-C comes before gh is set, the goal is cancelled
            super().send_goal(goal, done_cb, active_cb, feedback_cb)
            self._robust_is_sending, self._robust_no_server, gh = False, None, self.gh
        with self._robust_sent:
            self._robust_sent.notify_all()
        if self._robust_heartbeat_timeout < float("inf") or self._robust_cancel_on_shutdown:
            threading.Thread(target=self._robust_watch, args=[gh], daemon=True).start()

    def send_goal_and_wait(self, goal: Optional[genpy.Message], execute_timeout: Seconds = rospy.Duration(),
                           preempt_timeout: Seconds = rospy.Duration()) -> int:
        """actionlib's, with timeouts in seconds, too (ros/ros_comm #1658)."""
        return super().send_goal_and_wait(goal, _duration(execute_timeout), _duration(preempt_timeout))

    def wait_for_result(self, timeout: Seconds = rospy.Duration()) -> bool:
        """actionlib's, with a timeout in seconds, too. A negative one ends at once; actionlib's waits forever."""
        return super().wait_for_result(_duration(timeout))

    def cancel_goal(self) -> None:
        """actionlib's sends a cancel of a goal that is over, and then says that it is LOST (ros/actionlib #126)."""
        gh = self.gh
        if gh and not gh.comm_state_machine.latest_result:
            gh.comm_state_machine.cancel()

    def get_state(self) -> int:
        """actionlib's is terminal before the result is there (ros/actionlib #116), and LOST while a goal is sent."""
        with self.action_client.manager.list_mutex:
            state = super().get_state()
            if self.gh and self.gh.get_comm_state() != CommState.DONE:
                is_waiting = state in (GoalStatus.PENDING, GoalStatus.RECALLED, GoalStatus.REJECTED)
                return GoalStatus.PENDING if is_waiting else GoalStatus.ACTIVE
            return state

    def get_failure(self) -> Optional[str]:
        """Returns None if the goal SUCCEEDED, else one line: its state and the server's text, or why there is none."""
        state = self.get_state()
        if self._robust_no_server or not self.gh:
            return self._robust_no_server or "no goal was sent, or it is no longer tracked"
        if state in (GoalStatus.PENDING, GoalStatus.ACTIVE):  # to_string is wrong for PENDING
            return f"goal {'ACTIVE' if state == GoalStatus.ACTIVE else 'PENDING'}: no outcome so far"
        text = " ".join(self.get_goal_status_text().split()) or "the server gave no reason"
        return None if state == GoalStatus.SUCCEEDED else f"goal {GoalStatus.to_string(state)}: {text}"

    def _handle_transition(self, gh):
        """actionlib's logs an error for a goal that was replaced, and waits forever after an active_cb or done_cb that
        raises. It holds the goal's mutex during done_cb, so a goal that is sent in it has no outcome (ros/actionlib
        #193). Here done_cb has a thread of its own."""
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
            self._robust_no_server = None
            self._set_simple_state(SimpleGoalState.DONE)
        with self.done_condition:
            self.done_condition.notify_all()

    def _handle_feedback(self, gh, feedback):
        """actionlib's logs an error for a goal that was replaced."""
        if gh == self.gh:
            _call(super()._handle_feedback, gh, feedback)

    def _robust_watch(self, gh):
        """actionlib's client waits forever for a server that was killed, or freezes. This thread ends the wait: the
        goal is LOST. Until the goal is over, the thread keeps the client in memory, so that cancel_on_shutdown works
        for a client that the program has dropped."""
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
            elif ros != ros_before and now - before < 2 * tick:  # neither the clock nor this process stood still
                silence += now - before
            if silence >= limit:
                with goal.mutex, self.action_client.manager.list_mutex:  # no other goal is sent meanwhile
                    if self.gh is gh and not goal.is_heard and not _stopping.is_set():
                        goal.cancel()
                        goal.lose(f"server lost: silent for {silence:.1f} s (heartbeat_timeout is {limit:g} s)")

    def _robust_shut_down(self, deadline):
        """When the node is shut down, actionlib's client leaves its goal running. Here it is cancelled, and its outcome
        awaited until deadline (time.monotonic()), if cancel_on_shutdown is set."""
        goals, goal = self.action_client.manager.statuses, self.gh and self.gh.comm_state_machine
        if self._robust_is_sending and goals:
            goal = goals[-1]()
        if self._robust_cancel_on_shutdown and goal and not goal.latest_result:
            is_lost = goal.state == CommState.DONE  # the server may still work, but no outcome comes
            goal.cancel()
            while not is_lost and self.simple_state != SimpleGoalState.DONE and time.monotonic() < deadline:
                time.sleep(0.01)
            goal.lose(f"a cancel was sent on shutdown, and no outcome came within {self._robust_patience:g} s")


class _GoalManager(GoalManager):
    """Makes the goals of a client."""

    def _generate_id(self):
        """actionlib's gives two nodes of one name the same id while simulated time stands still."""
        goal_id = super()._generate_id()
        goal_id.id += f"0{random.SystemRandom().randrange(10**12):012d}"  # it still ends with a time
        return goal_id

    def init_goal(self, goal, transition_cb=None, feedback_cb=None):
        """actionlib's, with our class of goals."""
        action_goal = self.ActionGoal(rospy.Header(stamp=rospy.get_rostime()), self._generate_id(), goal)
        sent = _CommStateMachine(action_goal, transition_cb, feedback_cb, self.send_goal_fn, self.cancel_fn)
        with self.list_mutex:
            self.statuses.append(weakref.ref(sent))
        self.send_goal_fn(action_goal)
        return ClientGoalHandle(sent)


class _CommStateMachine(CommStateMachine):
    """What a client knows of a goal that it has sent."""

    is_heard = True  # whether there was a sign of life since the watch has looked
    unlisted_since: Optional[float] = None  # time.monotonic()

    def update_status(self, status_array):
        """With actionlib's, a goal is LOST after one status without it, which may be older than the goal; and a result
        that got lost is awaited forever (ros/actionlib #181)."""
        with self.mutex:
            if any(one.goal_id.id == self.action_goal.goal_id.id for one in status_array.status_list):
                self.is_heard, self.unlisted_since = True, None
                super().update_status(status_array)
            elif self.state not in (CommState.WAITING_FOR_GOAL_ACK, CommState.DONE):
                self._update_unlisted()

    def _update_unlisted(self):
        last, limit, text = self.latest_goal_status, UNLISTED_FOR, "the server no longer knows the goal"
        if self.state == CommState.WAITING_FOR_RESULT:
            limit, state = RESULT_WITHIN, GoalStatus.to_string(last.status)
            text = f"the server reported {state}, and no result came within {limit:g} s"
            self.is_heard = True  # the server lives
        elif not last.goal_id.id:  # it was never listed, and may still be on its way
            limit, text = RESULT_WITHIN, "cancelled, and the server never listed the goal"
        self.unlisted_since = self.unlisted_since or time.monotonic()
        if time.monotonic() - self.unlisted_since >= limit:
            self.lose(text)

    def update_result(self, action_result):
        """actionlib's changes the state of a goal that is LOST (PR2/pr2_common #139)."""
        with self.mutex:
            if self.state != CommState.DONE:
                super().update_result(action_result)

    def update_feedback(self, action_feedback):
        """actionlib's drops feedback that is handled after the result (ros/actionlib #213)."""
        if action_feedback.status.goal_id.id == self.action_goal.goal_id.id:
            self.is_heard = True
            if self.feedback_cb:
                self.feedback_cb(ClientGoalHandle(self), action_feedback.feedback)

    def transition_to(self, state):
        """actionlib's leaves DONE after a cancel (ros/actionlib #126)."""
        with self.mutex:
            if self.state != CommState.DONE:
                super().transition_to(state)

    def cancel(self):
        """If Ctrl-C interrupts a ClientGoalHandle's cancel(), its locks stay locked until the shutdown is over, so no
        cancel is sent. Here another thread sends it."""
        sending = _start(self.send_cancel_fn, GoalID(id=self.action_goal.goal_id.id))
        if sending.is_alive():
            sending.join()
        self.transition_to(CommState.WAITING_FOR_CANCEL_ACK)

    def lose(self, text):
        """End the goal LOST, unless it is over."""
        with self.mutex:
            if self.state != CommState.DONE:
                self.latest_goal_status = GoalStatus(self.action_goal.goal_id, GoalStatus.LOST, text)
                self.transition_to(CommState.DONE)


def _seconds(timeout):
    """Returns a timeout (Duration or s) in s."""
    return timeout.to_sec() if isinstance(timeout, genpy.Duration) else timeout + 0.0


def _duration(timeout):
    """Returns a timeout (Duration or s) as a Duration. 0 is no limit; one below 0 becomes 1 ms."""
    duration = timeout if isinstance(timeout, genpy.Duration) else rospy.Duration(timeout)
    return max(duration, rospy.Duration(0, 10**6)) if duration else duration


def _check(message):
    """Serialize a message as a trial: rospy sends half of one that it cannot serialize in front of the next one."""
    try:
        message.serialize(io.BytesIO())
    except Exception as error:
        raise rospy.ROSSerializationException(str(error)) from error


def _failure(what, error):
    """Returns a text for the client: what has raised the error."""
    return f"{what} failed: {''.join(traceback.format_exception_only(type(error), error)).strip()}"


def _call(callback, *args):
    """Call a callback. What it raises, even SystemExit, is logged: it must not end a thread of rospy's or ours."""
    try:
        callback(*args)
    except BaseException as error:
        if not (_stopping.is_set() and isinstance(error, rospy.ROSException)):  # the program has closed the topics
            rospy.logerr("a callback failed\n%s", traceback.format_exc())


def _start(callback, *args):
    """Call a callback in a daemon thread. Returns the thread."""
    thread = threading.Thread(target=_call, args=[callback, *args], daemon=True)
    try:
        thread.start()
    except RuntimeError:  # Python 3.12 starts no thread while the interpreter ends
        thread.run()
    return thread


def _on_shutdown():
    """End the goals of all servers and clients side by side. In threads, since this may run in a signal's handler, and
    may have interrupted code that holds a lock. The function that waits for them is called after the program's own."""
    alive = list(_alive)  # before the watches end, which keep clients in memory
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
