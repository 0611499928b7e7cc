#!/usr/bin/env python3
"""Sends a goal, waits and prints its state and get_failure(): shutdown_client.py SCRIPT HOW [HOOK]

SCRIPT: what the scripted server does. HOOK: seconds that a function given to rospy.on_shutdown takes. HOW:
* default: without cancel_on_shutdown.
* cancels: with cancel_on_shutdown.
* stops_another: the same beside ten such clients with a goal whose action_client was stopped.
* breaks_another: the same beside ten such clients whose action_client was set to None, too.
* signals_shutdown: with cancel_on_shutdown, and done_cb calls rospy.signal_shutdown.
"""
import os
import threading
import time

from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
import rospy

from support.states import NAMES


def main():
    script, how, *hook = rospy.myargv()[1:]
    rospy.init_node("shutdown_client", anonymous=True)
    if hook:
        rospy.on_shutdown(lambda: time.sleep(float(hook[0])) or os.write(1, b"hook ended\n"))
    clients = [robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=how != "default")
               for _ in range(11 if how.endswith("another") else 1)]
    client = clients.pop(5 if clients[5:] else 0)  # neither the first nor the last
    client.wait_for_server()
    active = threading.Event()

    def done_cb(*_):
        if how == "signals_shutdown":
            print("done_cb", flush=True)
            rospy.signal_shutdown("done")

    for another in clients:
        another.send_goal(TestRequestGoal(result_text="ACTIVE"))
        another.action_client.stop()
        if how == "breaks_another":
            another.action_client = None
    client.send_goal(TestRequestGoal(result_text=script), done_cb, active.set)
    active.wait()
    print("active", flush=True)
    over = client.wait_for_result()
    print(over, NAMES[client.get_state()], client.get_failure(), flush=True)


if __name__ == "__main__":
    main()
