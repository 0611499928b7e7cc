#!/usr/bin/env python3
"""Sends a goal, waits and prints its state and get_failure(): shutdown_client.py SCRIPT cancels|default|leaves [HOOK]

SCRIPT: what the scripted server does. cancels: with cancel_on_shutdown. leaves: ends when the goal is active. HOOK:
seconds that a function given to rospy.on_shutdown takes.
"""
import contextlib
import os
import threading
import time

from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
import rospy


def main():
    script, cancels, *hook = rospy.myargv()[1:]
    rospy.init_node("shutdown_client", anonymous=True)
    if hook:
        rospy.on_shutdown(lambda: time.sleep(float(hook[0])) or os.write(1, b"hook ended\n"))
    client = robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=cancels == "cancels")
    client.wait_for_server()
    active = threading.Event()
    client.send_goal(TestRequestGoal(result_text=script), active_cb=active.set)
    active.wait()
    with contextlib.suppress(AttributeError):  # of Debian 11's rospy, see harness.py
        print("active", flush=True)
        if cancels == "leaves":
            return
        client.wait_for_result()
    over = client.wait_for_result()
    print(over, robust.client.STATE_NAMES[client.get_state()], client.get_failure(), flush=True)


if __name__ == "__main__":
    main()
