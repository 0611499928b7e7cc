#!/usr/bin/python3
"""The posts' client on plain rospy and actionlib, with a goal of no bowls."""
import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy

rospy.init_node("plain_action_client")
client = actionlib.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
client.wait_for_server()
client.send_goal(WashTheDishesGoal(number_of_minutes=0))
client.wait_for_result()
print("The result is: %s" % client.get_result())
