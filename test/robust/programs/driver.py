#!/usr/bin/env python3
"""A robust server, driver, that prints "executes" for each goal: driver.py crashes|busy

crashes: the program ends at once, with exit status 1. busy: works as many seconds in its goal callback, which publishes
no status meanwhile.
"""
import os
import sys
import time

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rospy


def goal_cb():
    goal = server.accept_new_goal()
    print("executes", flush=True)
    if sys.argv[1] == "crashes":
        os._exit(1)
    time.sleep(goal.number_of_minutes)
    server.set_succeeded()


rospy.init_node("driver")
server = robust.SimpleActionServer("driver", WashTheDishesAction, auto_start=False)
server.register_goal_callback(goal_cb)
server.start()
print("ready", flush=True)
rospy.spin()
