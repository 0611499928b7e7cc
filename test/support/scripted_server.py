"""A node that serves the action `scripted` (actionlib/TestRequest) on its five topics as the goals say.

result_text of a goal is its script: words that are carried out in turn, in a thread of its own.

| word | what the node does |
| --- | --- |
| ACTIVE, PREEMPTING … (a state) | publishes a status that lists the goal so |
| result:SUCCEEDED … (a state) | publishes a result: that state, the_result of the goal |
| | Its text is "by script", or "cancelled" if a cancel of the goal has come |
| feedback | publishes feedback |
| others | publishes a status that lists another goal only |
| unlisted | lists the goal no longer |
| silent | publishes no status of its own accord, which it does ten times a second, until the next goal |
| cancel | waits until a cancel of the goal comes |
| go | waits for a message on the topic scripted/go that names the goal |
| text:no_soap | gives what follows another text, with a line break for each _ |
| 0.5 | sleeps so many seconds |
"""
import threading
import time

from actionlib.msg import TestRequestActionFeedback, TestRequestActionGoal, TestRequestActionResult
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
import rospy
from std_msgs.msg import String

RUNNING = GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING


class ScriptedServer:

    def __init__(self, name="scripted"):
        self.listed, self.cancelled, self.went, self.beats = {}, set(), [], True  # listed: {id: GoalStatus}
        self.changed = threading.Condition()
        self.status_pub = rospy.Publisher(name + "/status", GoalStatusArray, queue_size=1000, latch=True)
        self.result_pub = rospy.Publisher(name + "/result", TestRequestActionResult, queue_size=1000)
        self.feedback_pub = rospy.Publisher(name + "/feedback", TestRequestActionFeedback, queue_size=1000)
        rospy.Subscriber(name + "/goal", TestRequestActionGoal, self.on_goal)
        rospy.Subscriber(name + "/cancel", GoalID, self.on_cancel)
        rospy.Subscriber(name + "/go", String, self.on_go)
        self.publish_status()
        rospy.Timer(rospy.Duration(0.1), lambda _: self.beats and self.publish_status())

    def on_goal(self, goal):
        with self.changed:
            self.beats = True  # whatever the goal before has left
            self.listed = {one: status for one, status in self.listed.items() if status.status in RUNNING}
        threading.Thread(target=self.run, args=[goal], daemon=True).start()

    def on_cancel(self, goal_id):
        with self.changed:
            self.cancelled.add(goal_id.id)
            self.changed.notify_all()

    def on_go(self, message):
        with self.changed:
            self.went.append(message.data)
            self.changed.notify_all()

    def publish_status(self, *statuses):
        with self.changed:
            message = GoalStatusArray(status_list=list(statuses or self.listed.values()))
            message.header.stamp = rospy.Time.now()
            self.status_pub.publish(message)

    def run(self, message):
        """Carry out a goal's script."""
        goal_id, text, goes = message.goal_id, "by script", 0
        for word in message.goal.result_text.split():
            kind, _, state = word.rpartition(":")
            if word == "feedback":
                self.feedback_pub.publish(TestRequestActionFeedback(
                    status=self.listed.get(goal_id.id) or GoalStatus(goal_id=goal_id, status=GoalStatus.ACTIVE)))
            elif word == "others":
                self.publish_status(GoalStatus(goal_id=GoalID(id="another"), status=GoalStatus.ACTIVE))
            elif word == "unlisted":
                self.listed.pop(goal_id.id, None)
                self.publish_status()
            elif word == "silent":
                self.beats = False
            elif word in ("cancel", "go"):
                goes += word == "go"
                with self.changed:
                    self.changed.wait_for(lambda: goal_id.id in self.cancelled if word == "cancel" else
                                          self.went.count(goal_id.id) >= goes)
            elif kind == "text":
                text = state.replace("_", "\n")
            elif state.isupper():
                status = GoalStatus(goal_id=goal_id, status=getattr(GoalStatus, state), text=text)
                if kind == "result":
                    status.text = "cancelled" if goal_id.id in self.cancelled else text
                    result = TestRequestActionResult(status=status)
                    result.result.the_result = message.goal.the_result
                    self.result_pub.publish(result)
                else:
                    self.listed[goal_id.id] = status
                    self.publish_status()
            else:
                time.sleep(float(word))


if __name__ == "__main__":
    rospy.init_node("scripted_server")
    ScriptedServer()
    rospy.spin()
