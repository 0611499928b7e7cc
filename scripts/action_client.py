#!/usr/bin/env python3
"""The action client from the posts: sends one goal, and prints its feedback and result."""
import argparse
import sys

import actionlib
from actionlib_msgs.msg import GoalStatus
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy


def feedback_cb(msg):
    """Print a WashTheDishesFeedback."""
    print("Feedback received: %s" % msg, flush=True)


def call_server(number_of_minutes):
    """Send a goal and wait for its outcome. Returns its result, its state (GoalStatus) and the server's text."""
    # Step 1: this program becomes a node.
    rospy.init_node("action_client")
    # Step 2: a client of the action, by its name and type.
    client = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
    # Step 3: a goal sent before the server is connected would be lost.
    client.wait_for_server()
    # Step 4: send the goal. This returns at once, so the program could do something else meanwhile.
    goal = WashTheDishesGoal()
    goal.number_of_minutes = number_of_minutes
    client.send_goal(goal, feedback_cb=feedback_cb)
    # Step 5: wait for the outcome. Meanwhile feedback_cb is called, in another thread.
    client.wait_for_result()
    # Step 6: the result. Unless the state is SUCCEEDED, it may be partial.
    return client.get_result(), client.get_state(), client.get_goal_status_text()


def main():
    """Returns the exit status: 0 for SUCCEEDED, else 1."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number_of_minutes", metavar="MINUTES", nargs="?", type=int, default=7,
                        help="how many minutes to wash, one bowl a minute (default: %(default)s)")
    arguments = parser.parse_args(rospy.myargv()[1:])
    result, state, text = call_server(arguments.number_of_minutes)
    if rospy.is_shutdown():  # Ctrl-C: there is no outcome
        return 1
    if result is not None:
        print("The result is: %s" % result, flush=True)
    if state != GoalStatus.SUCCEEDED:
        name = GoalStatus.to_string(state)
        print("%s: %s" % (name, text) if text else name, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
