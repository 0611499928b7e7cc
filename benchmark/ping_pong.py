#!/usr/bin/env python3
"""The floor: a node that answers each message with a message, without actionlib."""
from actionlib_msgs.msg import GoalStatus
from actions_tutorial.msg import WashTheDishesActionGoal, WashTheDishesActionResult
import rospy

if __name__ == "__main__":
    rospy.init_node("floor")
    result = rospy.Publisher("wash_dishes_as/result", WashTheDishesActionResult, queue_size=50)  # as actionlib's
    rospy.Subscriber("wash_dishes_as/goal", WashTheDishesActionGoal, lambda goal: result.publish(
        WashTheDishesActionResult(status=GoalStatus(goal_id=goal.goal_id))))
    rospy.spin()
