"""An action server of bare publishers and subscribers, which sends a client what it is told to, in any order."""
import itertools
import os
import threading

import actionlib
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray

from raw_client import NAMES
from actions_tutorial import robust
from actions_tutorial.msg import (
    WashTheDishesAction, WashTheDishesActionFeedback, WashTheDishesActionGoal, WashTheDishesActionResult,
    WashTheDishesFeedback, WashTheDishesGoal, WashTheDishesResult)
from processes import bowls, eventually

PLAIN = os.environ.get("ACTIONLIB") == "plain"  # try the same on actionlib itself
library = actionlib if PLAIN else robust
PATIENCE = rospy.Duration(50)
KINDS = dict(status=GoalStatusArray, result=WashTheDishesActionResult, feedback=WashTheDishesActionFeedback)


def client_of(action, **options):
    """Returns a client of the library that is tried. It does not fear a slow machine, unless its options say so."""
    return library.SimpleActionClient(
        action, WashTheDishesAction, **({} if PLAIN else dict({"heartbeat_timeout": 60.0}, **options)))


class RawServer:
    """Serves action (str) to client, which is made here and has heard what is sent when the call returns: rospy calls a
    topic's subscribers in their order, ours last. With wait=False, for a callback that blocks, it may not have. goals:
    those that came, also again; cancels: ids; done: [(state, bowls)], fed: [bowl], active: [True], by its callbacks."""

    _numbers = itertools.count()

    def __init__(self, action, **options):
        self.action, self.goals, self.cancels, self.done, self.fed, self.active = action, [], [], [], [], []
        self.client, self.publishers, self._heard, self._sent = client_of(action, **options), {}, set(), []
        for topic in KINDS:
            self.publish(topic)
        self._subscribers = [rospy.Subscriber("%s/%s" % (action, topic), kind, callback) for topic, kind, callback in (
            *((topic, kind, lambda one: self._heard.add(one.header.frame_id)) for topic, kind in KINDS.items()),
            ("goal", WashTheDishesActionGoal, self.goals.append),
            ("cancel", GoalID, lambda one: self.cancels.append(one.id)))]
        self.status()
        assert self.client.wait_for_server(PATIENCE), "expected to be found: %s" % self

    def publish(self, topic):
        """From now on, or again after its unregister()."""
        self.publishers[topic] = rospy.Publisher(
            "%s/%s" % (self.action, topic), KINDS[topic], queue_size=1000, latch=topic == "status")

    def stop(self):
        self.client.stop_tracking_goal()
        self.client.action_client.stop()
        for end in [*self.publishers.values(), *self._subscribers]:
            end.unregister()

    def eventually(self, condition, what, timeout=50):
        return eventually(condition, what, self, timeout=timeout, pause=0.004)

    @property
    def ids(self):
        """Those of the goals, each once."""
        return list(dict.fromkeys(goal.goal_id.id for goal in self.goals))

    def send(self, minutes=1, **callbacks):
        """Have the client send a goal, with callbacks that keep what they hear unless given, and wait until it is here.
        Returns its id (str)."""
        self.client.send_goal(WashTheDishesGoal(minutes), **dict(dict(
            done_cb=self.hear_done, active_cb=lambda: self.active.append(True), feedback_cb=self.hear_feedback),
            **callbacks))
        goal_id = self.client.gh.comm_state_machine.action_goal.goal_id.id
        self.eventually(lambda: goal_id in self.ids, "a goal that comes")
        return goal_id

    def while_sending(self, act):
        """Have a thread call act() while the client sends its next goal, which takes as long, or a second if act has to
        wait for that."""
        publish, thread = self.client.action_client.pub_goal.publish, threading.Thread(target=act, daemon=True)

        def send(goal):
            publish(goal)
            if not thread.ident:  # else the same goal once more, or another
                thread.start()
                thread.join(1)

        self.client.action_client.manager.register_send_goal_fn(send)

    def hear_done(self, state, result):
        self.done.append((state, result and result.dishes_washed))

    def hear_feedback(self, feedback):
        self.fed.append(feedback.last_dish_washed)

    def status(self, *goals, wait=True):
        """Send a status that lists goals, each (id, state)."""
        self._send("status", wait, status_list=[
            GoalStatus(goal_id=GoalID(id=goal_id), status=state) for goal_id, state in goals])

    def feedback(self, goal_id, bowl, wait=True):
        self._send("feedback", wait, status=GoalStatus(goal_id=GoalID(id=goal_id), status=GoalStatus.ACTIVE),
                   feedback=WashTheDishesFeedback(bowl))

    def result(self, goal_id, state=GoalStatus.SUCCEEDED, count=1, wait=True, text=""):
        """End a goal with count bowls."""
        self._send("result", wait, status=GoalStatus(GoalID(id=goal_id), state, text),
                   result=WashTheDishesResult(bowls(count)))

    def _send(self, topic, wait, **fields):
        message, number = KINDS[topic](**fields), str(next(self._numbers))
        message.header.frame_id, message.header.stamp = number, rospy.Time.now()
        self._sent.append("%s %s" % (topic, [(one.goal_id.id, NAMES[one.status]) for one in (
            message.status_list if topic == "status" else [message.status])]))
        self.publishers[topic].publish(message)
        if wait:
            self.eventually(lambda: number in self._heard, "message %s (%s) to be heard" % (number, topic))

    def __str__(self):
        client = self.client
        return "%s\ncame: goals %s, cancels %s\nsent: %s\nheard: done %s, fed %s, active %s\nclient: %s" % (
            self.action, [one.goal_id.id for one in self.goals], self.cancels, "; ".join(self._sent[-20:]),
            self.done, self.fed, len(self.active), client.gh and (NAMES[client.get_state()], client.get_result()))
