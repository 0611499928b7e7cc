# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionClient: no answer is missed, state, result and callbacks agree, and get_failure() says what failed.

Each goal has its own object (_Goal). It is made before the goal is sent, so no answer comes too early, and an earlier
goal cannot affect a later one. It is an actionlib.CommStateMachine, and client.gh is a ClientGoalHandle of it,
as in actionlib.

Undocumented members of actionlib that are used:
* of SimpleActionClient: action_client, gh, simple_state, done_condition, done_cb, active_cb and feedback_cb, since
  programs read and set them.
* of ActionClient: last_status_msg, pub_goal, pub_cancel, status_sub, result_sub, feedback_sub, ActionGoal, and manager
  with its list_mutex and statuses, in which a goal is registered for the answers.
* of CommStateMachine: its constructor; update_status, update_result, update_feedback, transition_to and send_cancel_fn,
  which are overridden; action_goal, state, latest_goal_status and latest_result, which a ClientGoalHandle reads.
* of ClientGoalHandle: its constructor and comm_state_machine.
Of rospy: impl of a publisher or subscriber and its connections, with endpoint_id, callerid_pub and header; and
_connection_header of a message. actionlib's wait_for_server uses these, but never ends before simulated time begins.
Of genpy's messages: _type, the type's name.

The stage of a goal:

    SENT --accepted--> ACTIVE_CB ==returns==> ACCEPTED --outcome--> DONE_CB ==returns==> OVER
      `------------------ outcome without acceptance ------------------^

    -->  moved by the thread of rospy's that brings the message, by that of the heartbeat, or on shutdown (_Goal.record)
    ==>  moved by a short-lived daemon thread that calls active_cb and done_cb (_Goal.call_back)

An outcome moves only the goal of client.gh. Another one keeps its stage, and done_cb is not called for it.

With heartbeat_timeout or cancel_on_shutdown, each goal has a thread that watches it and keeps its client in memory.
Locks: client._robust_changed guards gh, the callbacks and all that is known of goals. ClientGoalHandle.cancel() takes
it after the mutex of a CommStateMachine. None is held while a callback runs, or while done_condition is notified.
"""
from __future__ import annotations

import contextlib
import itertools
import math
import random
import threading
import time
import traceback
import weakref
from typing import Any, Callable, Optional, Tuple, Union

import actionlib
import genpy
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus

from .common import STATE_NAMES, check_serializable, log

Seconds = Union[genpy.Duration, float]

UNLISTED_FOR = 1.0  # s. A goal that the status no longer lists for that long is LOST
RESULT_WITHIN = 30.0  # s. The same for a goal whose terminal state was seen: its result may be late
CANCELLED_UNLISTED_FOR = 5.0  # s. The same, from the cancel, for a cancelled goal that was never listed
CANCELLED_WITHIN = 2.0  # s from the cancel on shutdown to the outcome
SETTLED_AFTER = 0.2  # s for a new connection: rospy counts it a moment before messages pass
_ACCEPTED = {GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED}
_COMM_STATES = {getattr(GoalStatus, name): getattr(actionlib.CommState, name)
                for name in ("PENDING", "ACTIVE", "RECALLING", "PREEMPTING")}
SENT, ACTIVE_CB, ACCEPTED, DONE_CB, OVER = range(5)  # stages of a goal, see above

clients: weakref.WeakValueDictionary = weakref.WeakValueDictionary()  # all of this process, by id()
_goal_numbers = itertools.count(1)


class SimpleActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient whose state, result and callbacks agree, and that says why a goal failed.

    ns: the name of the action.
    ActionSpec: its type, such as WashTheDishesAction.
    heartbeat_timeout: s. A goal without status or feedback for that long is LOST, and a cancel is sent in case the
        server still works. Only time that passes both on the ROS clock and in reality counts. None: no limit.
    cancel_on_shutdown: whether to cancel the goal when this node is shut down, and wait up to 2 s for its outcome.
    Raises ValueError for a heartbeat_timeout that is not above 0.
    """

    def __init__(self, ns: str, ActionSpec: type, *, heartbeat_timeout: Optional[float] = None,
                 cancel_on_shutdown: bool = False) -> None:
        if heartbeat_timeout is not None and not heartbeat_timeout > 0:
            raise ValueError("heartbeat_timeout is %r, must be above 0, or None" % heartbeat_timeout)
        super().__init__(ns, ActionSpec)
        self.gh: Optional[actionlib.ClientGoalHandle]  # of the goal, None if there is none
        self._robust_name = rospy.resolve_name(ns)
        self._robust_heartbeat_timeout = heartbeat_timeout
        self._robust_cancel_on_shutdown = cancel_on_shutdown
        self._robust_changed = threading.Condition()  # notified when a goal is over
        self._robust_no_server: Optional[str] = None  # why the last wait_for_server failed
        self._robust_settled: weakref.WeakSet = weakref.WeakSet()  # connections that are older than SETTLED_AFTER
        self._robust_warning = threading.Thread()  # writes a warning of wait_for_server
        clients[id(self)] = self

    def wait_for_server(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until the server is connected. Every 5 s a warning names the server that it waits for.

        timeout: rospy.Duration or s, in real time even with a simulated clock; 0: no limit.
        Returns whether it is connected: False after timeout and on shutdown. After a new connection it waits 0.2 s
        more, or the first feedback might be lost. Raises rospy.ROSInitException before rospy.init_node.
        """
        rospy.get_rostime()  # raises rospy.ROSInitException before rospy.init_node
        seconds, begun, warned = _seconds(timeout), time.monotonic(), 0.0
        while not rospy.is_shutdown():
            connection, waited = self._robust_connection(), time.monotonic() - begun
            if connection in self._robust_settled:
                self._robust_no_server = None
                return True
            if connection:
                time.sleep(SETTLED_AFTER)
                self._robust_settled.add(connection)
            elif waited >= seconds:
                self._robust_no_server = "no server of %s within %g s" % (self._robust_name, seconds)
                return False
            elif waited - warned >= 5 and not self._robust_warning.is_alive():
                warned, line = waited, "waiting for the server of %s for %d s" % (self._robust_name, waited)
                # In a thread: rospy asks the master before it logs, and that may hang.
                self._robust_warning = threading.Thread(target=log, args=[rospy.logwarn, line], daemon=True)
                with contextlib.suppress(RuntimeError):  # no thread can be started
                    self._robust_warning.start()
            time.sleep(0.01)
        self._robust_no_server = "interrupted while waiting for the server of %s" % self._robust_name
        return False

    def _robust_connection(self):
        """Returns the connection on which the last status came, if that server's other four topics are connected, too;
        else one that has settled, and still is connected so. None if there is neither."""
        client = self.action_client
        if not client.last_status_msg:
            return None
        last = client.last_status_msg._connection_header
        complete = set.intersection(
            *({one.endpoint_id for one in each.impl.connections} for each in (client.pub_goal, client.pub_cancel)),
            *({one.callerid_pub for one in each.impl.connections} for each in (client.result_sub, client.feedback_sub)))
        found = [one for one in client.status_sub.impl.connections
                 if one.callerid_pub in complete and (one.header is last or one in self._robust_settled)]
        return min(found, key=lambda one: one.header is not last, default=None)

    def send_goal(self, goal: Optional[genpy.Message], done_cb: Optional[Callable[[int, Any], Any]] = None,
                  active_cb: Optional[Callable[[], Any]] = None,
                  feedback_cb: Optional[Callable[[Any], Any]] = None) -> None:
        """Send a goal, once. An earlier goal continues on the server, but its callbacks are no longer called.

        goal: a message such as WashTheDishesGoal, None for an empty one. It may be changed and used again afterwards.
        done_cb: called with the terminal state (GoalStatus) and the result. It may send the next goal and wait for it.
        active_cb: called when the server has accepted the goal.
        feedback_cb: called with each feedback.
        All three are also attributes of the client, read when a callback is due.
        Raises TypeError for a message of another type, rospy.ROSSerializationException for one that cannot be sent, and
        RuntimeError where no thread can be started for heartbeat_timeout or cancel_on_shutdown.
        """
        # The random digits are for two nodes with the same name that send at the same simulated time.
        stamp, digits = rospy.Time.now(), random.SystemRandom().randrange(10**12)
        goal_id = "%s-%d-%.3f0%012d" % (rospy.get_name(), next(_goal_numbers), stamp.to_sec(), digits)
        ActionGoal = self.action_client.ActionGoal
        action_goal, kind = ActionGoal(rospy.Header(stamp=stamp), GoalID(stamp, goal_id), goal), ActionGoal().goal._type
        if getattr(action_goal.goal, "_type", None) != kind:
            raise TypeError("the goal must be of type %s, not %s" % (kind, getattr(goal, "_type", type(goal).__name__)))
        check_serializable(action_goal)
        sent, heartbeat = _Goal(self, action_goal), self._robust_heartbeat_timeout or math.inf
        with self._robust_changed:
            if self._robust_heartbeat_timeout or self._robust_cancel_on_shutdown:
                try:
                    threading.Thread(target=_watch, args=[sent, heartbeat], daemon=True).start()
                except RuntimeError:  # Python 3.12 starts no thread while the interpreter ends
                    if threading.main_thread().is_alive():
                        raise
            self.done_cb, self.active_cb, self.feedback_cb = done_cb, active_cb, feedback_cb
            self.gh, self.simple_state = actionlib.ClientGoalHandle(sent), actionlib.SimpleGoalState.PENDING
            self._robust_no_server = None
        manager = self.action_client.manager
        with manager.list_mutex:
            manager.statuses.append(weakref.ref(sent))
        try:
            self.action_client.pub_goal.publish(action_goal)
        except rospy.ROSException:  # the program has called action_client.stop()
            self.stop_tracking_goal()
            raise

    def send_goal_and_wait(self, goal: Optional[genpy.Message], execute_timeout: Seconds = rospy.Duration(),
                           preempt_timeout: Seconds = rospy.Duration()) -> int:
        """Send a goal and wait until it is over. After execute_timeout, cancel it and wait for preempt_timeout.

        execute_timeout, preempt_timeout: rospy.Duration or s, on the ROS clock; 0: no limit.
        Returns its state (GoalStatus). Raises what send_goal raises.
        """
        for timeout in execute_timeout, preempt_timeout:
            _seconds(timeout)  # raises before anything is sent
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
        seconds, goal, begun = _seconds(timeout), self._robust_goal, rospy.get_time()
        if not goal:
            rospy.logerr("Called wait_for_result when no goal exists")
            return False
        with self._robust_changed:
            while goal and (goal.is_replaced() or not goal.is_over()):
                now = rospy.get_time()
                begun = min(begun or now, now)  # simulated time may begin or be set back meanwhile
                left = seconds - (now - begun)
                if left <= 0 or rospy.is_shutdown():
                    return False
                # At most 0.1 s: the clock may be simulated, and a shutdown notifies nobody.
                self._robust_changed.wait(min(0.1, left))
                # Another thread may have sent the next one, or stopped tracking.
                goal = self._robust_goal if goal.is_replaced() else goal
            return goal is not None

    @property
    def _robust_goal(self):
        return getattr(self.gh, "comm_state_machine", None)

    def get_state(self) -> int:
        """Returns the state of the goal (GoalStatus): PENDING or ACTIVE until outcome and result are there, then the
        terminal state; LOST if there is no goal."""
        goal = self._robust_goal
        if not goal or goal.outcome is not None:
            return goal.outcome if goal else GoalStatus.LOST
        return GoalStatus.PENDING if goal.stage == SENT else GoalStatus.ACTIVE

    def get_failure(self) -> Optional[str]:
        """Returns None if the goal SUCCEEDED, else one line: its state and the server's text, or why there is none.
        If wait_for_server has failed since, after the outcome or while there is none: why."""
        goal = self._robust_goal
        if self._robust_no_server or not goal:
            return self._robust_no_server or "no goal was sent, or it is no longer tracked"
        outcome = goal.outcome  # read once: the result may come meanwhile
        if outcome == GoalStatus.SUCCEEDED:
            return None
        if outcome is None:
            return "goal %s: no outcome so far" % ("PENDING" if goal.stage == SENT else "ACTIVE")
        text = goal.latest_goal_status.text or "the server gave no reason"
        return "goal %s: %s" % (STATE_NAMES.get(outcome, outcome), " ".join(text.split()))

    def _robust_begin_shutdown(self) -> Optional[Tuple[Callable[[], None], Callable[[float], None], float]]:
        """For the library: if the goal is to be cancelled, returns a function that does that, one that then ends it
        (see _Goal.end), and its deadline. It may run in a signal's handler, so it takes no lock."""
        goal = self._robust_goal
        if not self._robust_cancel_on_shutdown or not goal or goal.latest_result:
            return None
        # A goal that is LOST has an outcome: there is nothing to wait for.
        return goal.cancel, goal.end, time.monotonic() + (CANCELLED_WITHIN if goal.outcome is None else 0)


class _Goal(actionlib.CommStateMachine):
    """What is known of a goal that was sent. state, latest_goal_status and latest_result are actionlib's: what the
    server has reported, for a ClientGoalHandle. stage and outcome are for the client."""

    def __init__(self, client, action_goal):
        super().__init__(action_goal, None, None, None, None)
        del self.send_cancel_fn  # it would hide the method of that name
        self.client, self.changed, self.id = client, client._robust_changed, action_goal.goal_id.id
        self.stage = SENT
        self.outcome = None  # the terminal state (GoalStatus), set together with the result
        self.unlisted_since = self.cancelled_at = None  # time.monotonic() of the first status without it, first cancel
        self.unlisted_at = -math.inf  # the same of the last status without it
        self.silence = 0.0  # s

    def is_current(self):
        """Returns whether the client's callbacks are called for this goal."""
        return getattr(self.client.gh, "comm_state_machine", None) is self

    def is_replaced(self):
        """Returns whether another goal was sent, or none is tracked any more, before done_cb was due."""
        return self.stage < DONE_CB and not self.is_current()

    def is_over(self):
        """Returns whether there is an outcome, and no callback runs or is due."""
        return self.outcome is not None and self.stage not in (ACTIVE_CB, DONE_CB)

    def cancel(self):
        """Cancel the goal, unless the program has called action_client.stop()."""
        with contextlib.suppress(rospy.ROSException):
            actionlib.ClientGoalHandle(self).cancel()

    def end(self, deadline):
        """Wait until the goal, which was cancelled, is over. At deadline (time.monotonic()) it is LOST."""
        with self.changed:
            self.changed.wait_for(self.is_over, deadline - time.monotonic())
        self.set_lost("a cancel was sent on shutdown, and no outcome came within %g s" % CANCELLED_WITHIN)

    def send_cancel_fn(self, goal_id):
        """Overrides actionlib's, for ClientGoalHandle.cancel(): send a cancel, unless the server has sent the outcome.
        If the goal is only LOST, the server may still work on it."""
        if not self.latest_result:
            self.cancelled_at = self.cancelled_at or time.monotonic()
            self.client.action_client.pub_cancel.publish(goal_id)

    def transition_to(self, state):
        """Overrides actionlib's: set state, for ClientGoalHandle.cancel(), unless the goal has an outcome."""
        with self.changed:
            if self.outcome is None:
                self.state = state

    def update_status(self, status_array):
        """Overrides actionlib's: a status of the server has come."""
        status = next((one for one in status_array.status_list if one.goal_id.id == self.id), None)
        if status:
            self.unlisted_since = None
            return self.record(status)
        seen, now = self.latest_goal_status.status, time.monotonic()
        self.unlisted_at, self.unlisted_since = now, self.unlisted_since or now
        since, limit, text = self.unlisted_since, UNLISTED_FOR, "the server no longer knows the goal"
        if not self.latest_goal_status.goal_id.id:  # no status has listed it so far
            since, limit, text = self.cancelled_at or now, CANCELLED_UNLISTED_FOR, (
                "cancelled, and the server does not list the goal")
        elif seen not in _COMM_STATES:  # its result is on the way
            self.silence = 0.0  # the server lives
            limit, text = RESULT_WITHIN, "the server reported %s, and no result came within %g s" % (
                STATE_NAMES.get(seen, seen), RESULT_WITHIN)
        if now - since >= limit:
            self.set_lost(text)

    def update_feedback(self, action_feedback):
        """Overrides actionlib's: feedback has come."""
        if action_feedback.status.goal_id.id == self.id:
            self.record(action_feedback.status, is_feedback=True)
            with self.changed:
                callback = self.client.feedback_cb if self.is_current() else None
            _call(callback, action_feedback.feedback)

    def update_result(self, action_result):
        """Overrides actionlib's: a result has come."""
        if action_result.status.goal_id.id == self.id:
            self.record(action_result.status, outcome=action_result.status.status, action_result=action_result)

    def set_lost(self, text):
        """Record that the goal is LOST, and why."""
        self.record(GoalStatus(self.action_goal.goal_id, GoalStatus.LOST, text), outcome=GoalStatus.LOST)

    def record(self, status, is_feedback=False, outcome=None, action_result=None):
        """Record a status (GoalStatus), one that came with feedback, which may be older than the last, or the outcome
        (GoalStatus), unless there is one. A terminal state is an outcome only with the result. Then start callbacks."""
        with self.changed:
            if self.outcome is not None:
                return
            self.silence = 0.0
            if not is_feedback:
                self.latest_goal_status = status
                # After a cancel was sent, PENDING and ACTIVE mean that the server has not seen it yet.
                if self.state != actionlib.CommState.WAITING_FOR_CANCEL_ACK or status.status not in (
                        GoalStatus.PENDING, GoalStatus.ACTIVE):
                    self.state = _COMM_STATES.get(status.status, actionlib.CommState.WAITING_FOR_RESULT)
            if outcome is not None:
                if self.is_current():
                    self.client._robust_no_server = None
                self.latest_result, self.state, self.outcome = action_result, actionlib.CommState.DONE, outcome
                self.changed.notify_all()
            if not self.move(status.status in _ACCEPTED):
                return
        try:
            threading.Thread(target=self.call_back, daemon=True).start()  # done_cb may wait for the next goal
        except RuntimeError:  # at the limit of threads; in Python 3.12 also while the interpreter ends
            self.call_back()

    def move(self, is_accepted=False):
        """Move the goal to ACTIVE_CB or DONE_CB if one of these is due. Returns whether it is. Needs the lock."""
        before = self.stage
        if before == SENT and is_accepted:
            self.stage = ACTIVE_CB
        elif before in (SENT, ACCEPTED) and self.outcome is not None and self.is_current():
            self.stage = DONE_CB
        return self.stage != before

    def call_back(self):
        """Call active_cb or done_cb, unless another goal was sent meanwhile; then go on to done_cb if it is due."""
        client, is_due = self.client, True
        while is_due:
            with self.changed:
                is_current, call = self.is_current(), [client.active_cb]
                if self.stage == DONE_CB:
                    call = [client.done_cb, self.outcome, self.latest_result and self.latest_result.result]
                elif is_current:
                    client.simple_state = actionlib.SimpleGoalState.ACTIVE
            if is_current:
                _call(*call)
            with self.changed:
                self.stage += 1  # ACCEPTED or OVER
                # done_cb may have sent another goal.
                is_done = self.stage == OVER and is_current and (client.gh is None or self.is_current())
                if is_done:
                    client.simple_state = actionlib.SimpleGoalState.DONE
                is_due = self.move()
                self.changed.notify_all()
        if is_done:
            with client.done_condition:
                client.done_condition.notify_all()


def _watch(goal, heartbeat):
    """Keep a goal (_Goal) and its client in memory until the goal is over, replaced or no longer tracked. After
    heartbeat (s) without status or feedback, cancel it and make it LOST."""
    tick = min(0.5, heartbeat / 4)
    real, ros = time.monotonic(), rospy.get_time()
    while True:
        with goal.changed:
            if goal.outcome is not None or not goal.is_current():
                return
            goal.changed.wait(tick)
            real_before, ros_before, real, ros = real, ros, time.monotonic(), rospy.get_time()
            if real - real_before < 2 * tick:  # else this process or computer was suspended
                goal.silence += max(0.0, min(real - real_before, ros - ros_before))
            silence = goal.silence
        if silence >= heartbeat:
            goal.cancel()  # in case the server is only asleep
            is_alive = real - goal.unlisted_at < heartbeat / 2
            goal.set_lost("%s %.1f s (heartbeat_timeout is %g s)" % (
                "the server did not list the goal, nor send feedback, for" if is_alive else "server lost: silent for",
                silence, heartbeat))


def _seconds(timeout):
    """Returns a timeout (rospy.Duration or s) in s, math.inf for 0. Raises TypeError or ValueError for no number."""
    seconds = timeout.to_sec() if isinstance(timeout, genpy.Duration) else timeout + 0.0
    if math.isnan(seconds):
        raise ValueError("the timeout is not a number")
    return seconds or math.inf


def _call(callback, *args):
    """Call a callback of the program. What it raises is logged: it must not end the thread, not even SystemExit."""
    try:
        if callback:
            callback(*args)
    except BaseException:
        log(rospy.logerr, "the callback %s failed\n%s", getattr(callback, "__name__", callback), traceback.format_exc())
