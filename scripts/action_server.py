#!/usr/bin/python3
"""plain_action_server.py, mended: it stops at once, and ends every goal."""
from actions_tutorial import robust  # first, or an early Ctrl-C leaves a traceback
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
import rospy


class ActionServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction), one goal at a time."""

    def __init__(self):
        # auto_start=False: once started it may call execute_cb at any moment, and that needs self.a_server.
        self.a_server = robust.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.start()

    def execute_cb(self, goal):
        """Wash goal.number_of_minutes bowls, in the server's thread. Each goal ends with one call of set_succeeded,
        set_preempted or set_aborted."""
        if goal.number_of_minutes < 0:
            return self.a_server.set_aborted(text="number_of_minutes is %d, must be 0 or more" % goal.number_of_minutes)
        result = WashTheDishesResult()
        # 1 a second: nothing is really washed, so a minute need not last longer.
        rate = self.a_server.rate(1)  # robust's own: a stop ends its sleep()
        for minute in range(goal.number_of_minutes):
            # A robot's own work goes here, in short steps: during a step nothing can stop the goal.
            result.dishes_washed.append("bowl-%d" % minute)
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed="bowl-%d" % minute))
            if not rate.sleep():  # a cancel, a newer goal or Ctrl-C
                return self.a_server.set_preempted(result)
        self.a_server.set_succeeded(result)


if __name__ == "__main__":
    robust.init_node("action_server")
    ActionServer()
    rospy.spin()
