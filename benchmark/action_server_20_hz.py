#!/usr/bin/env python3
"""scripts/action_server.py, but it looks for a cancel 20 times a second while a bowl still takes a second."""
import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
import rospy


class ActionServer:

    def __init__(self):
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()

    def execute_cb(self, goal):
        result = WashTheDishesResult()
        feedback = WashTheDishesFeedback()
        rate = rospy.Rate(20)
        for minute in range(goal.number_of_minutes):
            feedback.last_dish_washed = "bowl-%d" % minute
            result.dishes_washed.append(feedback.last_dish_washed)
            self.a_server.publish_feedback(feedback)
            for _ in range(20):
                rate.sleep()
                if self.a_server.is_preempt_requested():
                    self.a_server.set_preempted(result)
                    return
        self.a_server.set_succeeded(result)


if __name__ == "__main__":
    rospy.init_node("action_server_20_hz")
    ActionServer()
    rospy.spin()
