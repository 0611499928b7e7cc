#!/usr/bin/env python3
"""A node with five robust servers and three clients of each, whose topics take a while to close: servers_and_clients.py

Prints "ready" when all are connected.
"""
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rospy

rospy.init_node("servers_and_clients")
names = ["action_%d" % number for number in range(5)]
servers = [robust.SimpleActionServer(name, WashTheDishesAction, print, auto_start=False) for name in names]
for server in servers:
    server.start()
clients = [robust.SimpleActionClient(name, WashTheDishesAction) for name in names * 3]
for client in clients:
    client.wait_for_server()
print("ready", flush=True)
rospy.spin()
