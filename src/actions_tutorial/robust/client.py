# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionClient: loses no goal and no answer, notices a lost server, and cancels its goal on shutdown.

What belongs to a goal stands with the goal (_Goal), so an earlier one cannot spoil a later one.

Threads: answers come in rospy's own, one for each topic of a server. One thread more looks after the goal until it has
ended. The order of the locks: the goal's mutex, with which the library calls done_cb and active_cb; then
done_condition; then manager.list_mutex. With the latter two held, no callback of the user's is called.
"""
from __future__ import annotations

import contextlib
import io
import math
import secrets
import threading
import time
from typing import Any, Callable, Optional, Union

import actionlib
import genpy
import rosgraph
import rospy
from actionlib import CommState
from actionlib.action_client import CommStateMachine
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalID, GoalStatus

from . import log, node, peers, shutdown
from .internals import NO_ANSWER, ask, ask_node, cannot_start, clear, name_of, need, wait_until, why
from .parameters import get_params

Seconds = Union[genpy.Duration, float]

REPEATED_AFTER = 1.0  # s without a word of the server about a goal
REPEATED_FOR = 4.0  # s, if it says nothing at all: 5 s after a goal's end it knows the id no longer, and does it again
CONNECTED_AFTER = 3  # s that a server may take to connect, once the master has told it of us
LOOKS = 0.5  # s between two looks at the goal
LIVING = 6  # times heartbeat_timeout: the patience with a server whose node answers

_running: list = []  # for each callback of the program that has not come back: the topic of its goal's result


class SimpleActionClient(actionlib.SimpleActionClient):
    """An actionlib.SimpleActionClient by which each goal has an ending, and that says why it was not SUCCEEDED.

    It needs no init_node of ours. Names of its own begin with two underscores, so that a subclass may have any other.
    """

    __is_set_up = __is_watched = False
    __why_not_sent = ""
    __silent: Any = None  # the last status of a server that was lost

    def __init__(self, ns: str, ActionSpec: type, *, heartbeat_timeout: float = 5.0) -> None:
        """Arguments as for actionlib.SimpleActionClient.

        heartbeat_timeout: s for which the server may be silent about the goal before it is LOST; six times as long if
            it sends no status at all, but its node answers. A server lists its goals in its status, five times a second
            unless its parameter actionlib_status_frequency says otherwise. Only time that passes on both clocks counts,
            ROS's and the real.
        Raises ValueError for a heartbeat_timeout that is not above 0, rospy.ROSInitException for what prevents a start.
        """
        if heartbeat_timeout is True or not isinstance(heartbeat_timeout, (int, float)) or not heartbeat_timeout > 0:
            raise ValueError("heartbeat_timeout is %r, must be a number above 0" % (heartbeat_timeout,))
        try:
            get_params({"actionlib_client_pub_queue_size": (10, None, None),
                        "actionlib_client_sub_queue_size": (-1, None, None)})
            peers.serve_all_peers()
            super().__init__(ns, ActionSpec)
        except (OSError, ValueError, rospy.ROSException) as error:  # the last of topics that are closed already
            raise cannot_start("the client of %s cannot start: %s" % (rospy.resolve_name(ns), why(error))) from error
        self.__set_up(heartbeat_timeout)

    def __set_up(self, heartbeat_timeout: float = 5.0) -> None:
        """Done once. A subclass that makes the library's parts itself, not by our __init__, gets here with its first
        call."""
        if self.__is_set_up:
            return
        self.__is_set_up = True
        need("actionlib", self, "simple_state", "gh", "done_condition", "_handle_transition", "_handle_feedback")
        need("actionlib", self.action_client, "manager.list_mutex", "manager._generate_id", "pub_cancel", "result_sub",
             "feedback_sub", "last_status_msg")
        need("rospy", self.action_client, "pub_goal.impl.has_connection", "pub_goal.impl.buff",
             "status_sub.impl.connections")
        need("actionlib", CommStateMachine, "update_status", "update_result", "update_feedback", "_mark_as_lost")
        self.__heartbeat_timeout = heartbeat_timeout
        self.__registered = time.monotonic()
        # Without it, two clients of one name give the same id while simulated time stands still: the server ignores the
        # second goal, and its client waits for ever (actionlib/action_client.py, _generate_id).
        generate_id = self.action_client.manager._generate_id
        self.action_client.manager._generate_id = lambda: _made_unique(generate_id())
        shutdown.at_end(self.__end_goal)

    def wait_for_server(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait until messages go both ways between this client and a server, and say every 5 s what for.

        timeout: rospy.Duration or s, of real time (0: for ever; below 0: a look). Master and server are asked, and each
            may take 0.5 s more.
        Returns whether they do: False after timeout and on shutdown; get_failure() says which. Raises
        rospy.ROSInitException before init_node.
        """
        self.__set_up()
        rospy.get_rostime()  # raises the ROSInitException: before init_node nothing can come, and the wait does not end
        peers.serve_all_peers()  # of a client that was made before rospy.init_node, too
        what = "action " + rospy.resolve_name(self.action_client.ns)
        seconds = _duration(timeout).to_sec()
        connected = node.wait_for(what, self.__is_connected, seconds)
        goal = self.__goal()
        if not goal or goal.simple_state == SimpleGoalState.DONE:  # else it is the goal of which there is news
            self.__why_not_sent = "" if connected else \
                "interrupted while waiting for the %s" % what if rospy.is_shutdown() else \
                "no %s within %g s" % (what, max(seconds, 0))
        return connected

    def __is_connected(self) -> bool:
        """Returns whether messages go both ways. The library looks at its own ends: what is sent too early is lost."""
        client = self.action_client
        status = client.last_status_msg
        if status is self.__silent:  # None, both, before there is any
            return False
        server = status._connection_header["callerid"]
        publishers = client.pub_goal, client.pub_cancel
        if not all(publisher.impl.has_connection(server) for publisher in publishers):
            self.__register_again(publishers)
            return False
        connections = None
        with contextlib.suppress(*NO_ANSWER):  # it cannot be asked
            connections = ask_node(server, "getBusInfo")
        sends = [(str(peer), topic) for _, peer, way, _, topic, *_ in connections or () if way == "o"]
        # It does not tell, or not by names (rosnodejs), or is about to connect.
        if not connections or sends and not any(peer[:1] == "/" for peer, _ in sends):
            return time.monotonic() - self.__registered >= CONNECTED_AFTER
        sent = {topic for peer, topic in sends if peer == rospy.get_name()}
        return {client.result_sub.resolved_name, client.feedback_sub.resolved_name} <= sent

    def __register_again(self, publishers: tuple) -> None:
        """Have the master tell the server of us once more. Without it, a server without robust that has dropped our
        connections does not make them again (see peers.py, _OneAtATime)."""
        if time.monotonic() - self.__registered >= CONNECTED_AFTER:
            self.__registered = time.monotonic()
            for publisher in publishers:
                with contextlib.suppress(*NO_ANSWER):  # later, then
                    ask(rosgraph.get_master_uri(), "registerPublisher", publisher.resolved_name, publisher.type,
                        rospy.get_node_uri())

    def send_goal(self, goal: genpy.Message, done_cb: Optional[Callable] = None, active_cb: Optional[Callable] = None,
                  feedback_cb: Optional[Callable] = None) -> None:
        """Send a goal, and forget the one before. Arguments as for actionlib's; goal may be changed afterwards.

        Raises rospy.ROSSerializationException for a goal that cannot be sent (AttributeError for one of another type),
        rospy.ROSInitException on shutdown.
        """
        self.__set_up()
        with self.action_client.manager.list_mutex:  # whoever brings an answer waits for this
            # Where no hook of ours has run (rospy's init_node, a hook older than the client), it is a hook that sends
            # while the node ends. Asked first, for a signal may come in between.
            requested = rospy.core.is_shutdown_requested()
            in_hook = threading.get_ident() == shutdown.hooks_thread if shutdown.hooks_thread else requested
            if rospy.is_shutdown() or shutdown.hooks_thread and not in_hook:
                raise cannot_start("the node was shut down before it sent its goal")
            try:
                super().send_goal(goal, done_cb, active_cb, feedback_cb)
                machine = self.gh.comm_state_machine
                machine.__class__ = _Goal
                machine.begin(self.action_client.result_sub.resolved_name, in_hook)
                self.gh.cancel = machine.cancel
            except Exception as error:  # SerializationError of its fields, AttributeError of a message of another kind
                clear(self.action_client.pub_goal)
                self.stop_tracking_goal()
                self.__why_not_sent = "the goal cannot be sent: %s" % error
                if isinstance(error, genpy.SerializationError):
                    raise rospy.ROSSerializationException(str(error)) from error
                raise
            self.__why_not_sent = ""
            shutdown.unfinished.add(machine)
            if not self.__is_watched:
                threading.Thread(target=self.__watch, daemon=True).start()  # which may fail
                self.__is_watched = True

    def stop_tracking_goal(self) -> None:
        """Forget the goal; it goes on."""
        with self.action_client.manager.list_mutex:  # send_goal may be about to look at it
            super().stop_tracking_goal()

    def send_goal_and_wait(self, goal: genpy.Message, execute_timeout: Seconds = rospy.Duration(),
                           preempt_timeout: Seconds = rospy.Duration()) -> int:
        """Send a goal and wait for its ending; after execute_timeout cancel it, and wait for preempt_timeout.

        Both: rospy.Duration or s, on the ROS clock (0: for ever). Returns the state (actionlib_msgs/GoalStatus).
        """
        return super().send_goal_and_wait(goal, execute_timeout, _duration(preempt_timeout))

    def wait_for_result(self, timeout: Seconds = rospy.Duration()) -> bool:
        """Wait for the goal's ending.

        timeout: rospy.Duration or s, on the ROS clock, from when that has begun (0 and below: for ever).
        Returns True when the result is there and done_cb has run, even if that failed or sent the next goal; while the
        node ends, it waits up to 1 s more for rospy.is_shutdown(), but not in hooks, nor while a server of this node
        has a goal. False after timeout, on shutdown, without a goal, and when the server is lost; get_failure() says
        which.
        """
        goal, timeout, begun = self.__goal(), _duration(timeout), rospy.Time()
        if not goal:
            return super().wait_for_result(timeout)  # which logs an error
        with self.done_condition:
            while goal and not goal.is_over and not rospy.is_shutdown():
                now = rospy.get_rostime()
                begun = now if begun.is_zero() else begun  # zero as long as a simulated clock has not begun
                left = timeout - (now - begun)  # not in floats, which a stepped clock would fall short of
                if left <= rospy.Duration() < timeout:
                    break
                self.done_condition.wait(min(0.1, left.to_sec()) if timeout > rospy.Duration() else 0.1)
                if goal.simple_state != SimpleGoalState.DONE:
                    goal = self.__goal()  # another thread may have sent the next one, or forgotten it
        is_there = bool(goal and goal.is_over and goal.latest_goal_status.status != GoalStatus.LOST)
        if is_there:
            shutdown.let_loops_see_it()
        return is_there

    def get_state(self) -> int:
        """Returns the goal's state (GoalStatus): PENDING or ACTIVE until its ending and result came; LOST if none."""
        goal = self.__goal()
        if not goal:
            return super().get_state()
        # Without it, it is SUCCEEDED with the status, before the result is there. Simple states have the same numbers.
        return goal.simple_state if goal.simple_state != SimpleGoalState.DONE else goal.latest_goal_status.status

    def get_goal_status_text(self) -> str:
        """Returns the server's words or, if the server has given the goal no ending, why."""
        goal = self.__goal()
        return goal.why or goal.latest_goal_status.text if goal else super().get_goal_status_text()

    def get_result(self) -> Any:
        """Returns the result, or None as long as get_state() is PENDING or ACTIVE: active_cb may run when it comes."""
        goal = self.__goal()
        # Not simple_state, as there: a subclass may ask in a _handle_transition of its own.
        return None if goal and goal.state != CommState.DONE else super().get_result()

    def get_failure(self) -> Optional[str]:
        """Returns None if the goal SUCCEEDED, else why not (str): its state and the server's words, or why the server
        has given it no ending, or why none was sent."""
        goal = self.__goal()
        if not goal or self.__why_not_sent:
            return self.__why_not_sent or "no goal was sent"
        state = self.get_state()
        if state == GoalStatus.SUCCEEDED:
            return None
        text = self.get_goal_status_text() or (
            "no ending so far" if state in (GoalStatus.PENDING, GoalStatus.ACTIVE) else "the server does not say why")
        return "goal %s: %s" % (name_of(state), log.printable(text))

    def __goal(self) -> Any:
        """Returns the goal that is tracked (_Goal), or None, as for a handle that the program itself has made."""
        with self.action_client.manager.list_mutex:
            machine = self.gh and self.gh.comm_state_machine
            return machine if isinstance(machine, _Goal) else None

    def __reaches(self, goal: Any, state: int) -> bool:
        """Returns whether goal is the one that is tracked, and reaches a simple state that it did not have."""
        with self.action_client.manager.list_mutex:
            if goal is not self.__goal() or goal.simple_state >= state:
                return False
            goal.simple_state = state
            if state != SimpleGoalState.DONE:  # of a program that looks at it: as actionlib's, after done_cb
                self.simple_state = state
            # A program may set them after send_goal, too.
            goal.done_cb, goal.active_cb = self.done_cb, self.active_cb
            return True

    def _handle_transition(self, gh: actionlib.ClientGoalHandle) -> None:
        """For the library. In its own, the state becomes DONE after done_cb: for a goal that is sent from there, too,
        and never if that raises. A goal that is not tracked any more needs no error; neither does its feedback."""
        goal, state = gh.comm_state_machine, gh.get_comm_state()
        if not isinstance(goal, _Goal):  # of a handle that the program itself has made
            super()._handle_transition(gh)
        elif state in (CommState.ACTIVE, CommState.PREEMPTING) and self.__reaches(goal, SimpleGoalState.ACTIVE):
            goal.call(goal.active_cb)
        elif state == CommState.DONE and self.__reaches(goal, SimpleGoalState.DONE):
            if gh.get_goal_status() == GoalStatus.SUCCEEDED:
                shutdown.unfinished.discard(goal)
            goal.call(goal.done_cb, gh.get_goal_status(), gh.get_result())
            with self.done_condition, self.action_client.manager.list_mutex:
                goal.is_over = True
                if (self.__goal() or goal) is goal:  # or else done_cb has sent the next one
                    self.simple_state = SimpleGoalState.DONE
                self.done_condition.notify_all()

    def _handle_feedback(self, gh: actionlib.ClientGoalHandle, feedback: genpy.Message) -> None:
        with self.action_client.manager.list_mutex:
            feedback_cb = gh == self.gh and self.feedback_cb
        if feedback_cb:
            feedback_cb(feedback)

    def __watch(self) -> None:
        """Look after the goal until it has ended. Without it, a client whose server is gone waits for ever, and a goal
        that rospy dropped is lost (rospy/topics.py, add_connection: when a peer connects twice)."""
        now, patience = rospy.get_time(), self.__heartbeat_timeout
        while True:
            time.sleep(LOOKS)
            before, now = now, rospy.get_time()
            with self.action_client.manager.list_mutex:
                goal = self.__goal()
                if not goal or goal.simple_state == SimpleGoalState.DONE or rospy.is_shutdown():
                    self.__is_watched = False
                    return
            # A paused simulation is no silence. No more than one look's time counts: the clock may have jumped, and we
            # may have been stopped ourselves.
            speaks_of_others = goal.look(max(0, min(now - before, LOOKS)))
            real = time.monotonic()
            if goal.state == CommState.WAITING_FOR_GOAL_ACK and real - goal.sent_at >= REPEATED_AFTER and (
                    speaks_of_others or real - goal.begun_at < REPEATED_FOR):
                goal.send_again()
            held_up = goal.topic in _running and not speaks_of_others  # no status comes before that callback's end
            if goal.silence > patience and (
                    goal.ignored > patience or goal.silence > LIVING * patience and not held_up or
                    not speaks_of_others and not self.__server_lives()):
                self.__silent = self.action_client.last_status_msg  # who waits for a server waits for another one
                with self.action_client.manager.list_mutex:
                    if self.__goal() is not goal:
                        continue  # another thread has sent the next one
                    self.__is_watched = False  # done_cb, which is called here, may do so and wait for it
                goal.lose("server lost: silent for %.1f s (heartbeat_timeout is %g s)" % (goal.silence, patience))
                return

    def __server_lives(self) -> bool:
        """Without it, a server is lost whose callback for goals takes its time: that holds the lock that a status needs
        (actionlib/action_server.py, internal_goal_callback)."""
        client = self.action_client
        with contextlib.suppress(AttributeError):  # it never spoke, or the client was stopped or even taken apart
            for connection in client.status_sub.impl.connections:  # which has its address: the master may be gone
                with contextlib.suppress(*NO_ANSWER):
                    if connection.callerid_pub == client.last_status_msg._connection_header["callerid"] and \
                            ask(connection.endpoint_id, "getPid"):
                        return True
        return False

    def __end_goal(self, deadline: float) -> None:
        """Cancel the goal and wait for its ending. Without it, the server works on for nobody."""
        goal = self.__goal()  # also one that is just being sent
        if goal and not goal.in_hook:  # what a hook sends, such as to park an arm, is to be done
            goal.cancel()
            if not wait_until(lambda: goal.simple_state == SimpleGoalState.DONE, deadline - time.monotonic()):
                goal.why = "a cancel was sent, no ending came within 1 s"


class _Goal(CommStateMachine):
    """What the library knows of a goal that was sent, and what we know of it: what was made a CommStateMachine, for the
    library knows no other class, becomes one of these before any answer gets to it."""

    def begin(self, topic: str, in_hook: bool) -> None:
        self.topic, self.in_hook = topic, in_hook  # the topic of its result; whether a hook of on_shutdown has sent it
        self.simple_state = SimpleGoalState.PENDING
        self.is_over = False  # DONE, and done_cb has run
        self.why = ""  # the server has given it no ending
        self.mentioned, self.passed_over = True, False  # in a status since the last look
        self.silence = self.ignored = 0.0  # s; of the latter the server spoke, but not of this goal
        self.begun_at = self.sent_at = time.monotonic()
        sent = io.BytesIO()
        self.action_goal.serialize(sent)
        self.sent = sent.getvalue()  # the message itself may be used again

    def look(self, seconds: float) -> bool:
        """Returns whether the server has spoken since the last look, so many seconds ago, but not of this goal."""
        at_work = not self.mutex.acquire(blocking=False)  # a callback of the program's: statuses wait for its end
        if not at_work:
            self.mutex.release()
        mentioned, passed_over = self.mentioned or at_work, self.passed_over
        self.mentioned = self.passed_over = False
        if mentioned:
            self.silence = self.ignored = 0.0
            return False
        self.silence += seconds
        # Without it, a goal that waited for a busy server is lost in the moment in which that speaks again.
        # While a callback runs, of another client's goal, too, the result may wait behind it.
        self.ignored += seconds if passed_over and self.topic not in _running else 0
        return passed_over

    def send_again(self) -> None:
        """The id makes it harmless."""
        self.sent_at = time.monotonic()
        with contextlib.suppress(rospy.ROSException):  # the client was stopped
            self.send_goal_fn(type(self.action_goal)().deserialize(self.sent))

    def cancel(self) -> None:
        """In place of the handle's, which asks a server to stop what has ended, too, and waits for the mutex. That is
        held while done_cb, say, ends the goal of a server whose callback for preempts cancels this one."""
        self.sent_at = math.inf  # it is not sent again
        if self.state != CommState.DONE:
            with contextlib.suppress(rospy.ROSException):  # the client was stopped
                self.send_cancel_fn(GoalID(id=self.action_goal.goal_id.id))

    def lose(self, why: str) -> None:
        """End it here, and say why."""
        with self.mutex:
            if self.state != CommState.DONE:
                self.cancel()  # in case the server is only asleep
                self.why, self.topic = why, ""  # done_cb runs in the watcher's thread, and holds nothing up
                super()._mark_as_lost()

    def update_status(self, status_array: Any) -> None:
        if self.state == CommState.DONE:
            return  # done_cb holds the mutex for as long as it likes, and the statuses of other goals wait
        if any(status.goal_id.id == self.action_goal.goal_id.id for status in status_array.status_list):
            self.mentioned = True
        else:
            self.passed_over = True
        super().update_status(status_array)

    def update_result(self, action_result: Any) -> None:
        # What is not for it must not wait for the mutex: done_cb, which has it, may wait for the next goal.
        if self.state != CommState.DONE and self.action_goal.goal_id.id == action_result.status.goal_id.id:
            with self.mutex:
                if self.state != CommState.DONE:  # a goal that is LOST stays so
                    super().update_result(action_result)

    def update_feedback(self, action_feedback: Any) -> None:
        """Without it, the last feedback is dropped if its callback is slow. What was sent after the result, or is for a
        LOST goal, still is."""
        result = self.latest_result
        if self.action_goal.goal_id.id == action_feedback.status.goal_id.id and (
                self.state != CommState.DONE or result and action_feedback.header.stamp <= result.header.stamp):
            self.mentioned = True  # a server that works in its goal callback sends no status meanwhile
            self.sent_at = math.inf  # it has come
            self.feedback_cb(actionlib.ClientGoalHandle(self), action_feedback.feedback)

    def call(self, callback: Optional[Callable], *args: Any) -> None:
        """Call a callback of the user's. Without it, one that raises takes along what the library does after it."""
        _running.append(self.topic)
        try:
            if callback:
                callback(*args)
        except BaseException:  # sys.exit would end the thread that brings the answers
            log.failed("the callback %s" % getattr(callback, "__name__", callback))
        finally:
            _running.remove(self.topic)

    def _mark_as_lost(self) -> None:
        self.why = "the server no longer knows the goal"
        super()._mark_as_lost()


def _duration(timeout: Seconds) -> genpy.Duration:
    return timeout if isinstance(timeout, genpy.Duration) else rospy.Duration(timeout)


def _made_unique(goal_id: Any) -> Any:
    goal_id.id += "-" + secrets.token_hex(4)
    return goal_id
