#!/usr/bin/python3
"""The action server: washes one bowl a second, tells of each, and stops the moment it is asked to."""
import os
import signal
import threading
import time

import actionlib
import rospy
from rospy.impl.paramserver import get_param_server_cache
from rospy.impl.tcpros_base import init_tcpros_server
from rospy.rostime import get_rostime_cond, is_wallclock

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
        rospy.Subscriber(
            rospy.remap_name("wash_dishes_as") + "/goal", WashTheDishesActionGoal, self.warn_of_repeated_id)
        self.a_server = actionlib.SimpleActionServer(
            "wash_dishes_as", WashTheDishesAction, execute_cb=self.execute_cb, auto_start=False)
        self.a_server.register_preempt_callback(self.wake_up)
        rospy.on_shutdown(self.shut_down)
        self.a_server.start()
        self.survive_clock_set_back()
        self.survive_silent_peers()
        rospy.loginfo("wash_dishes_as waits for goals")

    def execute_cb(self, goal):
        """Serve the goal, and a newer one that came meanwhile: going back for it would cost up to 100 ms, the pause
        that actionlib 1.14 makes between two calls (ros/actionlib #212)."""
        while goal:
            self.wash(goal.number_of_minutes)
            self.forget_goal()
            goal = self.a_server.accept_new_goal() if self.a_server.is_new_goal_available() else None

    def wash(self, number_of_minutes):
        """Wash number_of_minutes bowls (int, 0 or more) from now on and end the goal with those that were named."""
        bowls, due = [], rospy.Time.now()
        rospy.loginfo("goal accepted: number_of_minutes %d", number_of_minutes)
        while len(bowls) < number_of_minutes and not self.must_stop():
            bowls.append("bowl-%d" % len(bowls))
            self.a_server.publish_feedback(WashTheDishesFeedback(last_dish_washed=bowls[-1]))
            due = self.wait_for_next_bowl(due)
        end_goal, why = self.ending(number_of_minutes)
        text = "%s; bowls washed: %d" % (why, len(bowls))
        # Logged first: a client that answers the result at once finds the server waiting for its next goal.
        rospy.loginfo("goal ended: %s", text)
        end_goal(WashTheDishesResult(dishes_washed=bowls), text)

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

    # The rest mends what the libraries leave open.

    def forget_goal(self):
        """SimpleActionServer refuses a goal with a stamp older than its last one's, even after that has ended: one
        stamp from the future, or a clock set back, and it would serve nobody any more."""
        with self.a_server.action_server.lock, self.a_server.lock:
            if not self.a_server.is_new_goal_available():
                self.a_server.current_goal = self.a_server.next_goal = actionlib.ServerGoalHandle()

    def warn_of_repeated_id(self, goal):
        """actionlib ignores a goal with the id of a recent one, without a word."""
        with self.a_server.action_server.lock:
            known = [tracker.status.goal_id.id for tracker in self.a_server.action_server.status_list if tracker.goal]
        if goal.goal_id.id in known:
            rospy.logwarn("goal ignored: its id '%.60s' is that of a recent goal", goal.goal_id.id)

    def survive_clock_set_back(self):
        """actionlib's status timer, the clients' heartbeat, dies when the ROS clock is set back; this one goes on."""
        server = self.a_server.action_server
        if server.status_timer:
            server.status_timer.shutdown()
            server.status_timer = rospy.Timer(
                rospy.Duration(1 / server.status_frequency), server.publish_status_async, reset=True)

    @staticmethod
    def survive_silent_peers():
        """rospy reads the first bytes of a connection before it accepts the next one: a peer that connects and says
        nothing would lock all others out. Each gets a thread here."""
        tcp_server = init_tcpros_server().tcp_ros_server  # the one that is there
        handle = tcp_server.inbound_handler
        tcp_server.inbound_handler = lambda *peer: threading.Thread(target=handle, args=peer, daemon=True).start()


def log_without_the_master():
    """rospy asks the master at each line of log whether to list the node's topics with it; say now that it need not.

    A master that does not answer would stop the node. And when a newer node takes our name, the question of our last
    line takes it back: the master shuts down the newer one, too.
    """
    key = "/rosout_disable_topics_generation"
    get_param_server_cache().set(key, rospy.get_param(key, False))


def interrupt(*_):
    """Ctrl-C. rospy's own handler calls the master from the main thread, which may be in the midst of a call to it,
    and so would wait for itself for ever."""
    threading.Thread(target=rospy.signal_shutdown, args=["interrupted"]).start()
    # Closing the node asks the master: one that does not answer must not keep the process.
    watchdog = threading.Timer(1.8, os._exit, [0])
    watchdog.daemon = True
    watchdog.start()


if __name__ == "__main__":
    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    try:
        rospy.init_node("action_server", disable_signals=True)
        log_without_the_master()
        ActionServer()
        rospy.spin()
    except rospy.ROSException:  # shut down before it was up
        pass
