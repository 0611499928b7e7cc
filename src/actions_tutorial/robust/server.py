# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionServer: goals start at once, stop at once, and always reach a terminal state with a text.

Undocumented members of actionlib that are used:
* of SimpleActionServer: internal_goal_callback, internal_preempt_callback, executeLoop, need_to_terminate,
  preempt_request and __del__, which are overridden; action_server, execute_condition, execute_callback, execute_thread,
  preempt_callback, current_goal, next_goal, new_goal. There is no other way to start goals without polling, or to end
  one that waits.
* of ActionServer: initialize, publish_result, publish_feedback, publish_status, internal_goal_callback and
  internal_cancel_callback, which are overridden; publish_status_async, lock, started, status_list, status_timer,
  status_frequency, last_cancel, result_pub and the message types.
* of ServerGoalHandle and StatusTracker: status_tracker, goal, status. Reading them needs no lock, which a callback of
  the program may hold.

Threads: one for execute_cb; a rospy.Timer that publishes the status; on shutdown those of robust/__init__.py. Goals and
cancels come in rospy's. action_server.lock guards the goals. execute_condition, whose lock is locked after it, wakes
executeLoop; actionlib holds it during callbacks, too. A line of log at INFO or above asks the master, which may hang:
robust writes none while a lock is held, and none in the usual course of a goal.

    PENDING --accept_new_goal()--> ACTIVE --a cancel--> PREEMPTING    ACTIVE, PREEMPTING --set_…() or robust--> terminal
       `--a newer goal, a cancel, a goal callback that raises, a shutdown--> RECALLED
"""
from __future__ import annotations

import contextlib
import threading
import time
import traceback
import weakref
from typing import Any, Callable, List, Optional, Tuple

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalStatus

from .common import STATE_NAMES, check_serializable, log, shutdown
from .rate import Rate, wake

SHUTTING_DOWN = "the server is shutting down"
_WAITING = GoalStatus.PENDING, GoalStatus.RECALLING
_RUNNING = GoalStatus.ACTIVE, GoalStatus.PREEMPTING
_DEFAULT_TEXTS = {
    GoalStatus.SUCCEEDED: "all done", GoalStatus.ABORTED: "the server gave up",
    GoalStatus.PREEMPTED: "preempted by the server", GoalStatus.REJECTED: "the server refused the goal",
    GoalStatus.RECALLED: "cancelled before it was started"}

servers: weakref.WeakValueDictionary = weakref.WeakValueDictionary()  # all of this process, by id()


class SimpleActionServer(actionlib.SimpleActionServer):
    """An actionlib.SimpleActionServer that starts and stops goals at once and gives each a terminal state with a text.

    name: of the action.
    ActionSpec: its type, such as WashTheDishesAction.
    execute_cb: called with each goal, one at a time, in a daemon thread. None for servers with goal callbacks.
    auto_start: whether to call start(). False is better: execute_cb may be called before the constructor returns.
    shutdown_timeout: s after which a goal is ABORTED that has not stopped when the node is shut down.
    Raises ValueError for a shutdown_timeout below 0, or not finite.

    The texts, unless the program gives one: "all done", "the server gave up", and for a PREEMPTED goal why it had to
    stop. A result that cannot be sent makes its goal ABORTED, with the reason.
    """

    def __init__(self, name: str, ActionSpec: type, execute_cb: Optional[Callable[[Any], Any]] = None,
                 auto_start: bool = True, *, shutdown_timeout: float = 1.0) -> None:
        if not 0 <= shutdown_timeout <= threading.TIMEOUT_MAX:
            raise ValueError("shutdown_timeout is %r, must be a number of seconds, 0 or more" % shutdown_timeout)
        # No execute_cb here, or actionlib would start a thread that polls.
        super().__init__(name, ActionSpec, execute_cb=None, auto_start=False)
        self.next_goal: actionlib.ServerGoalHandle
        self._robust_name = name
        self._robust_shutdown_timeout = shutdown_timeout
        self._robust_why: Tuple[Any, str] = (None, "")  # the id of the last goal that should stop, and the reason
        self._robust_answered = threading.local()  # what the rates in each thread have answered
        self._robust_failures: List[str] = []  # what callbacks have raised and is not logged yet
        self.action_server = _ActionServer(name, ActionSpec, self)
        if execute_cb:
            self.execute_callback = execute_cb
            self.execute_thread = threading.Thread(target=self.executeLoop, daemon=True)
            self.execute_thread.start()
        servers[id(self)] = self
        if auto_start:
            self.action_server.start()  # not start(), which a subclass may have overridden

    def __del__(self) -> None:
        """End the thread of execute_cb, as actionlib's does. Returns when the goal that runs is over."""
        thread = getattr(self, "execute_thread", None)  # None also if the constructor failed
        if thread:
            self.need_to_terminate = True
            if thread.ident not in (None, threading.get_ident()):
                thread.join()

    @property
    def need_to_terminate(self) -> bool:
        """Whether no more goals are executed: some programs set it to end the thread of execute_cb."""
        return self._robust_need_to_terminate

    @need_to_terminate.setter
    def need_to_terminate(self, value: bool) -> None:
        self._robust_need_to_terminate = value
        if value:
            with self.execute_condition:
                self.execute_condition.notify_all()

    @property
    def preempt_request(self) -> bool:
        """Whether the goal should stop, except for a shutdown: a program may set it to ask its own goal to stop."""
        return self._robust_preempt_request

    @preempt_request.setter
    def preempt_request(self, value: bool) -> None:
        self._robust_preempt_request = value
        wake()

    def rate(self, hz: float) -> Rate:
        """Returns a rate for the work on a goal: a rospy.Rate whose sleep() returns True at the end of the period, and
        False at once when the goal should stop: for a cancel, a newer goal or a shutdown. A loop that goes on after
        False keeps its pace, and gets False at the end of each period.

        hz: 1/s, on the ROS clock.

        A rate belongs to the goal that runs when it is made: once that goal is over, sleep() returns False, too. Then
        return without set_preempted or the like, which would end a newer goal.
        """
        own = self._robust_running_goal()

        def request() -> Any:
            if shutdown.is_set():
                return SHUTTING_DOWN
            if own and own is not self._robust_running_goal():
                return own
            return self.current_goal if self.is_preempt_requested() else None

        return Rate(hz, request, self._robust_answered)

    def _robust_running_goal(self):
        """Returns the goal that is active, or None. Needs no lock, unlike is_active()."""
        goal = self.current_goal
        return goal if goal.status_tracker and goal.status_tracker.status.status in _RUNNING else None

    def is_preempt_requested(self) -> bool:
        """Returns whether the goal should stop: for a cancel, a newer goal and, unlike in actionlib, a shutdown."""
        return shutdown.is_set() and bool(self._robust_running_goal()) or super().is_preempt_requested()

    def accept_new_goal(self) -> Any:
        """Accept the goal that waits. One that is active is PREEMPTED. For servers with goal callbacks.

        Returns the goal, or None if none waits, for instance since it was cancelled.
        """
        with self.action_server.lock:
            if not self.new_goal:
                return None
            if self.is_active():
                self.current_goal.set_canceled()
            return super().accept_new_goal()

    def set_preempted(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal PREEMPTED, since it was asked to stop. During a shutdown it is ABORTED, "the server is shutting
        down", unless a client has cancelled it before.

        result: None is an empty one. text: for the client, by default why the goal had to stop.
        """
        if shutdown.is_set() and self.current_goal.get_goal_status().status != GoalStatus.PREEMPTING:
            super().set_aborted(result, "%s: %s" % (SHUTTING_DOWN, text) if text else SHUTTING_DOWN)
        else:
            super().set_preempted(result, text)

    def register_goal_callback(self, cb: Optional[Callable[[], Any]]) -> None:
        """Call cb() when a goal has come, instead of an execute_cb. If it raises, the goal is ABORTED if it was
        accepted, else RECALLED, and the traceback is logged."""
        super().register_goal_callback(cb and (lambda: self._robust_call_goal_callback(cb)))

    def register_preempt_callback(self, cb: Optional[Callable[[], Any]]) -> None:
        """Call cb() when the goal should stop: for a cancel, a newer goal and, unlike in actionlib, a shutdown.
        If it raises, the traceback is logged."""
        super().register_preempt_callback(cb and (lambda: self._robust_call_preempt_callback(cb)))

    def _robust_call_goal_callback(self, cb):
        goal = self.next_goal
        try:
            cb()
        except BaseException as error:  # after SystemExit, actionlib would keep its lock
            text, lines = _failure("the goal callback", error)
            self._robust_failures.append(lines)
            if goal.get_goal_status().status in _WAITING:
                self._robust_recall_next_goal(text)
            elif goal == self.current_goal and self.is_active():
                self.set_aborted(None, text)

    def _robust_call_preempt_callback(self, cb):
        try:
            cb()
        except BaseException as error:
            self._robust_failures.append(_failure("the preempt callback", error)[1])

    def internal_goal_callback(self, goal: actionlib.ServerGoalHandle) -> None:
        """Overrides actionlib's: a goal has come. The last one wins, regardless of its stamp."""
        if shutdown.is_set():
            goal.set_canceled(None, SHUTTING_DOWN)
            return
        if self.new_goal:
            self._robust_recall_next_goal("a newer goal came")
        if self.current_goal.get_goal():
            older = self.current_goal.get_goal_id()
            if self._robust_why[0] is not older:  # else it is cancelled
                self._robust_why = older, "a newer goal came"
            older.stamp = min(older.stamp, goal.get_goal_id().stamp)  # actionlib refuses a goal with an earlier stamp
        super().internal_goal_callback(goal)
        with self.execute_condition:
            self.execute_condition.notify_all()  # actionlib wakes one thread, which may be one of the program

    def internal_preempt_callback(self, preempt: actionlib.ServerGoalHandle) -> None:
        """Overrides actionlib's: a cancel has come. A goal that waits is RECALLED, and not started."""
        if self.new_goal and preempt == self.next_goal:
            self._robust_recall_next_goal("cancelled before it was started")
        else:
            self._robust_why = preempt.get_goal_id(), "cancelled"
            super().internal_preempt_callback(preempt)

    def _robust_recall_next_goal(self, text):
        self.new_goal = False
        self.next_goal.set_canceled(None, text)
        self.next_goal = self.current_goal  # as after accept_new_goal

    def executeLoop(self) -> None:
        """Overrides actionlib's, which polls: call execute_cb for each goal as soon as it has come."""
        while True:
            with self.execute_condition:
                self.execute_condition.wait_for(lambda: self.new_goal or self._robust_is_terminating())
                if self._robust_is_terminating():
                    return
            goal = self.accept_new_goal()
            if goal is not None:
                self._robust_execute(goal)
            else:  # it was cancelled in between, or a subclass does not accept it yet
                time.sleep(0.01)

    def _robust_is_terminating(self):
        return self.need_to_terminate or shutdown.is_set()

    def _robust_execute(self, goal):
        text, lines = "execute_cb returned without a terminal state", None
        try:
            self.execute_callback(goal)
        except BaseException as error:  # SystemExit would end the thread
            text, lines = _failure("execute_cb", error)
        was_active = False
        with contextlib.suppress(rospy.ROSException):  # the program may have called action_server.stop() meanwhile
            was_active = self.is_active()
            if was_active:
                self.set_aborted(None, SHUTTING_DOWN if shutdown.is_set() else text)
        if lines:
            self._robust_log(rospy.logerr, lines)
        elif was_active:
            self._robust_log(rospy.logwarn, ": " + text)

    def _robust_log(self, write, line):
        """Log the action's name and line with write, such as rospy.logwarn. On shutdown only errors are logged: if a
        node was shut down because another one took its name, a log line would make the master shut down that one,
        too."""
        if write is rospy.logerr or not shutdown.is_set():
            log(write, "%s%s", rospy.resolve_name(self._robust_name), line)

    def _robust_log_failures(self):
        """Log what callbacks have raised while the lock was held. Called when it is free again."""
        with self.action_server.lock:
            failures, self._robust_failures = self._robust_failures, []
        for lines in failures:
            self._robust_log(rospy.logerr, lines)

    def _robust_begin_shutdown(self) -> Tuple[Callable[[], None], Optional[Callable[[float], None]], float]:
        """For the library, perhaps in a signal's handler. Returns what asks the goals to stop, what ends them at a
        deadline, None if each has a terminal state, and the deadline (time.monotonic())."""
        end_goals = None if self._robust_is_idle() else self._robust_end_goals
        return self._robust_ask_to_stop, end_goals, time.monotonic() + self._robust_shutdown_timeout

    def _robust_ask_to_stop(self):
        if self.execute_condition.acquire(timeout=0.1):  # a callback may hold it
            self.execute_condition.notify_all()  # the thread of execute_cb ends
            self.execute_condition.release()
        if self.action_server.lock.acquire(timeout=self._robust_shutdown_timeout):  # a callback may hold it
            try:
                if self.new_goal:
                    self._robust_recall_next_goal(SHUTTING_DOWN)
                if self.preempt_callback and self.is_active():
                    self.preempt_callback()
            finally:
                self.action_server.lock.release()
            self._robust_log_failures()

    def _robust_end_goals(self, deadline):
        """Wait until all goals have a terminal state. At deadline (time.monotonic()) set it for the others."""
        while not self._robust_is_idle():
            if time.monotonic() >= deadline:
                return self._robust_abort_unfinished()
            time.sleep(0.01)

    def _robust_unfinished(self):
        """Returns the goals (list of StatusTracker) without a terminal state. Needs no lock."""
        return [one for one in list(self.action_server.status_list)
                if one.goal and one.status.status in _WAITING + _RUNNING]

    def _robust_is_idle(self):
        """Returns whether each goal has a terminal state, and none is being published."""
        if self._robust_unfinished() or not self.action_server.lock.acquire(blocking=False):
            return False
        self.action_server.lock.release()
        return True

    def _robust_abort_unfinished(self):
        """End all goals that have no terminal state, even if a callback of the program keeps the lock."""
        server = self.action_server
        locked = server.lock.acquire(timeout=0.1)
        for tracker in self._robust_unfinished():
            status = tracker.status
            self._robust_preempt_request = True  # execute_cb, which may go on, still learns that it should stop
            status.status = GoalStatus.RECALLED if status.status in _WAITING else GoalStatus.ABORTED
            status.text = SHUTTING_DOWN
            message = server.ActionResult(status=status, result=server.ActionResultType())
            message.header.stamp = rospy.Time.now()
            with contextlib.suppress(rospy.ROSException):  # the program may have called stop()
                server.result_pub.publish(message)
        if locked:
            server.publish_status()
            server.lock.release()


class _ActionServer(actionlib.ActionServer):
    """The part of a SimpleActionServer (simple) that talks to the topics. Each terminal state passes publish_result."""

    def __init__(self, name, ActionSpec, simple):
        super().__init__(
            name, ActionSpec, simple.internal_goal_callback, simple.internal_preempt_callback, auto_start=False)
        self.status_timer: Optional[rospy.Timer]
        self.last_cancel: rospy.Time
        self.simple = simple

    def start(self):
        with self.lock:
            if not self.started:  # a second start would publish each status twice
                super().start()

    def initialize(self):
        super().initialize()
        if self.status_timer:
            # actionlib's timer ends when the clock is set back.
            self.status_timer.shutdown()
            self.status_timer = rospy.Timer(
                rospy.Duration(1 / self.status_frequency), self.publish_status_async, reset=True)

    def publish_result(self, status, result):
        """Send a terminal state, with a default text. If the result cannot be sent, the goal is ABORTED."""
        goal_id, why = self.simple._robust_why
        if status.status != GoalStatus.PREEMPTED or goal_id is not status.goal_id:
            why = _DEFAULT_TEXTS[status.status]
        status.text = _escaped(status.text or why)
        try:
            check_serializable(self.ActionResult(), status=status, result=result)
        except rospy.ROSSerializationException as error:
            status.status = GoalStatus.ABORTED
            status.text = _escaped("the result cannot be sent: %s" % error)
            result = self.ActionResultType()
        with _topics_may_be_closed():
            super().publish_result(status, result)
        rospy.logdebug("%s: goal %s: %s", self.ns, STATE_NAMES[status.status], status.text)
        wake()  # a rate of the goal, in another thread

    def publish_feedback(self, status, feedback):
        check_serializable(self.ActionFeedback(), status=status, feedback=feedback)
        with _topics_may_be_closed():
            super().publish_feedback(status, feedback)

    def publish_status(self):
        with _topics_may_be_closed():
            super().publish_status()

    def internal_goal_callback(self, goal):
        with self.lock:
            if self.last_cancel > rospy.Time.now():  # the clock was set back
                self.last_cancel = rospy.Time()
            super().internal_goal_callback(goal)
            is_new = bool(self.status_list) and self.status_list[-1].goal is goal
            is_repeated = not is_new and any(
                one.goal and one.status.goal_id.id == goal.goal_id.id for one in self.status_list)
        self.simple._robust_log_failures()
        if is_repeated:
            self.simple._robust_log(
                rospy.logwarn, ": goal ignored: a goal with its id %r came before" % goal.goal_id.id)

    def internal_cancel_callback(self, goal_id):
        with self.lock:
            super().internal_cancel_callback(goal_id)
            self.last_cancel = min(self.last_cancel, rospy.Time.now())  # a stamp in the future cancels no later goals
        self.simple._robust_log_failures()


@contextlib.contextmanager
def _topics_may_be_closed():
    """During a shutdown, suppress the rospy.ROSException of a topic that is closed."""
    try:
        yield
    except rospy.ROSException:
        if not shutdown.is_set():
            raise


def _failure(what, error):
    """Returns a text for the client and one with the traceback for the log."""
    text = "".join(traceback.format_exception_only(type(error), error)).strip()
    lines = "".join(traceback.format_exception(type(error), error, error.__traceback__))
    return "%s failed: %s" % (what, text), ": %s failed\n%s" % (what, lines)


def _escaped(text):
    """Returns text as a str that UTF-8 can hold."""
    return str(text).encode("utf-8", "backslashreplace").decode("utf-8")
