#!/usr/bin/python3
"""The action server: washes one bowl a second, reports each one, and stops as soon as it is asked to."""
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
from actions_tutorial import robust  # rospy's and actionlib's calls, made robust; before rospy, so that Ctrl-C is quiet
import rospy


class ActionServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction), one goal at a time.

    To preempt a goal is to ask it to stop before it is done: a cancel does, a newer goal, and a shutdown.
    """

    def __init__(self):
        # actionlib.SimpleActionServer and a little more: rate(), and shutdown preempts the goal, too.
        self.a_server = robust.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()
        rospy.loginfo("wash_dishes_as waits for goals")

    def execute_cb(self, goal):
        """Wash goal.number_of_minutes bowls, one a second, in the server's thread. Each goal ends with one call of
        set_succeeded, set_preempted or set_aborted, and with the bowls so far."""
        result = WashTheDishesResult()
        if goal.number_of_minutes < 0:
            self.a_server.set_aborted(result, "number_of_minutes is %d, must be 0 or more" % goal.number_of_minutes)
            return
        rate = self.a_server.rate(1)  # a rospy.Rate whose sleep() a cancel, a newer goal or a shutdown ends
        for minute in range(goal.number_of_minutes):
            if self.a_server.is_preempt_requested():
                self.a_server.set_preempted(result)
                return
            # A robot's work goes here, in short steps. Whatever blocks, such as rospy.sleep or a long call, delays a
            # cancel: that has to wait until the step is over.
            result.dishes_washed.append("bowl-%d" % minute)
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed=result.dishes_washed[-1]))
            rate.sleep()
        if self.a_server.is_preempt_requested():  # during the last second
            self.a_server.set_preempted(result)
            return
        self.a_server.set_succeeded(result)


if __name__ == "__main__":
    robust.init_node("action_server")
    ActionServer()
    rospy.spin()
