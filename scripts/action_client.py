#!/usr/bin/python3
"""The action client: sends one goal and prints its feedback and result.

Private parameters, set with _NAME:=VALUE:
  ~number_of_minutes   the goal: how many minutes to wash, one bowl a minute (default 7)
  ~server_timeout      seconds to wait for the master, and then as long again for the server; 0: for ever (default 0)
  ~heartbeat_timeout   seconds without a word about the goal: then the server counts as lost (default 5)

Exit status: 0 for SUCCEEDED; 1 for any other ending, Ctrl-C, or no server; 2 for a wrong parameter or argument.
"""
import sys

from actions_tutorial import robust  # this package's library; first, or an early Ctrl-C leaves a traceback
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy

PARAMETERS = {  # (default, lowest, highest); the default also sets the type
    "~number_of_minutes": (7, -2147483648, 2147483647),  # an int32; below 0, too: see how the server aborts it
    "~server_timeout": (0.0, 0.0, 1e9),
    "~heartbeat_timeout": (5.0, 0.1, 1e9),
}


def feedback_cb(msg):
    """Print a WashTheDishesFeedback."""
    print("Feedback received: %s" % msg)


def call_server(number_of_minutes, server_timeout, heartbeat_timeout):
    """Send a goal and wait for its ending. On Ctrl-C robust cancels the goal, and all waiting ends.

    Returns (result, failure): the result may be partial, or None; the failure (str) is None for SUCCEEDED.
    """
    # As actionlib.SimpleActionClient; heartbeat_timeout and get_failure() are robust's own.
    client = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction, heartbeat_timeout=heartbeat_timeout)
    if not client.wait_for_server(rospy.Duration(server_timeout)):
        return None, client.get_failure()
    goal = WashTheDishesGoal()
    goal.number_of_minutes = number_of_minutes
    client.send_goal(goal, feedback_cb=feedback_cb)
    client.wait_for_result()
    return client.get_result(), client.get_failure()


def main():
    """Returns the exit status."""
    # As rospy.init_node. It also prints usage for --help, waits ~server_timeout for the master, checks the parameters
    # and returns their values; it ends the node if one is wrong (2) or no master comes (1).
    values = robust.init_node("action_client", usage=__doc__, parameters=PARAMETERS)
    result, failure = call_server(*values)
    if result is not None:
        print("The result is: %s" % result)
    if failure:
        rospy.logerr(failure)
    return 1 if failure else 0


if __name__ == "__main__":
    sys.exit(main())
