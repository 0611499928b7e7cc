# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionServer: takes a goal up at once, stops at once, and leaves no goal without an ending.

Threads, as with actionlib: one for execute_cb, and a rospy.Timer that publishes the status. Goals and cancels come in
rospy's own, one for each topic of a client. The order of the locks: action_server.lock, then execute_condition (the
simple server's), then the clock's condition (rate.py). A callback for goals or preempts is called with the first two
held, so whatever has to go on while it blocks must not wait for them: see __shut_down.
"""
from __future__ import annotations

import contextlib
import os
import threading
import time
import traceback
from typing import Any, Callable, Optional

import actionlib
import genpy
import rosgraph
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from . import log, peers, rate, shutdown
from .internals import NO_ANSWER, ask, ask_node, cannot_start, clear, name_of, need, wait_until
from .parameters import get_params

HEAD_START = 0.005  # s, for what a client must hear first
FEEDBACK_HEAD_START = 0.02  # s; with 5 ms, 9 of 1000 results overtook theirs on 2 cores with 12 busy programs, now none
SHUTTING_DOWN = "the server is shutting down"
_RECALLABLE = GoalStatus.PENDING, GoalStatus.RECALLING
_RUNNING = GoalStatus.ACTIVE, GoalStatus.PREEMPTING


class SimpleActionServer(actionlib.SimpleActionServer):
    """An actionlib.SimpleActionServer that takes each goal up at once, and by whom every goal is ended, with a text.

    Whatever asks for a stop, a cancel, a newer goal or a shutdown, wakes a sleep of rate(). It needs no init_node of
    ours. Names of its own begin with two underscores, so that a subclass may have any other.
    """

    def __init__(self, name: str, ActionSpec: type, execute_cb: Optional[Callable[[Any], Any]] = None,
                 auto_start: bool = True) -> None:
        """Arguments as for actionlib.SimpleActionServer. Raises rospy.ROSInitException, as start() does."""
        need("actionlib", actionlib.SimpleActionServer, "internal_goal_callback", "internal_preempt_callback")
        super().__init__(name, ActionSpec, auto_start=False)
        need("actionlib", self, "execute_callback", "execute_thread", "execute_condition", "action_server",
             "current_goal", "next_goal", "new_goal", "preempt_request", "preempt_callback", "need_to_terminate")
        self.__shutting_down = False
        self.__taken_over = 0  # goals in whose midst a newer one was accepted
        self.__taken_by: Optional[int] = None  # the thread that did it last
        self.__fed_back = 0.0  # time.monotonic() of the last feedback
        self.__name = rospy.resolve_name(name)
        self.action_server = _ActionServer(
            self.__begin, self.__stopped, name, ActionSpec, self.internal_goal_callback,
            self.internal_preempt_callback, False)
        self.execute_callback = execute_cb
        if auto_start:
            SimpleActionServer.start(self)  # a subclass may mean something else by it

    def __del__(self):
        """As actionlib's, also for a server that was not started."""
        if getattr(self, "execute_thread", None):
            super().__del__()

    def start(self) -> None:
        """Serve goals from now on. Raises rospy.ROSInitException with what prevents it."""
        try:
            super().start()
        except Exception as error:
            raise cannot_start("the action server %s cannot start: %s" % (
                rospy.resolve_name(self.action_server.ns), error)) from error

    def __begin(self):
        """Called when the action server has started, by the program or by start()."""
        self.__name = rospy.resolve_name(self.action_server.ns)  # "~" has a meaning since init_node
        if self.execute_callback and not self.execute_thread:
            self.execute_thread = threading.Thread(target=self.executeLoop)
            self.execute_thread.start()
        shutdown.at_end(self.__shut_down)
        in_this_node = self.action_server.result_pub.impl.ref_count > 1
        threading.Thread(target=self.__look_for_twins, args=[in_this_node], daemon=True).start()
        self.__log(lambda: "%s waits for goals" % self.__name)

    def __stopped(self):
        """Without it, the goal that waited is taken up after its end, and the one that runs goes on for ever."""
        with self.execute_condition:
            self.new_goal, self.next_goal = False, self.current_goal
            self.preempt_request = True  # until the next goal
        rate.wake()

    def rate(self, hz: float) -> rate.Rate:
        """Returns a rospy.Rate of hz (1/s) on the ROS clock for the goal that runs. Its sleep() returns True at the end
        of the period, and False at once when the goal is asked to stop."""
        seen, told = self.__taken_over, False

        def stop_requested():
            nonlocal seen, told
            before, heard = seen, told
            seen, told = self.__taken_over, self.is_preempt_requested()
            if told:  # which it stays until the next goal: whoever has heard of it and ended the goal sleeps again
                tracker = self.current_goal.status_tracker  # is_active() may wait for a callback
                return not heard or rospy.is_shutdown() or bool(tracker and tracker.status.status in _RUNNING)
            # Whoever has accepted the newer goal works on it from now on.
            return seen != before and not heard and self.__taken_by != threading.get_ident()

        return rate.Rate(hz, stop_requested)

    def is_preempt_requested(self) -> bool:
        """Returns whether the goal should stop: for a cancel, a newer goal and, unlike with actionlib, a shutdown."""
        return self.__shutting_down or super().is_preempt_requested()

    def accept_new_goal(self) -> Optional[genpy.Message]:
        """Take up the goal that waits; every client sees it ACTIVE before its feedback. Returns the goal, or None."""
        with self.action_server.lock, self.execute_condition:  # a subclass may have a lock of its own
            # preempt_request: a callback for preempts has ended the older one, whose worker may not have heard.
            if self.new_goal and (self.is_active() or self.preempt_request):
                self.__taken_over, self.__taken_by = self.__taken_over + 1, threading.get_ident()
            goal = super().accept_new_goal()
        if goal is not None:
            fields = _plain_fields(goal)  # execute_cb may change them
            self.__log(lambda: "%s: goal accepted%s" % (self.__name, fields))
        return goal

    def set_succeeded(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal: it is done. result: None is an empty one; text: for the client, with a default.

        What cannot be sent ends it ABORTED, with the reason, as with any ending; for a goal that has ended, an error is
        logged."""
        self.__end(super().set_succeeded, result, text or "all done")

    def set_aborted(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal: the server could not do it, and text says why."""
        self.__end(super().set_aborted, result, text or "the server gave up")

    def set_preempted(self, result: Optional[genpy.Message] = None, text: str = "") -> None:
        """End the goal because it was asked to stop: on shutdown ABORTED, unless a client has cancelled it before."""
        if self.__shutting_down and self.current_goal.get_goal_status().status != GoalStatus.PREEMPTING:
            self.__end(super().set_aborted, result, "%s: %s" % (SHUTTING_DOWN, text) if text else SHUTTING_DOWN)
        else:
            why = "a newer goal came" if self.new_goal else \
                "cancelled" if self.preempt_request else "the server stopped it unasked"
            self.__end(super().set_preempted, result, text or why, at_once=True)

    def publish_feedback(self, feedback: genpy.Message) -> None:
        """Send feedback for the goal; after the server's end, nothing. Raises rospy.ROSSerializationException for what
        cannot be sent, AttributeError for a message of another type."""
        log.show()  # on a terminal that both share, "goal accepted" stands above the client's first line
        with self.action_server.lock:
            if self.action_server.started:
                super().publish_feedback(feedback)
                self.__fed_back = time.monotonic()

    def internal_goal_callback(self, goal: actionlib.ServerGoalHandle) -> None:
        """For the library: a goal (ServerGoalHandle) has come."""
        if self.__shutting_down:
            goal.set_canceled(None, SHUTTING_DOWN)
            return
        older = self.current_goal
        if older.get_goal() and not self.is_active() and goal.get_goal_id().stamp < older.get_goal_id().stamp:
            # Without it, nobody is served any more after one stamp from the future: theirs are older.
            older.__class__ = _Ended  # next_goal, too, is this object if none waits
        try:
            super().internal_goal_callback(goal)
        except BaseException:  # actionlib keeps its lock after sys.exit and after an error without words
            with contextlib.suppress(RuntimeError):
                self.execute_condition.release()
            raise

    def executeLoop(self) -> None:
        """For the library: the thread of execute_cb. In its own, a goal waits up to 100 ms after each other one, and
        also when it comes between a check and a wait (ros/actionlib #212)."""
        while not rospy.is_shutdown() and not self.need_to_terminate:
            came = self.new_goal
            if self.is_new_goal_available():  # a subclass's may take a lock, or let the goal wait
                self.__execute(self.accept_new_goal())
                continue
            with self.execute_condition:
                if came or not self.new_goal:
                    self.execute_condition.wait(0.1)  # as actionlib's: not all that it waits for wakes it

    def __execute(self, goal):
        if not self.is_active():
            return  # recalled before the loop took it up
        process = os.getpid()
        try:
            self.execute_callback(goal)
        except BaseException as error:  # sys.exit would end the thread, and no goal would be served any more
            if os.getpid() != process:
                raise  # a child that execute_cb has forked, which is to end
            if not rospy.is_shutdown():
                log.failed(self.__name + ": execute_cb")
            if self.is_active():
                self.set_aborted(None, "execute_cb failed: " + "".join(  # also for an error whose __str__ raises
                    traceback.format_exception_only(type(error), error)).strip())
        if self.is_active():
            why = SHUTTING_DOWN if self.__shutting_down else "execute_cb returned without ending its goal"
            self.set_aborted(None, why)
        with self.execute_condition:
            self.execute_condition.wait_for(lambda: self.new_goal, HEAD_START)
        if not self.is_new_goal_available():  # whose status comes next
            self.action_server.publish_status()
            log.catch_up()

    def __end(self, set_state, result, text, at_once=False):
        goal = self.current_goal
        with self.action_server.lock:
            # The result would now and then overtake the last feedback, which actionlib's client then drops. With the
            # lock: what comes after this call comes too late.
            left = self.__fed_back + FEEDBACK_HEAD_START - time.monotonic()
            if left > 0 and not at_once:
                time.sleep(left)
            if not self.action_server.started or goal is not self.current_goal:  # a newer one was accepted meanwhile
                return
            was_active = self.is_active()
            self.action_server.with_status_later(
                threading.current_thread() is self.execute_thread, set_state, result, _sendable(text))
        if was_active:
            status = goal.status_tracker.status
            self.__log(lambda: "%s: goal %s: %s" % (self.__name, name_of(status.status), log.printable(status.text)))

    def __log(self, line):
        """A line that execute_cb's thread wrote in the midst of a goal would hold up what it tells of: so, later."""
        log.soon(line)
        if threading.current_thread() is not self.execute_thread:
            log.catch_up()

    def __shut_down(self, deadline):
        """End all goals until deadline (time.monotonic()), with no more than a moment's wait for any lock."""
        self.__shutting_down = True
        rate.wake()
        with contextlib.suppress(RuntimeError):  # no thread to be had; a callback could hold up this one
            threading.Thread(target=self.__ask_to_stop, daemon=True).start()
        wait_until(lambda: not self.action_server.unended(), deadline - time.monotonic())
        stubborn = self.action_server.unended()
        self.action_server.close()
        if stubborn:
            rospy.logwarn("%s: the server ended goals that did not stop within %g s", self.__name,
                          shutdown.GOALS_END_WITHIN)
        self.need_to_terminate = True  # the thread of execute_cb ends, for which Python waits before it comes to atexit

    def __ask_to_stop(self):
        with self.action_server.lock, self.execute_condition:
            # The program may have ended it in its goal callback, or put None there.
            if self.new_goal and self.next_goal and self.next_goal.get_goal_status().status in _RECALLABLE:
                self.next_goal.set_canceled(None, SHUTTING_DOWN)
            self.new_goal = False
            if self.preempt_callback and self.is_active():
                self.preempt_callback()

    def __look_for_twins(self, in_this_node):
        """Without it, each client of two servers of one action sees everything twice, and nobody says why."""
        others = {rospy.get_name()} if in_this_node else set()
        with contextlib.suppress(*NO_ANSWER):
            publishers, _, _ = ask(rosgraph.get_master_uri(), "getSystemState", timeout=2)
            for node in set(dict(publishers).get(self.action_server.result_pub.resolved_name, ())) - {rospy.get_name()}:
                with contextlib.suppress(*NO_ANSWER):  # one that was killed is listed still
                    if ask_node(node, "getPid"):
                        others.add(node)
        if others:
            rospy.logwarn("%s has another server, in the node %s: a client of one hears both", self.__name,
                          ", ".join(sorted(others)))


class _Ended(actionlib.ServerGoalHandle):
    """A goal that has ended, with the oldest stamp there is: no newer one is refused for being older."""

    def get_goal_id(self):
        return GoalID(id=super().get_goal_id().id)


class _ActionServer(actionlib.ActionServer):
    """Sends what a client waits for before the status of it, and forgets no goal before a status has shown its end."""

    # 0 for initialize(), which then starts no rospy.Timer: that dies if the clock is set back (rospy before 1.17).
    status_frequency = property(lambda self: self._frequency if self.started else 0.0,
                                lambda self, value: setattr(self, "_frequency", value))

    def __init__(self, begin, stopped, *args, **options):
        self._begin, self._stopped = begin, stopped
        self._later = False  # whether a status has to wait
        self._put_off = False  # whether one waits
        self._unshown = []  # GoalStatus of goals that have ended
        self._latest = 0.0  # s, by which a clock that was set back is known
        super().__init__(*args, **options)
        shutdown.servers.add(self)

    def start(self):
        """Once: a second server would publish each status twice."""
        with self.lock:
            if self.started:
                return
            super().start()
        self._begin()

    def stop(self):
        """End the goals that are left, and stop; takes 0.1 s. Without it, they have no ending."""
        self.close()
        self._stopped()
        time.sleep(shutdown.SENT_WITHIN)
        super().stop()

    def initialize(self):
        """Check what may be wrong, mend the connections, begin. Without it, a parameter of a wrong type is a TypeError
        that names none."""
        need("rospy", rospy.rostime, "get_rostime_cond", "is_wallclock")  # now, not in the middle of a goal
        need("rospy", rospy.Rate(1), "last_time", "sleep_dur", "remaining")
        peers.serve_all_peers()
        ns = rospy.remap_name(self.ns)
        frequency = rospy.search_param("actionlib_status_frequency") or "actionlib_status_frequency"
        hertz = 5.0, 0.1, 1000  # fewer are no heartbeat, more only keep a core busy
        get_params({"actionlib_server_pub_queue_size": (50, None, None), ns + "/status_frequency": hertz,
                    "actionlib_server_sub_queue_size": (-1, None, None), frequency: hertz,
                    ns + "/status_list_timeout": (5.0, 0, 1e6)})
        super().initialize()
        need("actionlib", self, "status_timer", "_frequency", "started", "lock._is_owned", "status_list", "last_cancel",
             "status_pub", "feedback_pub", "result_pub", "ActionResult", "ActionResultType")
        need("rospy", self.result_pub, "impl.buff", "impl.ref_count")
        self.status_timer = rospy.Timer(rospy.Duration(1 / self._frequency), self.publish_status_async, reset=True)

    def publish_status(self):
        with self.lock:
            self._put_off = self._later
            if self._later or not self.started:
                return
            ended, self._unshown = self._unshown, []
            shown = [one for one in self.status_list if any(one.status is status for status in ended)]
            for tracker in shown:
                tracker.handle_destruction_time = rospy.Time()  # never: the clock may leap while super() looks
            super().publish_status()
            for tracker in shown:
                tracker.handle_destruction_time = rospy.Time.now()

    def publish_status_async(self, event):
        with self.lock:
            self._look_at_the_clock()
            super().publish_status_async(event)
        log.catch_up()

    def with_status_later(self, later, function, *args):
        """Call function(*args). A status of it waits for the next one, if later (bool): else all get it before one gets
        the result."""
        with self.lock:
            before, self._later = self._later, later
            try:
                function(*args)
            finally:
                self._later = before

    def publish_result(self, status, result):
        """Without it, a goal whose result cannot be sent has no ending."""
        self._unshown.append(status)
        if status.status == GoalStatus.RECALLED:  # which actionlib gives no text, if the cancel came first
            status.text = status.text or "cancelled before it was taken up"
        try:
            super().publish_result(status, result)
        except Exception as error:
            clear(self.result_pub)
            status.status, status.text = GoalStatus.ABORTED, _sendable("the result cannot be sent: %s" % error)
            super().publish_result(status, self.ActionResultType())
            rospy.logerr("%s: %s", rospy.resolve_name(self.ns), log.printable(status.text))

    def publish_feedback(self, status, feedback):
        try:
            super().publish_feedback(status, feedback)
        except Exception:
            clear(self.feedback_pub)
            raise

    def internal_goal_callback(self, goal):
        with self.lock:
            self._look_at_the_clock()
            if not self.started:  # its topics are still open
                late = GoalStatus(goal.goal_id, GoalStatus.RECALLED, SHUTTING_DOWN)
                self._send(self.result_pub, self.ActionResult(status=late, result=self.ActionResultType()))
                return self._send(self.status_pub, GoalStatusArray(status_list=[late]))
            super().internal_goal_callback(goal)
            is_taken = self.status_list and self.status_list[-1].goal is goal
            is_ignored = not is_taken and any(tracker.goal and tracker.status.goal_id.id == goal.goal_id.id
                                              for tracker in self.status_list)
        rate.wake()  # the goal that runs has to stop for this one
        if is_ignored:
            rospy.logwarn("%s: goal ignored: its id %.60r is that of a recent goal", rospy.resolve_name(self.ns),
                          goal.goal_id.id)

    def internal_cancel_callback(self, goal_id):
        try:
            self.with_status_later(True, super().internal_cancel_callback, goal_id)
        finally:  # a callback of the program's may raise
            rate.wake()
            # Without it, whoever waits for PREEMPTING waits for the heartbeat, on the ROS clock.
            ended = bool(self._unshown)  # by the callback
            wait_until(lambda: self._unshown or not self._put_off, HEAD_START)
            if self._put_off and (ended or not self._unshown):  # else the thread of execute_cb shows its end
                self.publish_status()

    def unended(self):
        """Returns the trackers of goals that have no ending yet. Takes no lock."""
        return [one for one in list(self.status_list) if one.goal and one.status.status in _RECALLABLE + _RUNNING]

    def close(self):
        """End whatever has no ending, and stop, even if a callback holds the lock for ever."""
        mine = self.lock.acquire(timeout=0.05)
        try:
            self.started = False  # without it, the heartbeat beats into closed topics
            for tracker in self.unended():
                status = tracker.status
                status.text = SHUTTING_DOWN
                status.status = GoalStatus.RECALLED if status.status in _RECALLABLE else GoalStatus.ABORTED
                self._send(self.result_pub, self.ActionResult(status=status, result=self.ActionResultType()))
                self._unshown.append(status)  # so that a server that is started again forgets it
            self._send(self.status_pub, GoalStatusArray(status_list=[one.status for one in list(self.status_list)]))
        finally:
            if mine:
                self.lock.release()

    def _send(self, publisher, message):
        message.header.stamp = rospy.Time.now()
        with contextlib.suppress(rospy.ROSException):  # the topics are closed
            publisher.publish(message)

    def _look_at_the_clock(self):
        """Without it, a clock that is set back makes the server refuse all goals until it is later than it was: after a
        cancel of goals up to then, and while a goal runs that was sent before."""
        seconds = time.time() if rospy.rostime.is_wallclock() else rospy.get_time()  # a goal waits for it: a float
        if seconds < self._latest:
            now = rospy.Time.now()
            self.last_cancel = rospy.Time()
            for tracker in self.status_list:
                if tracker.status.goal_id.stamp > now:
                    tracker.status.goal_id.stamp = rospy.Time()
                if tracker.handle_destruction_time > now:
                    tracker.handle_destruction_time = now
        self._latest = seconds


def _plain_fields(goal):
    fields = [(name, getattr(goal, name)) for name in goal.__slots__]
    plain = ["%s %.60r" % field for field in fields if isinstance(field[1], (int, float, str))]
    return ": " + ", ".join(plain) if plain else ""


def _sendable(text):
    """Returns text as a str that UTF-8 can hold."""
    return str(text).encode("utf-8", "backslashreplace").decode("utf-8")
