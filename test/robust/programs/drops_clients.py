#!/usr/bin/env python3
"""Makes and drops 200 clients, and 50 servers, and prints what they leave: drops_clients.py"""
import gc
import sys
import threading
import time
import weakref

import actionlib
from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rosgraph
import rospy


def topics(word):
    """Returns the topics (set of str) with word in their names that this node still publishes or subscribes to."""
    published, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    return {topic for topic, nodes in published + subscribed if rospy.get_name() in nodes and word in topic}


def leave_clients():
    """Returns the clients, threads and topics (int) that are left."""
    threads, clients = threading.active_count(), []
    for number in range(200):
        client = robust.SimpleActionClient("client_%d" % number, TestRequestAction)
        client.send_goal(TestRequestGoal(), feedback_cb=print, done_cb=print)
        client.action_client.stop()
        clients.append(weakref.ref(client))
        del client
    gc.collect()
    return sum(one() is not None for one in clients), threading.active_count() - threads, len(topics("client_"))


def leave_servers(library):
    """Returns the threads and topics (int) that are left."""
    threads = threading.active_count()
    for number in range(50):
        name = "server_%s_%d" % (library.__name__.split(".")[-1], number)
        server = library.SimpleActionServer(name, WashTheDishesAction, print, auto_start=False)
        server.start()
        server.action_server.stop()
    time.sleep(1)  # a timer ends when it wakes next
    return threading.active_count() - threads, len(topics("server_"))


rospy.init_node("drops_clients")
print("clients", leave_clients())
plain, ours = leave_servers(actionlib), leave_servers(robust)
print("servers", all(one <= other for one, other in zip(ours, plain)), plain, ours, flush=True)
sys.stdout.flush()
rospy.signal_shutdown("done")
