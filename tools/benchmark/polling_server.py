#!/usr/bin/python3
"""What scripts/action_server.py is measured against: the same action, and a cancel looked for once a second."""
import actionlib
import rospy

from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult


class PollingServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction)."""

    def __init__(self):
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()

    def execute_cb(self, goal):
        rate = rospy.Rate(1)
        bowls = []
        while len(bowls) < goal.number_of_minutes:
            if self.a_server.is_preempt_requested():
                self.a_server.set_preempted(WashTheDishesResult(dishes_washed=bowls))
                return
            bowls.append("bowl-%d" % len(bowls))
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed=bowls[-1]))
            rate.sleep()
        self.a_server.set_succeeded(WashTheDishesResult(dishes_washed=bowls))


if __name__ == "__main__":
    rospy.init_node("polling_server")
    PollingServer()
    rospy.spin()
