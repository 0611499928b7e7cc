#!/usr/bin/env python3
"""The action client: sends one goal, prints feedback and result, and waits for no server that is gone.

Exit status: 0 SUCCEEDED; 1 any other ending; 2 a parameter of the wrong type or out of its range.
"""
import os
import signal
import sys
import threading
import time

import actionlib
import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from rospy.client import load_command_line_node_params

from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

ACTION = "wash_dishes_as"
# private parameter: default, type, lowest, highest, the last two in words
PARAMETERS = {
    "number_of_minutes": (7, int, -2**31, 2**31 - 1, "an int32: a whole number from -2147483648 to 2147483647"),
    "server_timeout": (0.0, float, 0.0, 1e9, "a number of seconds from 0 (wait for ever) to 1e9"),
    "heartbeat_timeout": (5.0, float, 1e-3, 1e9, "a number of seconds from 0.001 to 1e9"),
}


def feedback_cb(msg):
    """Print a WashTheDishesFeedback."""
    say("Feedback received: %s" % msg)


def call_server(started):
    """Send the goal and see it to its end. started: time.monotonic() when the wait began. Returns the exit status."""
    minutes, server_timeout, heartbeat_timeout = [
        checked(name, rospy.get_param("~" + name, PARAMETERS[name][0])) for name in PARAMETERS]
    client = actionlib.SimpleActionClient(ACTION, WashTheDishesAction)
    # wait_for_server counts on the ROS clock, which may stand still: it waits in a thread, and we count here.
    waiter = threading.Thread(target=client.wait_for_server, daemon=True)
    waiter.start()
    if not wait_for("action " + rospy.resolve_name(ACTION), lambda: not waiter.is_alive(), started, server_timeout):
        return 1
    done = threading.Event()
    rospy.on_shutdown(lambda: cancel(client, done))
    client.send_goal(WashTheDishesGoal(number_of_minutes=minutes),
                     done_cb=lambda state, result: done.set(), feedback_cb=feedback_cb)
    if not wait_for_result(client, done, heartbeat_timeout):
        return 1
    return report(client)


def wait_for(what, is_there, started, timeout):
    """Wait until is_there(), for timeout seconds from started on at the most (0: for ever). Returns whether it is."""
    say_next = time.monotonic() + 5
    while not is_there():
        now = time.monotonic()
        if rospy.is_shutdown():
            return False
        if 0 < timeout <= now - started:
            rospy.logerr("no %s in %g s (~server_timeout)", what, timeout)
            return False
        if now >= say_next:
            rospy.logwarn("waiting for the %s, %.0f s so far", what, now - started)
            say_next += 5
        time.sleep(0.02)
    return not rospy.is_shutdown()


def wait_for_result(client, done, heartbeat_timeout):
    """Wait until the goal is done. Returns False if its server says nothing of it for heartbeat_timeout seconds.

    A server lists its goals in its status messages five times a second. One that does not list ours is gone, or is
    another one, or never got the goal; SimpleActionClient would wait on in each of these cases.
    """
    goal_id = client.gh.comm_state_machine.action_goal.goal_id.id
    listed = threading.Event()
    rospy.Subscriber(ACTION + "/status", GoalStatusArray, lambda msg: goal_id in [
        status.goal_id.id for status in msg.status_list] and listed.set())
    silence, ros, wall = 0.0, rospy.get_time(), time.monotonic()
    while not done.wait(0.1) and not rospy.is_shutdown():
        ros_before, wall_before, ros, wall = ros, wall, rospy.get_time(), time.monotonic()
        if listed.is_set():
            listed.clear()
            silence = 0.0
        # A paused simulation is no silence; nor is a clock that jumps, nor the time that we were stopped ourselves.
        silence += max(0.0, min(ros - ros_before, wall - wall_before, 0.5))
        if silence > heartbeat_timeout:
            rospy.logerr("server lost: %s has been silent about the goal for %.1f s (~heartbeat_timeout %g s)",
                         rospy.resolve_name(ACTION), silence, heartbeat_timeout)
            client.cancel_goal()  # should it only sleep
            done.set()
            return False
    return True


def cancel(client, done):
    """On shutdown: cancel our own goal and wait for its ending (at most 1 s), while messages still go out and come in."""
    # Closing the node asks the master. One that is out of reach must not keep the process.
    status = 0 if client.get_state() == GoalStatus.SUCCEEDED else 1
    watchdog = threading.Timer(1.8, os._exit, [status])
    watchdog.daemon = True
    watchdog.start()
    if not done.is_set():
        client.cancel_goal()
        limit = time.monotonic() + 1
        while not done.is_set() and time.monotonic() < limit:
            time.sleep(0.01)


def report(client):
    """Print the result, also a partial one, and log any ending but SUCCEEDED. Returns the exit status."""
    state, result = client.get_state(), client.get_result()
    if result is not None:
        say("The result is: %s" % result)
    if state == GoalStatus.SUCCEEDED:
        return 0
    text = "the server does not know the goal any more" if state == GoalStatus.LOST else client.get_goal_status_text()
    rospy.logerr("goal %s: %s", GoalStatus.to_string(state), text)
    return 1


def say(text):
    """Print at once, also into a pipe."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def checked(name, value):
    """Return the parameter's value as its type. Raises ValueError that names it, the value and what is allowed."""
    if name not in PARAMETERS:
        raise ValueError("~%s: %r is no parameter, allowed are %s" % (name, value, ", ".join(PARAMETERS)))
    _, kind, lowest, highest, allowed = PARAMETERS[name]
    if isinstance(value, bool) or not isinstance(value, (int, kind)) or not lowest <= value <= highest:
        raise ValueError("~%s is %r, allowed is %s" % (name, value, allowed))
    return kind(value)


def command_line():
    """Return the private parameters of the command line, checked: rospy itself fails on a number over 32 bits."""
    given = {}
    for argument in sys.argv[1:]:
        try:
            given.update(load_command_line_node_params([argument]))
        except rospy.ROSInitException:  # no YAML: judge it as text
            given[argument.split(":=")[0].lstrip("_")] = argument.split(":=")[1]
    return {name: checked(name, value) for name, value in given.items()}


def main():
    """Returns the exit status."""
    started = time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # like Ctrl-C, until rospy takes over both
    try:
        timeout = command_line().get("server_timeout", 0)
        # init_node would wait for the master, too, but say so on stdout.
        if not wait_for("master " + rosgraph.get_master_uri(), rosgraph.is_master_online, started, timeout):
            return 1
        rospy.init_node("action_client")
        return call_server(started)
    except ValueError as error:
        rospy.logfatal(error)
        return 2
    except (KeyboardInterrupt, rospy.ROSException):  # interrupted before the goal was sent
        return 1


if __name__ == "__main__":
    exit_status = main()
    rospy.signal_shutdown("done")
    sys.exit(exit_status)
