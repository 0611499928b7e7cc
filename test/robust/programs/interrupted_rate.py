#!/usr/bin/env python3
"""A server's rate whose sleep() SIGINT interrupts before a line of it: interrupted_rate.py WORDS

WORDS: what the line begins with. Prints what sleep() returned.
"""
import linecache
import os
import signal
import sys

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction
import rospy


def trace(frame, event, _):
    """For sys.settrace: sends SIGINT before the line."""
    file = frame.f_code.co_filename
    if not file.endswith("robust/rate.py"):
        return None
    if event == "line" and linecache.getline(file, frame.f_lineno).strip().startswith(sys.argv[1]):
        sys.settrace(None)
        os.kill(os.getpid(), signal.SIGINT)
    return trace


rospy.init_node("interrupted_rate")
server = robust.SimpleActionServer("rate", WashTheDishesAction, auto_start=False)
rate = server.rate(0.01)
sys.settrace(trace)
print("slept", rate.sleep(), flush=True)
