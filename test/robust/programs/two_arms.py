#!/usr/bin/env python3
"""A program for actionlib, with the import changed: two arms move, and SIGINT stops both, as public drivers do it:
two_arms.py is_not_none|true"""
import signal
import sys
import time

from actionlib.msg import TestRequestAction, TestRequestGoal
from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust as actionlib
import rospy

stopped = []


def stop(*_):
    for client in arms:
        if client.gh if sys.argv[1] == "true" else client.gh is not None:
            if client.get_state() == GoalStatus.ACTIVE:
                client.cancel_goal()
    stopped.append(True)


rospy.init_node("two_arms", disable_signals=True)
arms = [actionlib.SimpleActionClient("scripted", TestRequestAction) for _ in range(2)]
for arm in arms:
    arm.wait_for_server()
    arm.send_goal(TestRequestGoal(result_text="ACTIVE cancel result:PREEMPTED"))
while not all(arm.get_state() == GoalStatus.ACTIVE for arm in arms):
    time.sleep(0.01)
signal.signal(signal.SIGINT, stop)
print("both move", flush=True)
while not stopped:
    time.sleep(0.01)
print([arm.wait_for_result(rospy.Duration(20)) and arm.get_state() for arm in arms], flush=True)
