#!/usr/bin/env python3
"""A server's rate whose sleep() SIGINT interrupts in the line before it waits: interrupted_rate.py

Prints what sleep() returned.
"""
import linecache
import os
import signal
import sys

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rospy


def trace(frame, event, _):
    """For sys.settrace: sends SIGINT before the line that waits."""
    file = frame.f_code.co_filename
    if not file.endswith("robust/rate.py"):
        return None
    if event == "line" and "clock.wait(" in linecache.getline(file, frame.f_lineno):
        sys.settrace(None)
        os.kill(os.getpid(), signal.SIGINT)
    return trace


rospy.init_node("interrupted_rate")
server = robust.SimpleActionServer("rate", WashTheDishesAction, auto_start=False)
rate = server.rate(0.01)
sys.settrace(trace)
print("slept", rate.sleep(), flush=True)
