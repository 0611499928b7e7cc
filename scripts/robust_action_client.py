#!/usr/bin/env python3
"""action_client.py on robust: notices a lost server, says why a goal failed, and cancels its goal on Ctrl-C."""
import argparse
import sys

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy


def feedback_cb(msg):
    """Print a WashTheDishesFeedback."""
    print("Feedback received: %s" % msg, flush=True)


def call_server(number_of_minutes, server_timeout, heartbeat_timeout):
    """Send a goal and wait until it is over. Returns its result, which may be partial or None, and why it did not
    succeed (str), or None if it did."""
    rospy.init_node("robust_action_client")
    client = robust.SimpleActionClient(
        "wash_dishes_as", WashTheDishesAction, heartbeat_timeout=heartbeat_timeout or None, cancel_on_shutdown=True)
    if not client.wait_for_server(server_timeout):
        return None, client.get_failure()
    goal = WashTheDishesGoal()
    goal.number_of_minutes = number_of_minutes
    client.send_goal(goal, feedback_cb=feedback_cb)
    client.wait_for_result()
    return client.get_result(), client.get_failure()


def seconds(text):
    """Returns text as a float of 0 or more. Raises ValueError, which argparse reports."""
    value = float(text)
    if not value >= 0:
        raise ValueError
    return value


def main():
    """Returns the exit status: 0 for SUCCEEDED, else 1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number_of_minutes", metavar="MINUTES", nargs="?", type=int, default=7,
                        help="how many minutes to wash, one bowl a minute (default: %(default)s)")
    parser.add_argument("--server-timeout", metavar="S", type=seconds, default=0,
                        help="seconds to wait for the server; 0: no limit (default: %(default)s)")
    parser.add_argument("--heartbeat-timeout", metavar="S", type=seconds, default=5,
                        help="seconds of silence before the server counts as lost; 0: no limit (default: %(default)s)")
    arguments = parser.parse_args(rospy.myargv()[1:])
    result, failure = call_server(
        arguments.number_of_minutes, arguments.server_timeout, arguments.heartbeat_timeout)
    if result is not None:
        print("The result is: %s" % result, flush=True)
    if failure:
        print(failure, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
