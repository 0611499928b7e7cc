#!/usr/bin/env python3
"""A robust server that logs 300 lines and ends, with exit status 3."""
import sys

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rospy

rospy.init_node("logs")
server = robust.SimpleActionServer("logs", WashTheDishesAction, print, auto_start=False)
server.start()
for number in range(300):
    rospy.loginfo("line %d.", number)
sys.exit(3)
