#!/usr/bin/python3
"""The action client: sends one goal, prints feedback and result, and never waits for a server that is gone.

Exit status: 0 SUCCEEDED; 1 any other ending; 2 a parameter of the wrong type or out of its range.
"""
import os
import sys
import threading
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray

from actions_tutorial import parameters, steady
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

# private parameter: default, type, lowest, highest, the last two in words
PARAMETERS = {
    "number_of_minutes": (7, int, -2**31, 2**31 - 1, "a whole number from -2147483648 to 2147483647 (int32)"),
    "server_timeout": (0.0, float, 0.0, 1e9, "a number of seconds from 0 (wait for ever) to 1e9"),
    "heartbeat_timeout": (5.0, float, 1e-3, 1e9, "a number of seconds from 0.001 to 1e9"),
}


def feedback_cb(msg):
    """Print a WashTheDishesFeedback."""
    say("Feedback received: %s" % msg)


def call_server():
    """Send the goal, see it to its end and print the result, also a partial one. Returns the exit status."""
    minutes, server_timeout, heartbeat_timeout = [parameters.get(PARAMETERS, name) for name in PARAMETERS]
    client = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
    # The library's wait counts on the ROS clock, which may stand still: it waits in a thread, and we count here.
    waiter = threading.Thread(target=client.wait_for_server, daemon=True)
    waiter.start()
    steady.wait_for("action " + rospy.resolve_name("wash_dishes_as"), lambda: not waiter.is_alive(), server_timeout)

    done = threading.Event()
    rospy.on_shutdown(lambda: cancel(client, done))
    goal_id = steady.send_goal(client, WashTheDishesGoal(number_of_minutes=minutes),
                               done_cb=lambda state, result: done.set(), feedback_cb=feedback_cb)
    if not wait_for_result(goal_id, done, heartbeat_timeout):
        client.cancel_goal()  # should the server only sleep
        done.set()
        return 1

    state, result = client.get_state(), client.get_result()
    if result is not None:
        say("The result is: %s" % result)
    if state == GoalStatus.SUCCEEDED:
        return int(rospy.is_shutdown())  # 1 if the result could not be printed
    lost = state == GoalStatus.LOST
    rospy.logerr("goal %s: %s", GoalStatus.to_string(state),
                 "the server does not know it any more" if lost else client.get_goal_status_text())
    return 1


def wait_for_result(goal_id, done, heartbeat_timeout):
    """Wait until done or shutdown. Returns False if the server does not mention the goal for heartbeat_timeout s.

    A server lists its goals in its status messages, five times a second. One that does not list ours is gone, is
    another one, or never got the goal; SimpleActionClient would wait for ever.
    """
    heard = threading.Event()
    rospy.Subscriber(rospy.remap_name("wash_dishes_as") + "/status", GoalStatusArray, lambda msg: goal_id in [
        status.goal_id.id for status in msg.status_list] and heard.set())
    silence, ros, wall = 0.0, rospy.get_time(), time.monotonic()
    while not done.wait(0.1) and not rospy.is_shutdown():
        ros_before, wall_before, ros, wall = ros, wall, rospy.get_time(), time.monotonic()
        # What counts is time that passed on both clocks, so neither a paused simulation nor a jump of its clock is
        # silence; and no more than 0.5 s at once, for we may have been stopped ourselves.
        silence += max(0.0, min(ros - ros_before, wall - wall_before, 0.5))
        if heard.is_set():
            heard.clear()
            silence = 0.0
        if silence > heartbeat_timeout:
            rospy.logerr("server lost: silent for %.1f s (~heartbeat_timeout is %g s)", silence, heartbeat_timeout)
            return False
    return True


def cancel(client, done):
    """On shutdown: cancel our goal, no other, and wait up to 1 s for its ending while messages still go in and out."""
    limit = time.monotonic() + 1
    while not client.gh and time.monotonic() < limit:
        time.sleep(0.001)  # send_goal is still at it
    if not done.is_set():
        client.cancel_goal()
    while not done.is_set() and time.monotonic() < limit:
        time.sleep(0.01)


def say(text):
    """Print at once, also into a pipe; when nobody reads it any more, end the node."""
    try:
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        rospy.logerr("cannot write to stdout: %s", error)
        rospy.signal_shutdown("stdout is closed")


def main():
    """Returns the exit status."""
    try:
        given = parameters.from_command_line(PARAMETERS)
        steady.init_node("action_client", timeout=given.get("server_timeout", 0), interrupted=1)
        return call_server()
    except ValueError as error:
        rospy.logfatal(error)
        return 2
    except rospy.ROSException as error:  # nobody to call, or interrupted while waiting
        rospy.logerr(error)
        return 1


if __name__ == "__main__":
    steady.leave(main())
