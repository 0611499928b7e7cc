"""SimpleActionServer: takes a goal up at once, stops at once, and leaves no goal without an ending."""
import collections
import contextlib
import threading
import time

import actionlib
import rospy

from . import connections, log, rate
from .libraries import need
from .parameters import get_param

LATER = 0.005  # s: a head start for what a client must hear first


class SimpleActionServer(actionlib.SimpleActionServer):
    """Like actionlib.SimpleActionServer; what it adds stands with each method.

    A goal is taken up at once. Whatever stops it, a cancel, a newer goal or a shutdown, ends a sleep of rate(). It ends
    with a text that says why, and is forgotten. Needs no init_node of ours, which does the same for the node.
    """

    def __init__(self, name, ActionSpec, execute_cb=None, auto_start=True):
        need("actionlib", actionlib.SimpleActionServer, "executeLoop", "internal_goal_callback",
             "internal_preempt_callback")
        super().__init__(name, ActionSpec, auto_start=False)
        need("actionlib", self, "lock", "execute_callback", "execute_thread", "execute_condition", "action_server",
             "current_goal", "next_goal", "preempt_callback")
        self._shutting_down = self._closed = False
        self._fed_back = 0  # time.monotonic() of the last feedback
        self.action_server = _ActionServer(
            name, ActionSpec, self.internal_goal_callback, self.internal_preempt_callback, auto_start=False)
        self.action_server.active_soon = self.is_new_goal_available
        if execute_cb:
            self.execute_callback = execute_cb
            self.execute_condition = _GoalCondition(self)
            # A daemon: otherwise, a server that cannot start stays half alive until Ctrl-C.
            self.execute_thread = threading.Thread(target=self.executeLoop, daemon=True)
            self.execute_thread.start()
        if auto_start:
            self.start()

    def start(self):
        """Raises rospy.ROSInitException with what prevents it."""
        try:
            self.rate(1)  # a rospy that lacks what we need fails now, not in the middle of a goal
            connections.serve_all_peers()
            super().start()
        except Exception as error:
            raise rospy.ROSInitException("the action server %s cannot start: %s" % (
                rospy.resolve_name(self.action_server.ns), error)) from error
        rospy.on_shutdown(self._shut_down)

    def rate(self, hz):
        """Returns a rospy.Rate whose sleep() returns False at once when a stop is asked for, else True."""
        return rate.Rate(hz, self.is_preempt_requested)

    def is_preempt_requested(self):
        """True on shutdown, too. Without it, a goal dies with its node, and its client never hears of an ending."""
        return self._shutting_down or super().is_preempt_requested()

    def accept_new_goal(self):
        """Every client sees the goal ACTIVE before its feedback. Without it, nothing tells that a goal came."""
        with self.action_server.lock:
            self.action_server.at_once = True
            goal = super().accept_new_goal()
        self.action_server.news.append(goal)
        return goal

    def set_succeeded(self, result=None, text=""):
        self._end_goal("SUCCEEDED", super().set_succeeded, result, text or "all done")

    def set_aborted(self, result=None, text=""):
        self._end_goal("ABORTED", super().set_aborted, result, text or "the server gave up")

    def set_preempted(self, result=None, text=""):
        """On shutdown the goal ends ABORTED instead: no client asked for this."""
        if self._shutting_down:
            self._end_goal("ABORTED", super().set_aborted, result, "the server is shutting down")
        else:
            newer = self.is_new_goal_available()
            text = text or ("a newer goal came" if newer else "cancelled")
            self._end_goal("PREEMPTED", super().set_preempted, result, text)

    def _end_goal(self, state, set_state, result, text):
        """Without it, nothing tells how a goal ended, and one that ends too late raises (rospy/topics.py, publish)."""
        if self.is_active() and not self._closed:
            self.action_server.news.append("goal %s: %s" % (state, text))
        if state != "PREEMPTED":
            self.action_server.log_news()
            log.flush(0.05)  # on a terminal that both share, it then stands above what the client says of the result
            # The result would now and then overtake the last feedback, which its client then drops.
            time.sleep(max(0, self._fed_back + LATER - time.monotonic()))
        with self.action_server.lock:
            if not self._closed:
                set_state(result, text)

    def publish_feedback(self, feedback):
        """Without it, feedback that comes too late raises, too."""
        with self.action_server.lock:
            if not self._closed:
                super().publish_feedback(feedback)
                self._fed_back = time.monotonic()

    def internal_goal_callback(self, goal):
        """Forget the last goal, and wake rate.sleep(). Without it, a goal is refused for a stamp older than that of one
        that has ended: after one stamp from the future, or once the clock is set back, nobody is served any more."""
        with self.lock:
            if not self.is_active() and not self.is_new_goal_available():
                self.current_goal = self.next_goal = actionlib.ServerGoalHandle()
        super().internal_goal_callback(goal)
        if self.is_preempt_requested():
            rate.wake()

    def internal_preempt_callback(self, preempt):
        """Without it, a cancel does not wake rate.sleep()."""
        super().internal_preempt_callback(preempt)
        rate.wake()

    def _shut_down(self):
        """End the goal while messages still go out, for at most 1 s, then stop the heartbeat. Without it, the goal has
        no ending, and the heartbeat may beat into closed topics, with a traceback (actionlib/action_server.py)."""
        self._shutting_down = True
        with self.action_server.lock, self.lock:
            if self.preempt_callback and self.is_active():
                self.preempt_callback()
        rate.wake()
        limit = time.monotonic() + 1
        while (self.is_active() or self.is_new_goal_available()) and time.monotonic() < limit:
            time.sleep(0.01)
        with self.action_server.lock:
            if self.is_active():
                self.set_preempted()  # execute_cb has not done so in time
            self._closed = True
            self.action_server.stop_status()
        time.sleep(0.1)  # rospy sends from a thread of its own and cannot be asked when it is done


class _GoalCondition(threading.Condition):
    """What executeLoop waits on between two goals. Without it, it waits up to 100 ms after each goal, and also when one
    comes between its check and its wait (ros/actionlib #212)."""

    def __init__(self, server):
        super().__init__(server.lock)
        self.server = server

    def wait(self, timeout=None):
        return self.server.is_new_goal_available() or super().wait()


class _ActionServer(actionlib.ActionServer):

    at_once = False  # whether the next status is urgent

    def __init__(self, *args, **options):
        self.news, self._logging, self._log = collections.deque(), threading.Lock(), threading.Event()
        super().__init__(*args, **options)

    def initialize(self):
        """Without it, a parameter of a wrong type is a TypeError that names no parameter; and the status timer, the
        clients' heartbeat, dies when the clock is set back (rospy/timer.py, Timer.run before 1.17)."""
        ns = rospy.remap_name(self.ns)
        for name, default in (("actionlib_server_pub_queue_size", 50), ("actionlib_server_sub_queue_size", -1),
                              (ns + "/status_frequency", 5.0), (ns + "/status_list_timeout", 5.0),
                              (rospy.search_param("actionlib_status_frequency") or "actionlib_status_frequency", 5.0)):
            get_param(name, default)
        super().initialize()
        need("actionlib", self, "status_timer", "status_frequency", "started", "lock", "status_list")
        self._due = threading.Event()
        for target in self._publish_status_when_due, self._log_after_it:
            threading.Thread(target=target, daemon=True).start()
        if self.status_timer:
            self.status_timer.shutdown()
            self.status_timer = rospy.Timer(
                rospy.Duration(1 / self.status_frequency), lambda _: self._due.set(), reset=True)

    def publish_status(self):
        """Leave it to a thread. Without it, a status goes out to each client before the result that one of them waits
        for (actionlib/server_goal_handle.py, set_cancel_requested)."""
        if self.at_once:
            self.publish_status_now()
        elif not self.active_soon():  # which brings the next one, and to wake the thread takes time
            self._due.set()

    def publish_status_now(self):
        with self.lock:
            self.at_once = False
            self._due.clear()
            if self.started:
                super().publish_status()

    def _publish_status_when_due(self):
        while self._due.wait():
            time.sleep(LATER)
            with self.lock:
                if self._due.is_set():  # still, now that nobody else has the lock
                    self.publish_status_now()
            self._log.set()

    def _log_after_it(self):
        """Without it, a line of log, which takes as long as a message, comes before the first feedback of the goal that
        it tells of. A thread of its own: where init_node was not ours, a stopped terminal stops whoever logs."""
        while self._log.wait():
            self._log.clear()
            self.log_news()

    def log_news(self):
        """Log what waits in news: each goal accepted, each ending (str)."""
        with self._logging:
            while self.news:
                news = self.news.popleft()
                with contextlib.suppress(OSError):  # as does a closed one
                    rospy.loginfo("%s", news if isinstance(news, str) else _accepted(news))

    def stop_status(self):
        """Publish the last one."""
        with self.lock:
            self.publish_status_now()
            self.started = False

    def internal_goal_callback(self, goal):
        """Without it, a goal with the id of a recent one is ignored without a word."""
        with self.lock:
            if any(tracker.goal and tracker.status.goal_id.id == goal.goal_id.id for tracker in self.status_list):
                rospy.logwarn("goal ignored: its id '%.60s' is that of a recent goal", goal.goal_id.id)
            super().internal_goal_callback(goal)


def _accepted(goal):
    fields = ((name, getattr(goal, name)) for name in goal.__slots__)
    plain = ", ".join("%s %.60r" % field for field in fields if isinstance(field[1], (bool, int, float, str)))
    return "goal accepted: " + plain if plain else "goal accepted"
