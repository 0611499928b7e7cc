#!/usr/bin/python3
"""The floor: a bare node that answers a message with a message, no actionlib: what two topic hops cost."""
import rospy
from actionlib_msgs.msg import GoalStatus

from actions_tutorial.msg import WashTheDishesActionGoal, WashTheDishesActionResult


def main():
    rospy.init_node("floor")
    # 50: as actionlib does, so that both send by the same path through rospy
    result = rospy.Publisher("wash_dishes_as/result", WashTheDishesActionResult, queue_size=50)
    rospy.Subscriber("wash_dishes_as/goal", WashTheDishesActionGoal, lambda goal: result.publish(
        WashTheDishesActionResult(status=GoalStatus(goal_id=goal.goal_id, text="answered"))))
    rospy.spin()


if __name__ == "__main__":
    main()
