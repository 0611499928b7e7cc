#!/usr/bin/python3
"""The action server: washes one bowl a second, tells of each, and stops the moment it is asked to."""
import time

import actionlib
import rospy
from rospy.rostime import get_rostime_cond, is_wallclock

from actions_tutorial import steady
from actions_tutorial.msg import (
    WashTheDishesAction, WashTheDishesActionGoal, WashTheDishesFeedback, WashTheDishesResult)

BOWL = rospy.Duration(1)  # s of ROS time that a bowl takes


class ActionServer:
    """Serves wash_dishes_as (actions_tutorial/WashTheDishesAction), one goal at a time: a newer goal preempts it."""

    def __init__(self):
        # rospy notifies this condition at each /clock message and we at each request to stop, so that a wait is an
        # exact one in real and in simulated time, and nothing is polled.
        self.wake = get_rostime_cond()
        self.shutting_down = False
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.register_preempt_callback(self.wake_up)
        rospy.on_shutdown(self.shut_down)
        steady.start(self.a_server, WashTheDishesActionGoal)
        rospy.loginfo("wash_dishes_as waits for goals")

    def execute_cb(self, goal):
        """Serve the goal, and a newer one that came meanwhile: going back for it would cost up to 100 ms, the pause
        that actionlib 1.14 makes between two calls (ros/actionlib #212)."""
        while goal:
            self.wash(goal.number_of_minutes)
            goal = self.a_server.accept_new_goal() if self.a_server.is_new_goal_available() else None

    def wash(self, number_of_minutes):
        """Wash number_of_minutes bowls (int, 0 or more) from now on and end the goal with those that were named."""
        bowls, due = [], rospy.Time.now()
        rospy.loginfo("goal accepted: number_of_minutes %d", number_of_minutes)
        while len(bowls) < number_of_minutes and not self.must_stop():
            bowls.append("bowl-%d" % len(bowls))
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed=bowls[-1]))
            due = self.wait_for_next_bowl(due)
        set_state, why = self.ending(number_of_minutes)
        text = "%s; bowls washed: %d" % (why, len(bowls))
        steady.end_goal(self.a_server, set_state, WashTheDishesResult(dishes_washed=bowls), text)
        rospy.loginfo("goal ended: %s", text)

    def wait_for_next_bowl(self, begun):
        """Wait until a BOWL after begun (rospy.Time) or a request to stop. Returns the time waited for: counting from
        it, and not from now, keeps the schedule free of drift."""
        due = begun + BOWL
        before = begun
        with self.wake:
            while not self.must_stop():
                now = rospy.Time.now()
                if now < before or before.is_zero():  # the clock was set back, or has only now begun: go along
                    due += now - before
                if now >= due:
                    break
                before = now
                self.wake.wait((due - now).to_sec() if is_wallclock() else None)
        return due

    def ending(self, number_of_minutes):
        """Returns how the goal ends (a function) and why (str)."""
        if number_of_minutes < 0:
            return self.a_server.set_aborted, "number_of_minutes is %d, allowed is 0 or more" % number_of_minutes
        if self.shutting_down:
            return self.a_server.set_aborted, "the server is shutting down"
        if self.a_server.is_new_goal_available():
            return self.a_server.set_preempted, "a newer goal came"
        if self.a_server.is_preempt_requested():
            return self.a_server.set_preempted, "cancelled"
        return self.a_server.set_succeeded, "all done"

    def must_stop(self):
        return self.shutting_down or self.a_server.is_preempt_requested()

    def wake_up(self):
        with self.wake:
            self.wake.notify_all()

    def shut_down(self):
        """End the goal while messages still go out (at most 1 s), then let rospy close the node."""
        self.shutting_down = True
        self.wake_up()
        limit = time.monotonic() + 1
        while (self.a_server.is_active() or self.a_server.is_new_goal_available()) and time.monotonic() < limit:
            time.sleep(0.01)
        time.sleep(0.1)  # rospy sends from a thread of its own and cannot be asked when it is done


if __name__ == "__main__":
    try:
        steady.init_node("action_server")
        ActionServer()
        rospy.spin()
    except rospy.ROSException:  # shut down before it was up
        pass
    steady.leave(0)
