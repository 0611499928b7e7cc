"""A client of the five topics of an action, without actionlib."""
import itertools
import threading
import time
import uuid
import xmlrpc.client

from actionlib_msgs.msg import GoalID, GoalStatusArray
from actions_tutorial import msg
import rosgraph
import rospy

from support.processes import eventually
from support.states import ACTIVE, NAMES, PREEMPTING, TERMINAL


def server_of(action):
    """Returns the node (xmlrpc.client.ServerProxy) that serves action (str, with a slash at its end). Raises KeyError
    or ValueError if there is none or several."""
    master = rosgraph.Master(rospy.get_name())
    server, = dict(master.getSystemState()[0])[action + "result"]
    return xmlrpc.client.ServerProxy(master.lookupNode(server))


def sends_here(action, topics=("feedback", "result", "status")):
    """Returns whether the server of action (str, with a slash at its end) sends those topics to this node. It is asked
    itself: a subscriber counts a connection before it is one, and messages sent by then are lost."""
    me = rospy.get_name()
    try:
        connections = server_of(action).getBusInfo(me)[2]
    except (KeyError, ValueError, rosgraph.MasterError, OSError):  # none, several, or one that has just ended
        return False
    return {topic for _, to, way, _, topic, *_ in connections if (to, way) == (me, "o")} >= {
        action + topic for topic in topics}


def wait_connected(client, ns="wash_dishes_as"):
    """Wait until the messages of a client (SimpleActionClient) go both ways. ns: the action's name."""
    assert client.wait_for_server(rospy.Duration(50)), "expected a server of %s" % ns
    eventually(lambda: sends_here(rospy.resolve_name(ns) + "/"), "a server of %s that sends to this node" % ns)


class RawClient:
    """Sends goals and cancels of wash_dishes_as as plain messages, and keeps all that comes from the server.

    namespace: the server's (str). topics: those that the server has. feedback, results: {goal id: [message]};
    states: {goal id: [status number, in the order seen]}; times: {(goal id, "sent", status number, bowl or "result"):
    time.monotonic() of the first}; active_at_once: the most goals that one status showed as ACTIVE or PREEMPTING.
    """

    _numbers = itertools.count()

    def __init__(self, namespace="", topics=("goal", "cancel", "feedback", "result", "status")):
        self.namespace, self.action, self.changed = namespace, namespace + "/wash_dishes_as/", threading.Condition()
        self.feedback, self.results, self.states, self.times, self.active_at_once = {}, {}, {}, {}, 0
        self.status, self._goal = GoalStatusArray(), msg.WashTheDishesActionGoal
        self.publishers = {topic: rospy.Publisher(self.action + topic, kind, queue_size=1000) for topic, kind in (
            ("goal", msg.WashTheDishesActionGoal), ("cancel", GoalID)) if topic in topics}
        self.subscribers = {topic: rospy.Subscriber(self.action + topic, kind, callback) for topic, kind, callback in (
            ("feedback", msg.WashTheDishesActionFeedback, self._on_feedback),
            ("result", msg.WashTheDishesActionResult, self._on_result),
            ("status", GoalStatusArray, self._on_status)) if topic in topics}

    def close(self):
        for end in [*self.publishers.values(), *self.subscribers.values()]:
            end.unregister()

    def connected(self):
        """Returns whether messages go both ways."""
        ends = [*self.publishers.values(), *self.subscribers.values()]
        return all(end.get_num_connections() for end in ends) and sends_here(self.action, self.subscribers)

    def wait_connected(self, *processes):
        """Wait until messages go both ways. processes: shown if they do not. -> self"""
        eventually(self.connected, "a server of %s, connected both ways" % self.action, self, *processes)
        return self

    def new_id(self):
        """Returns an id that no goal has, not even one of an earlier test that the server still knows."""
        return "%s-%d-%s" % (rospy.get_name(), next(self._numbers), uuid.uuid4().hex[:8])

    def send(self, number_of_minutes, goal_id=None, stamp=None):
        """Send a goal (int; stamp: rospy.Time, by default now). Returns its id (str)."""
        goal = self._goal()
        goal.goal.number_of_minutes = number_of_minutes
        goal.goal_id.id = self.new_id() if goal_id is None else goal_id
        goal.goal_id.stamp = rospy.Time.now() if stamp is None else stamp
        self.times[goal.goal_id.id, "sent"] = time.monotonic()
        self.publishers["goal"].publish(goal)
        return goal.goal_id.id

    def cancel(self, goal_id="", stamp=rospy.Time()):
        """Send a cancel: of one goal, of all (no id, no stamp), or of all up to stamp."""
        self.publishers["cancel"].publish(GoalID(id=goal_id, stamp=stamp))

    def wait(self, condition, what, timeout=50):
        """Wait until condition() is true. Returns its value; AssertionError with what (str) and all that came."""
        return eventually(condition, what, self, timeout=timeout, changed=self.changed, pause=0.1)

    def wait_bowls(self, goal_id, count):
        """Wait for count bowls of feedback."""
        self.wait(lambda: len(self.bowls_of(goal_id)) >= count, "%d bowls of %s" % (count, goal_id))

    def wait_result(self, goal_id):
        """Wait for the result of a goal and its terminal state in the status. -> WashTheDishesActionResult"""
        self.wait(lambda: self.results.get(goal_id) and TERMINAL & set(self.states.get(goal_id, [])),
                  "a result of %s, and its terminal state in the status" % goal_id)
        assert len(self.results[goal_id]) == 1, "expected one result of %s: %s" % (goal_id, self)
        return self.results[goal_id][0]

    def check_outcome(self, goal_id, state, washed):
        """Expect one result, with that state (int) and those bowls (list of str), and feedback that names the same."""
        result = self.wait_result(goal_id)
        assert (result.status.status, result.result.dishes_washed) == (state, washed), \
            "expected %s %s with %s: %s" % (goal_id, NAMES[state], washed, self)
        self.wait(lambda: self.bowls_of(goal_id) == washed, "feedback of %s for %s" % (washed, goal_id), timeout=10)
        return result

    def bowls_of(self, goal_id):
        """Returns the bowls that feedback has named so far."""
        return [message.feedback.last_dish_washed for message in self.feedback.get(goal_id, [])]

    def _on_feedback(self, message):
        self._keep(self.feedback, message, message.feedback.last_dish_washed)

    def _on_result(self, message):
        self._keep(self.results, message, "result")

    def _keep(self, where, message, event):
        now, goal_id = time.monotonic(), message.status.goal_id.id
        with self.changed:
            self.times.setdefault((goal_id, event), now)
            where.setdefault(goal_id, []).append(message)
            self.changed.notify_all()

    def _on_status(self, message):
        now = time.monotonic()
        with self.changed:
            self.status = message
            for status in message.status_list:
                seen = self.states.setdefault(status.goal_id.id, [])
                if status.status not in seen[-1:]:
                    self.times.setdefault((status.goal_id.id, status.status), now)
                    seen.append(status.status)
            self.active_at_once = max(self.active_at_once, sum(
                status.status in (ACTIVE, PREEMPTING) for status in message.status_list))
            self.changed.notify_all()

    def __str__(self):
        with self.changed:
            last = list(dict.fromkeys([*self.states, *self.feedback, *self.results]))[-5:]
            lines = ["last status of %.2f s" % self.status.header.stamp.to_sec()]
            return "\n".join(lines + ["%s: states %s, bowls %s, results %s" % (
                goal_id, [NAMES[state] for state in self.states.get(goal_id, [])], self.bowls_of(goal_id),
                [(NAMES[one.status.status], one.status.text, one.result.dishes_washed)
                 for one in self.results.get(goal_id, [])]) for goal_id in last])
