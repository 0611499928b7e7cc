#!/usr/bin/env python3
"""Programs with robust's client that end while a test looks on: client_cases.py NAME. NAME is that of a function."""
import gc
import sys
import threading
import time

from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
import rospy


def forgotten_client():
    """Nobody holds the client of a goal that is cancelled on shutdown."""
    def send():
        active = threading.Event()
        client = robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=True)
        client.wait_for_server()
        client.send_goal(TestRequestGoal(result_text="ACTIVE cancel result:PREEMPTED"), active_cb=active.set)
        active.wait()

    send()
    gc.collect()
    print("sent", flush=True)
    rospy.spin()


def shutdown_while_connections_settle():
    """The node is shut down just after the server was connected."""
    client = robust.SimpleActionClient("scripted", TestRequestAction)

    def shut_down():
        client.action_client.wait_for_server()
        time.sleep(0.05)  # the other thread has seen it, too, and waits for 0.2 s
        rospy.signal_shutdown("connected")

    threading.Thread(target=shut_down).start()
    print(client.wait_for_server(), client.get_failure(), flush=True)


def goal_at_exit_without_threads():
    """A goal with a heartbeat_timeout is sent while the interpreter ends and starts no more threads."""
    def send():
        threading.stack_size(1 << 46)  # no computer has that memory
        client.send_goal(TestRequestGoal())
        print("sent", flush=True)

    client = robust.SimpleActionClient("scripted", TestRequestAction, heartbeat_timeout=30)
    client.wait_for_server()
    rospy.on_shutdown(send)


if __name__ == "__main__":
    rospy.init_node("client_cases", anonymous=True)
    globals()[sys.argv[1]]()
