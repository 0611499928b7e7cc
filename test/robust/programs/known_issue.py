#!/usr/bin/env python3
"""Programs that show what users of actionlib have reported: known_issue.py NAME

NAME is that of a function. What it prints after "ready" is its finding. ACTIONLIB=plain in the environment tries
actionlib instead of robust. The test starts those with a clock in simulated time.
"""
import os
import sys
import threading
import time

import actionlib
from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy

from support.processes import eventually
from support.simulated_clock import SimulatedClock
from support.states import NAMES, PENDING

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


def serve(name="work"):
    """Start a server: a goal of 0 minutes SUCCEEDS at once, another works until it should stop."""
    def execute_cb(goal):
        while goal.number_of_minutes and not server.is_preempt_requested():
            time.sleep(0.01)
        server.set_preempted() if goal.number_of_minutes else server.set_succeeded()

    server = library.SimpleActionServer(name, WashTheDishesAction, execute_cb, auto_start=False)
    server.start()
    return server


def connect():
    client = library.SimpleActionClient("work", WashTheDishesAction)
    client.wait_for_server()
    return client


def set_clock_back(client, clock):
    """Print the state of a goal that is sent after the clock was set back."""
    clock.set(clock.now - rospy.Duration(200))
    print(NAMES[client.send_goal_and_wait(WashTheDishesGoal())])


def clock_set_back_after_a_goal():
    clock, _, client = SimulatedClock(), serve(), connect()
    client.send_goal_and_wait(WashTheDishesGoal())
    set_clock_back(client, clock)


def clock_set_back_during_a_goal():
    clock, _, client = SimulatedClock(), serve(), connect()
    client.send_goal(WashTheDishesGoal(1))
    eventually(lambda: client.get_state() != PENDING, "an active goal")
    set_clock_back(client, clock)


def clock_set_back_after_a_cancel():
    clock, _, client = SimulatedClock(), serve(), connect()
    client.send_goal(WashTheDishesGoal(1))
    eventually(lambda: client.get_state() != PENDING, "an active goal")
    client.cancel_goals_at_and_before_time(clock.now)
    client.wait_for_result()
    set_clock_back(client, clock)


def clock_set_back_and_status():
    clock, _, client = SimulatedClock(), serve(), connect()
    for _ in range(10):
        clock.turn(0.1)
    time.sleep(0.3)  # the server's timer sleeps
    clock.set(clock.now - rospy.Duration(200))
    later = clock.now + rospy.Duration(1)
    eventually(lambda: clock.turn(0.1) or later < client.action_client.last_status_msg.header.stamp <= clock.now,
               "a status", timeout=10)
    print("status goes on")


def clock_begins_while_waiting_for_server():
    client, waited = library.SimpleActionClient("late", WashTheDishesAction), []
    thread = threading.Thread(target=lambda: waited.append(client.wait_for_server(rospy.Duration(20))))
    thread.start()
    thread.join(0.5)
    clock = SimulatedClock()
    thread.join(0.5)
    serve("late")
    clock.turn(0.5)
    thread.join(20)
    print(waited)


def no_clock_while_waiting_for_server():
    client = library.SimpleActionClient("nobody", WashTheDishesAction)
    thread = threading.Thread(target=client.wait_for_server, args=[rospy.Duration(0.5)], daemon=True)
    thread.start()
    thread.join(5)
    print("waits" if thread.is_alive() else "ends")


def clock_begins_while_waiting_for_result():
    client = library.SimpleActionClient("scripted", TestRequestAction)
    eventually(client.action_client.pub_goal.get_num_connections, "the server")
    time.sleep(0.5)  # the other topics
    client.send_goal(TestRequestGoal(result_text="2 result:SUCCEEDED"))
    clock = threading.Timer(0.5, SimulatedClock)
    clock.start()
    print(client.wait_for_result(rospy.Duration(20)))
    clock.join()  # it waits for its first message, which would not come after the shutdown


def goal_in_a_moment_of_simulated_time():
    SimulatedClock().set(rospy.Time(1000))
    client = library.SimpleActionClient("scripted", TestRequestAction)
    client.wait_for_server()
    client.send_goal(TestRequestGoal(result_text="result:SUCCEEDED"))
    time.sleep(0.5)
    print("sent")


def main_thread_raises_after_execute_cb():
    serve()
    raise rospy.ROSException("failed")


def main_thread_raises_after_goal_callback():
    server = library.SimpleActionServer("work", WashTheDishesAction, auto_start=False)
    server.register_goal_callback(server.accept_new_goal)
    server.start()
    raise rospy.ROSException("failed")


def idle():
    server = serve()
    rospy.spin()
    del server


if __name__ == "__main__":
    program = globals()[sys.argv[1]]
    rospy.init_node("known_issue")
    print("ready", flush=True)
    program()
    sys.stdout.flush()
    rospy.signal_shutdown("done")  # or the thread of actionlib's server goes on
