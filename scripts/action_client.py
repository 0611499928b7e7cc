#!/usr/bin/python3
"""The action client: sends one goal, prints feedback and result, and never waits for a server that is gone.

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
from rospy.impl.paramserver import get_param_server_cache

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
    minutes, server_timeout, heartbeat_timeout = [
        checked(name, rospy.get_param("~" + name, PARAMETERS[name][0])) for name in PARAMETERS]
    client = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
    # The library's wait counts on the ROS clock, which may stand still: it waits in a thread, and we count here.
    waiter = threading.Thread(target=client.wait_for_server, daemon=True)
    waiter.start()
    wait_for("action " + rospy.resolve_name("wash_dishes_as"), lambda: not waiter.is_alive(), server_timeout)

    done = threading.Event()
    rospy.on_shutdown(lambda: cancel(client, done))
    # An answer that comes before send_goal has returned would be dropped as one to another goal: it waits for the lock.
    with client.action_client.manager.list_mutex:
        client.send_goal(WashTheDishesGoal(number_of_minutes=minutes),
                         done_cb=lambda state, result: done.set(), feedback_cb=feedback_cb)
    wait_for_result(client, done, heartbeat_timeout)

    state, result = client.get_state(), client.get_result()
    if result is not None:
        say("The result is: %s" % result)
    if state == GoalStatus.SUCCEEDED:
        return int(rospy.is_shutdown())  # 1 if the result could not be printed
    lost = state == GoalStatus.LOST
    rospy.logerr("goal %s: %s", GoalStatus.to_string(state),
                 "the server does not know it any more" if lost else client.get_goal_status_text())
    return 1


def wait_for(what, is_there, timeout):
    """Wait until is_there() and say so every 5 s. Raises rospy.ROSException after timeout s (0: never), on shutdown."""
    begun = time.monotonic()
    say_next = begun + 5
    while not is_there() and not rospy.is_shutdown():
        now = time.monotonic()
        if 0 < timeout <= now - begun:
            raise rospy.ROSException("no %s within %g s (~server_timeout)" % (what, timeout))
        if now >= say_next:
            rospy.logwarn("waiting for the %s, %.0f s so far", what, now - begun)
            say_next += 5
        time.sleep(0.02)
    if rospy.is_shutdown():
        raise rospy.ROSException("shut down while waiting for the %s" % what)


def wait_for_result(client, done, heartbeat_timeout):
    """Wait until done. Raises rospy.ROSException if the server does not mention the goal for heartbeat_timeout s.

    A server lists its goals in its status messages, five times a second. One that does not list ours is gone, is
    another one, or never got the goal; SimpleActionClient would wait for ever.
    """
    action_goal = client.gh.comm_state_machine.action_goal
    goal_id = action_goal.goal_id.id
    heard = threading.Event()
    rospy.Subscriber(rospy.remap_name("wash_dishes_as") + "/status", GoalStatusArray, lambda msg: goal_id in [
        status.goal_id.id for status in msg.status_list] and heard.set())
    silence, ros, wall = 0.0, rospy.get_time(), time.monotonic()
    sent = wall
    while not done.wait(0.1) and not rospy.is_shutdown():
        ros_before, wall_before, ros, wall = ros, wall, rospy.get_time(), time.monotonic()
        # What counts is time that passed on both clocks, so neither a paused simulation nor a jump of its clock is
        # silence; and no more than 0.5 s at once, for we may have been stopped ourselves.
        silence += max(0.0, min(ros - ros_before, wall - wall_before, 0.5))
        if heard.is_set():
            heard.clear()
            silence = 0.0
        if client.gh.get_comm_state() == actionlib.CommState.WAITING_FOR_GOAL_ACK and wall - sent > 1:
            # rospy may connect twice, and drops what was sent by then; a goal's id makes a repeat harmless.
            client.action_client.pub_goal.publish(action_goal)
            sent = wall
        if silence > heartbeat_timeout:
            client.cancel_goal()  # should the server only sleep
            done.set()
            raise rospy.ROSException(
                "server lost: silent for %.1f s (~heartbeat_timeout is %g s)" % (silence, heartbeat_timeout))


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


def checked(name, value):
    """Return the parameter's value as its type. Raises ValueError, which names it, its value and what is allowed."""
    if name not in PARAMETERS:
        raise ValueError("~%s is no parameter, allowed are ~%s" % (name, ", ~".join(PARAMETERS)))
    _, kind, lowest, highest, allowed = PARAMETERS[name]
    if isinstance(value, bool) or not isinstance(value, (int, kind)) or not lowest <= value <= highest:
        raise ValueError("~%s is %r, allowed is %s" % (name, value, allowed))
    return kind(value)


def command_line():
    """Return the private parameters given there, checked; rospy would fail on broken YAML and on more than 32 bits."""
    given = {}
    for argument in sys.argv[1:]:
        try:
            given.update(load_command_line_node_params([argument]))
        except rospy.ROSInitException:  # no YAML: judge it as text
            name, text = argument.split(":=")
            given[name[1:]] = text
    return {name: checked(name, value) for name, value in given.items()}


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
    leave_within_2_s(1)


def leave_within_2_s(status):
    """Closing the node asks the master: one that does not answer must not keep the process."""
    watchdog = threading.Timer(1.8, os._exit, [status])
    watchdog.daemon = True
    watchdog.start()


def main():
    """Returns the exit status."""
    signal.signal(signal.SIGINT, interrupt)
    signal.signal(signal.SIGTERM, interrupt)
    try:
        given = command_line()
        # init_node waits for the master, too, but says so on stdout.
        wait_for("master " + rosgraph.get_master_uri(), rosgraph.is_master_online, given.get("server_timeout", 0))
        rospy.init_node("action_client", disable_signals=True)
        log_without_the_master()
        return call_server()
    except ValueError as error:
        rospy.logfatal(error)
        return 2
    except rospy.ROSException as error:
        rospy.logerr(error)
        return 1


if __name__ == "__main__":
    status = main()
    leave_within_2_s(status)
    rospy.signal_shutdown("done")
    sys.exit(status)
