#!/usr/bin/env python3
"""The action server from the posts: washes dishes, one bowl a second."""
import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
import rospy


class ActionServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction), one goal at a time."""

    def __init__(self):
        # auto_start=False: execute_cb uses self.a_server, so no goal may arrive before it is set.
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()
        rospy.loginfo("wash_dishes_as waits for goals")

    def execute_cb(self, goal):
        """Wash goal.number_of_minutes bowls. Called in a thread of its own, with one goal at a time."""
        if goal.number_of_minutes < 0:
            self.a_server.set_aborted(text="number_of_minutes is %d, must be 0 or more" % goal.number_of_minutes)
            return
        result = WashTheDishesResult()  # a new one for each goal: two goals must not share a message
        feedback = WashTheDishesFeedback()
        rate = rospy.Rate(1)  # once a second: a "minute" lasts a second here, to save time
        for minute in range(goal.number_of_minutes):
            if self.a_server.is_preempt_requested():  # a cancel or a newer goal
                self.a_server.set_preempted(result)
                return
            # The robot's own work goes here, in short steps: during a step nothing can stop the goal.
            feedback.last_dish_washed = "bowl-%d" % minute
            result.dishes_washed.append(feedback.last_dish_washed)
            self.a_server.publish_feedback(feedback)
            rate.sleep()
        self.a_server.set_succeeded(result)


if __name__ == "__main__":
    rospy.init_node("action_server")
    ActionServer()
    rospy.spin()
