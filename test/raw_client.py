"""A client of bare topics: sends goals and cancels as raw messages, and keeps all that comes back."""
import itertools
import threading
import time
import xmlrpc.client

import rosgraph
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from actions_tutorial.msg import WashTheDishesActionFeedback, WashTheDishesActionGoal, WashTheDishesActionResult

from processes import eventually

PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, RECALLED, PREEMPTING = (
    GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED,
    GoalStatus.RECALLED, GoalStatus.PREEMPTING)
NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}
ENDINGS = {PREEMPTED, SUCCEEDED, ABORTED, RECALLED, GoalStatus.REJECTED}


class RawClient:
    """The clients of wash_dishes_as in a namespace (str); topics: those that the other end has. feedback, results: goal
    id -> its messages; states: goal id -> [status numbers in the order seen]; times: (goal id, "sent", status number,
    bowl or "result") -> time.monotonic() of the first one; shown: (goal id, status number) -> stamp of the first status
    that showed it; active_at_once: the most goals that one status showed as ACTIVE or PREEMPTING."""

    _numbers = itertools.count()

    def __init__(self, namespace="", topics=("goal", "cancel", "feedback", "result", "status")):
        self.namespace, self.action, self.news = namespace, namespace + "/wash_dishes_as/", threading.Condition()
        self.status = GoalStatusArray()
        self.forget()
        self.publishers = {
            topic: rospy.Publisher(self.action + topic, kind, queue_size=1000)
            for topic, kind in (("goal", WashTheDishesActionGoal), ("cancel", GoalID)) if topic in topics}
        self._subscribers = {
            topic: rospy.Subscriber(self.action + topic, kind, callback)
            for topic, kind, callback in (("feedback", WashTheDishesActionFeedback, self.on_feedback),
                                          ("result", WashTheDishesActionResult, self.on_result),
                                          ("status", GoalStatusArray, self.on_status)) if topic in topics}

    def forget(self):
        """Begin with nothing, as a new one."""
        with self.news:
            self.feedback, self.results, self.states, self.times, self.shown = {}, {}, {}, {}, {}
            self.active_at_once = 0

    def close(self):
        for end in [*self.publishers.values(), *self._subscribers.values()]:
            end.unregister()

    def connected(self):
        """Whether goals and cancels reach the server, and its messages us. Each publisher tells for its own topics, as
        does the server here: a subscriber counts a connection before it is one, and what is sent by then is lost."""
        me, ends = rospy.get_name(), [*self.publishers.values(), *self._subscribers.values()]
        if not all(end.get_num_connections() for end in ends):
            return False
        try:
            master = rosgraph.Master(me)
            server, = dict(master.getSystemState()[0])[self.action + "result"]
            connections = xmlrpc.client.ServerProxy(master.lookupNode(server)).getBusInfo(me)[2]
        except (KeyError, ValueError, rosgraph.MasterError, OSError):  # none, several, or one that has just ended
            return False
        return {topic for _, to, way, _, topic, *_ in connections if (to, way) == (me, "o")} >= {
            self.action + topic for topic in self._subscribers}

    def wait_connected(self, *processes):
        """Wait until all messages go both ways, between us and the server among the processes if given. -> self"""
        eventually(self.connected, "a server of %s, connected both ways" % self.action, self, *processes)
        return self

    def send(self, number_of_minutes, goal_id=None, stamp=None):
        """Send a goal (int; stamp: rospy.Time, now unless given). Returns its id (str)."""
        goal = WashTheDishesActionGoal()
        goal.goal.number_of_minutes = number_of_minutes
        goal.goal_id.id = "%s-%d" % (rospy.get_name(), next(self._numbers)) if goal_id is None else goal_id
        goal.goal_id.stamp = rospy.Time.now() if stamp is None else stamp
        self.times[goal.goal_id.id, "sent"] = time.monotonic()
        self.publishers["goal"].publish(goal)
        return goal.goal_id.id

    def cancel(self, goal_id="", stamp=rospy.Time()):
        """Send a cancel: of one goal, of all (no id, no stamp), or of all up to stamp."""
        self.publishers["cancel"].publish(GoalID(id=goal_id, stamp=stamp))

    def wait(self, condition, what, timeout=50):
        """Wait until condition() is true, and return its value. AssertionError with what and all that came."""
        return eventually(condition, what, self, timeout=timeout, news=self.news, pause=0.1)

    def wait_bowls(self, goal_id, count):
        """Wait for count bowls of feedback. Returns [WashTheDishesActionFeedback]."""
        self.wait(lambda: len(self.feedback.get(goal_id, [])) >= count, "%d bowls of %s" % (count, goal_id))
        return self.feedback[goal_id]

    def wait_result(self, goal_id=None):
        """Wait for the ending of a goal, of the first one that ends unless given. -> WashTheDishesActionResult"""
        if goal_id is None:
            goal_id = self.wait(lambda: list(self.results), "a result")[0]
        self.wait(lambda: self.results.get(goal_id) and self.ended(goal_id),
                  "a result of %.60s, and its ending in the status" % goal_id)
        assert len(self.results[goal_id]) == 1, "expected one result of %.60s, came: %s" % (goal_id, self)
        return self.results[goal_id][0]

    def ended(self, goal_id):
        """Whether the status has shown the goal's end."""
        return ENDINGS & set(self.states.get(goal_id, []))

    def check_ending(self, goal_id, state, washed):
        """Expect one result, with that state (int) and those bowls ([str]), and feedback that names the same."""
        result = self.wait_result(goal_id)
        assert (result.status.status, result.result.dishes_washed) == (state, washed), \
            "expected %.60s to end %s with %s, came: %s" % (goal_id, NAMES[state], washed, self)
        self.wait(lambda: self.bowls_of(goal_id) == washed, "feedback of %s for %.60s" % (washed, goal_id))
        return result

    def bowls_of(self, goal_id):
        """The bowls that feedback has named so far."""
        return [message.feedback.last_dish_washed for message in self.feedback.get(goal_id, [])]

    def on_feedback(self, message):
        self._keep(self.feedback, message, message.feedback.last_dish_washed)

    def on_result(self, message):
        self._keep(self.results, message, "result")

    def _keep(self, where, message, event):
        now, goal_id = time.monotonic(), message.status.goal_id.id
        with self.news:
            self.times.setdefault((goal_id, event), now)
            where.setdefault(goal_id, []).append(message)
            self.news.notify_all()

    def on_status(self, message):
        now = time.monotonic()
        with self.news:
            self.status = message
            for status in message.status_list:
                seen = self.states.setdefault(status.goal_id.id, [])
                if status.status not in seen[-1:]:
                    self.times.setdefault((status.goal_id.id, status.status), now)
                    self.shown.setdefault((status.goal_id.id, status.status), message.header.stamp)
                    seen.append(status.status)
            active = [status for status in message.status_list if status.status in (ACTIVE, PREEMPTING)]
            self.active_at_once = max(self.active_at_once, len(active))
            self.news.notify_all()

    def __str__(self):
        with self.news:
            last = list(dict.fromkeys([*self.states, *self.feedback, *self.results]))[-5:]
            return "\n".join("%.60s: states %s, bowls %s, results %s" % (
                goal_id, [NAMES[state] for state in self.states.get(goal_id, [])], self.bowls_of(goal_id),
                [(NAMES[one.status.status], one.status.text, one.result.dishes_washed)
                 for one in self.results.get(goal_id, [])]) for goal_id in last) or "no goal in any message"
