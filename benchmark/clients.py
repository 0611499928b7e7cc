#!/usr/bin/python3
"""Connects N action clients, each a node of its own, to the server in a namespace: clients.py N NAMESPACE

They are forked after the imports, so that 50 of them start in seconds and fit into memory. They end with this process.
"""
import os
import sys

import rospy

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction


def client(namespace):
    rospy.init_node("client", anonymous=True)
    robust.SimpleActionClient(namespace + "/wash_dishes_as", WashTheDishesAction).wait_for_server()
    print("connected", flush=True)
    rospy.spin()


if __name__ == "__main__":
    children = []
    for _ in range(int(sys.argv[1])):
        children.append(os.fork())
        if not children[-1]:
            client(sys.argv[2])
            sys.exit()
    for child in children:
        os.waitpid(child, 0)
