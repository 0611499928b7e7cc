#!/usr/bin/python3
"""The action server on plain rospy and actionlib."""
import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
import rospy


class ActionServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction), one goal at a time."""

    def __init__(self):
        # auto_start=False: once started it may call execute_cb at any moment, and that needs self.a_server.
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()
        rospy.loginfo("wash_dishes_as waits for goals")

    def execute_cb(self, goal):
        """Wash goal.number_of_minutes bowls, in the server's thread. Each goal ends with one call of set_succeeded,
        set_preempted or set_aborted."""
        if goal.number_of_minutes < 0:
            return self.a_server.set_aborted(text="number_of_minutes is %d, must be 0 or more" % goal.number_of_minutes)
        result = WashTheDishesResult()
        # 1 a second: nothing is really washed, so a minute need not last longer.
        rate = rospy.Rate(1)
        for minute in range(goal.number_of_minutes):
            if self.a_server.is_preempt_requested():
                return self.a_server.set_preempted(result)
            # A robot's own work goes here, in short steps: during a step nothing can stop the goal.
            result.dishes_washed.append("bowl-%d" % minute)
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed="bowl-%d" % minute))
            rate.sleep()
        self.a_server.set_succeeded(result)


if __name__ == "__main__":
    rospy.init_node("plain_action_server")
    ActionServer()
    rospy.spin()
