# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionClient: no answer is missed, state, result and callbacks agree, and get_failure() says what went wrong.

There is one object for each goal (_Goal). It is made before the goal is sent, so no answer comes too early, and an
earlier goal cannot spoil a later one.

Used of actionlib though its documentation does not list it: simple_state and action_client of SimpleActionClient, and
pub_goal, pub_cancel, ActionGoal, ActionResult and ActionFeedback of action_client. Of messages: _type, the type's name.

Threads: answers come in rospy's, one for each topic of a server. They record the answer and call feedback_cb. A daemon
thread for each goal calls active_cb and done_cb and watches for silence. No lock is held while a callback runs.
"""
from __future__ import annotations

import contextlib
import io
import math
import threading
import time
import traceback
import uuid
import weakref
from typing import Any, Callable, Optional, Union

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from .server import STATE_NAMES

Seconds = Union[genpy.Duration, float]

UNLISTED_FOR = 1.0  # s for which a status no longer lists a goal that is then LOST
CANCELLED_WITHIN = 1.0  # s from the cancel on shutdown to the outcome
SETTLED_AFTER = 0.2  # s for a new connection: rospy counts it a moment before messages pass
_WAS_ACTIVE = {GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED}

clients: weakref.WeakSet = weakref.WeakSet()  # all of this process


class SimpleActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient whose state, result and callbacks agree, and that says why a goal failed.

    ns: the name of the action.
    ActionSpec: its type, such as WashTheDishesAction.
    heartbeat_timeout: s without status or feedback about the goal after which it is LOST, and a cancel is sent in case
        the server still works. Only time that passes both on the ROS clock and in reality counts. None: no limit.
    cancel_on_shutdown: whether the goal is cancelled when this node is shut down. The outcome is awaited for 1 s.
    Raises ValueError for a heartbeat_timeout that is not above 0.
    """

    def __init__(self, ns: str, ActionSpec: type, *, heartbeat_timeout: Optional[float] = None,
                 cancel_on_shutdown: bool = False) -> None:
        if heartbeat_timeout is not None and not heartbeat_timeout > 0:
            raise ValueError("heartbeat_timeout is %r, must be above 0, or None" % heartbeat_timeout)
        super().__init__(ns, ActionSpec)
        self.__name = rospy.resolve_name(ns)
        self.__heartbeat_timeout = heartbeat_timeout
        self.__cancel_on_shutdown = cancel_on_shutdown
        self.__goal: Optional[_Goal] = None
        self.__not_sent = "no goal was sent"
        self.__is_settled = False  # wait_for_server has waited for SETTLED_AFTER
        self.__changed = threading.Condition()
        topic = rospy.remap_name(ns)
        self.__subscribers = [
            rospy.Subscriber(topic + "/status", GoalStatusArray, self.__on_status),
            rospy.Subscriber(topic + "/feedback", self.action_client.ActionFeedback, self.__on_feedback),
            rospy.Subscriber(topic + "/result", self.action_client.ActionResult, self.__on_result)]
        clients.add(self)

    def wait_for_server(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until the server is connected. Every 5 s a line is logged that says what for.

        timeout: rospy.Duration or s, in real time, also where time is simulated; 0: no limit.
        Returns whether it is connected: False after timeout and on shutdown. After a new connection it waits 0.2 s
        more, or the first feedback might be lost. Raises rospy.ROSInitException before rospy.init_node.
        """
        seconds = timeout.to_sec() if isinstance(timeout, genpy.Duration) else timeout
        begun, logged = time.monotonic(), 0.0
        while True:
            # A timeout in the past is a single look. Before simulated time begins there is no past.
            if not rospy.get_rostime().is_zero() and self.action_client.wait_for_server(rospy.Duration(0, -1)):
                if not self.__is_settled:
                    time.sleep(SETTLED_AFTER)
                self.__is_settled, self.__not_sent = True, "no goal was sent"
                return True
            self.__is_settled = False
            waited = time.monotonic() - begun
            if rospy.is_shutdown():
                self.__not_sent = "interrupted while waiting for the server of %s" % self.__name
                return False
            if seconds and waited >= seconds:
                self.__not_sent = "no server of %s within %g s" % (self.__name, seconds)
                return False
            if waited - logged >= 5:
                logged = waited
                rospy.loginfo("waiting for the server of %s for %d s", self.__name, waited)
            time.sleep(0.01)

    def send_goal(self, goal: genpy.Message, done_cb: Optional[Callable[[int, Any], Any]] = None,
                  active_cb: Optional[Callable[[], Any]] = None,
                  feedback_cb: Optional[Callable[[Any], Any]] = None) -> None:
        """Send a goal, once. A goal before it goes on at the server, and its callbacks are not called any more.

        goal: a message such as WashTheDishesGoal. It may be changed and used again afterwards.
        done_cb: called with the terminal state (GoalStatus) and the result. It may send the next goal and wait for it.
        active_cb: called when the server has accepted the goal.
        feedback_cb: called with each feedback.
        Raises TypeError for a message of another type, rospy.ROSSerializationException for one that cannot be sent.
        """
        action_goal = self.action_client.ActionGoal()
        if getattr(goal, "_type", None) != action_goal.goal._type:
            raise TypeError("the goal must be of type %s, not %s" % (
                action_goal.goal._type, getattr(goal, "_type", type(goal).__name__)))
        action_goal.goal_id = actionlib.GoalIDGenerator().generate_ID()
        action_goal.goal_id.id += "-" + uuid.uuid4().hex[:8]  # two nodes of one name may send in one simulated moment
        action_goal.header.stamp = action_goal.goal_id.stamp
        action_goal.goal = goal
        try:
            action_goal.serialize(io.BytesIO())  # rospy would leave half of it in front of the next message
        except Exception as error:
            raise rospy.ROSSerializationException(str(error)) from error
        sent = _Goal(action_goal.goal_id.id, done_cb, active_cb, feedback_cb)
        with self.__changed:
            self.__goal = sent
            self.simple_state = actionlib.SimpleGoalState.PENDING
            self.__changed.notify_all()  # the thread of the goal before ends
        try:
            threading.Thread(target=self.__follow, args=[sent], daemon=True).start()
        except RuntimeError:  # Python 3.12 and later start no thread while the interpreter shuts down
            sent.has_thread = False
        self.action_client.pub_goal.publish(action_goal)

    def send_goal_and_wait(self, goal: genpy.Message, execute_timeout: Seconds = rospy.Duration(),
                           preempt_timeout: Seconds = rospy.Duration()) -> int:
        """Send a goal and wait until it is over. After execute_timeout, cancel it and wait for preempt_timeout.

        execute_timeout, preempt_timeout: rospy.Duration or s, on the ROS clock; 0: no limit.
        Returns its state (GoalStatus). Raises what send_goal raises.
        """
        self.send_goal(goal)
        if not self.wait_for_result(execute_timeout):
            self.cancel_goal()
            self.wait_for_result(preempt_timeout)
        return self.get_state()

    def wait_for_result(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until the goal is over and done_cb has run.

        timeout: rospy.Duration or s, on the ROS clock; 0: no limit.
        Returns True when it is over, LOST included; False after timeout, on shutdown and without a goal.
        """
        goal = self.__goal
        if not goal:
            rospy.logerr("wait_for_result was called, and no goal was sent")
            return False
        timeout, begun = _duration(timeout), rospy.get_rostime()

        def time_left() -> float:
            nonlocal begun
            if rospy.is_shutdown():
                return 0
            if timeout <= rospy.Duration():
                return math.inf
            now = rospy.get_rostime()
            begun = now if begun.is_zero() else min(begun, now)  # simulated time may begin or be set back meanwhile
            return (timeout - (now - begun)).to_sec()

        if not goal.has_thread:
            self.__follow(goal, time_left)
        with self.__changed:
            while not goal.is_over and time_left() > 0:
                # At most 0.1 s: the clock may be simulated, and a shutdown notifies nobody.
                self.__changed.wait(min(0.1, time_left()))
                if goal.outcome is None and goal is not self.__goal:  # another thread has sent the next one
                    goal = self.__goal
                    if not goal:
                        return False
            return goal.is_over

    def get_state(self) -> int:
        """Returns the state of the goal (GoalStatus): PENDING or ACTIVE until outcome and result are there, then the
        terminal state; LOST if there is no goal."""
        goal = self.__goal
        return goal.state if goal else GoalStatus.LOST

    def get_result(self) -> Any:
        """Returns the result, or None as long as there is none."""
        goal = self.__goal
        return goal.result if goal else None

    def get_goal_status_text(self) -> str:
        """Returns the server's last text about the goal or, if the goal is LOST, why."""
        goal = self.__goal
        return goal.text if goal else ""

    def get_failure(self) -> Optional[str]:
        """Returns None if the goal SUCCEEDED, else one line: its state and the server's text, or why there is none."""
        goal = self.__goal
        if not goal:
            return self.__not_sent
        if goal.outcome == GoalStatus.SUCCEEDED:
            return None
        text = "no outcome so far" if goal.outcome is None else goal.text or "the server gave no reason"
        return "goal %s: %s" % (STATE_NAMES.get(goal.state, goal.state), " ".join(text.split()))

    def cancel_goal(self) -> None:
        """Ask the server to stop the goal. Nothing is sent if it has a terminal state."""
        goal = self.__goal
        if goal and goal.outcome is None:
            self.__send_cancel(goal)

    def __send_cancel(self, goal):
        with contextlib.suppress(rospy.ROSException):  # the program has called action_client.stop()
            self.action_client.pub_cancel.publish(GoalID(id=goal.id))

    def stop_tracking_goal(self) -> None:
        """Forget the goal, which goes on. Its callbacks are not called any more."""
        with self.__changed:
            if self.__goal:
                self.__goal.done_cb = self.__goal.active_cb = self.__goal.feedback_cb = None
            self.__goal, self.__not_sent = None, "the goal is no longer tracked"
            self.__changed.notify_all()

    def __on_status(self, message):
        goal = self.__goal
        if not goal or goal.outcome is not None:
            return
        status = next((one for one in message.status_list if one.goal_id.id == goal.id), None)
        if status:
            goal.is_listed, goal.unlisted_since = True, None
            self.__record_status(goal, status)
        elif goal.is_listed:
            now = time.monotonic()
            goal.unlisted_since = goal.unlisted_since or now
            if now - goal.unlisted_since >= UNLISTED_FOR:
                self.__end(goal, GoalStatus.LOST, "the server no longer knows the goal")

    def __on_feedback(self, message):
        goal = self.__goal
        if goal and goal.id == message.status.goal_id.id:
            self.__record_status(goal, message.status)
            _call(goal.feedback_cb, message.feedback)

    def __on_result(self, message):
        goal = self.__goal
        if goal and goal.id == message.status.goal_id.id:
            self.__end(goal, message.status.status, message.status.text, message.result)

    def __record_status(self, goal, status):
        """A terminal state (GoalStatus) is recorded with the result only."""
        with self.__changed:
            goal.silence = 0.0
            if goal.outcome is None:
                goal.text = status.text
                if status.status in _WAS_ACTIVE and not goal.was_active:
                    goal.was_active = True
                    self.__changed.notify_all()

    def __end(self, goal, outcome, text, result=None):
        """Record a terminal state. Returns whether it is the first."""
        with self.__changed:
            if goal.outcome is not None:
                return False
            goal.was_active = goal.was_active or outcome in _WAS_ACTIVE
            goal.text, goal.result, goal.outcome = text, result, outcome
            self.__changed.notify_all()
            return True

    def __follow(self, goal, time_left=lambda: math.inf):
        """Call the callbacks of a goal and watch for silence, until it is over, another is sent or no time is left."""
        heartbeat = self.__heartbeat_timeout
        tick = min(0.5, heartbeat / 4) if heartbeat else None if goal.has_thread else 0.1
        real, ros = time.monotonic(), rospy.get_time()
        while (goal is self.__goal or goal.outcome is not None) and not goal.is_over and time_left() > 0:
            if goal.was_active and not goal.active_called:
                goal.active_called = True
                self.__show(goal, actionlib.SimpleGoalState.ACTIVE)
                _call(goal.active_cb)
            elif goal.outcome is not None:
                _call(goal.done_cb, goal.outcome, goal.result)
                self.__show(goal, actionlib.SimpleGoalState.DONE)
                with self.__changed:
                    goal.is_over = True
                    self.__changed.notify_all()
            else:
                with self.__changed:
                    if goal is self.__goal and goal.outcome is None and goal.was_active == goal.active_called:
                        self.__changed.wait(tick)
            if heartbeat:
                real_before, ros_before, real, ros = real, ros, time.monotonic(), rospy.get_time()
                with self.__changed:
                    # At most two ticks count: this computer may have been asleep.
                    goal.silence += max(0.0, min(real - real_before, ros - ros_before, 2 * tick))
                    text = "server lost: silent for %.1f s (heartbeat_timeout is %g s)" % (goal.silence, heartbeat)
                if goal.silence >= heartbeat and self.__end(goal, GoalStatus.LOST, text):
                    self.__send_cancel(goal)  # in case the server is only asleep

    def __show(self, goal, simple_state):
        """Set simple_state, which is not documented, but some programs read it."""
        with self.__changed:
            if goal is self.__goal:
                self.simple_state = simple_state

    def _begin_shutdown(self) -> Optional[Callable[[], None]]:
        """For the library: cancel the goal if that was asked for. Returns a function that waits for the outcome."""
        goal = self.__goal
        if not self.__cancel_on_shutdown or not goal or goal.is_over:
            return None
        self.cancel_goal()
        deadline = time.monotonic() + CANCELLED_WITHIN
        return lambda: self.__wait_for_outcome(goal, deadline)

    def __wait_for_outcome(self, goal, deadline):
        with self.__changed:
            self.__changed.wait_for(lambda: goal.is_over, max(0, deadline - time.monotonic()))
            self.__end(goal, GoalStatus.LOST, "a cancel was sent on shutdown, and no outcome came within %g s" %
                       CANCELLED_WITHIN)


class _Goal:
    """What is known of a goal that was sent. outcome is None until it has a terminal state; is_over becomes True when
    done_cb has run after that."""

    def __init__(self, goal_id, done_cb, active_cb, feedback_cb):
        self.id, self.done_cb, self.active_cb, self.feedback_cb = goal_id, done_cb, active_cb, feedback_cb
        self.outcome = self.result = None
        self.text = ""
        self.was_active = self.active_called = self.is_over = False
        self.has_thread = True
        self.is_listed = False  # a status has listed it
        self.unlisted_since = None  # time.monotonic() of the first status that did so no longer
        self.silence = 0.0  # s

    @property
    def state(self):
        """The state that the program sees (GoalStatus)."""
        if self.outcome is not None:
            return self.outcome
        return GoalStatus.ACTIVE if self.was_active else GoalStatus.PENDING


def _duration(timeout):
    return timeout if isinstance(timeout, genpy.Duration) else rospy.Duration.from_sec(timeout)


def _call(callback, *args):
    """Call a callback of the program. What it raises is logged: it must not end the thread, not even SystemExit."""
    try:
        if callback:
            callback(*args)
    except BaseException:
        rospy.logerr("the callback %s failed\n%s", getattr(callback, "__name__", callback), traceback.format_exc())
