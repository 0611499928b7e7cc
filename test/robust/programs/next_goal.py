#!/usr/bin/env python3
"""A server that prints "executes N" for goal N, and sends itself the next goal for each line on stdin.

ACTIONLIB=plain in the environment: actionlib's server.
"""
import os
import sys

import actionlib
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesActionGoal, WashTheDishesGoal
import rospy


def execute_cb(goal):
    print("executes", goal.number_of_minutes, flush=True)
    while not server.is_preempt_requested():
        rospy.sleep(0.05)
    server.set_preempted()


library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust
rospy.init_node("next_goal")
server = library.SimpleActionServer("next_goal", WashTheDishesAction, execute_cb, auto_start=False)
server.start()
goals = rospy.Publisher("next_goal/goal", WashTheDishesActionGoal, queue_size=10, latch=True)
for number in range(1, 100):
    goals.publish(WashTheDishesActionGoal(goal=WashTheDishesGoal(number_of_minutes=number)))
    sys.stdin.readline()
