#!/usr/bin/python3
"""Programs that show what users of actionlib have reported: reports_programs.py NAME [ARGUMENT]

A node with the program's name; NAME is that of a function here. What it prints is its finding.
"""
import gc
import os
import sys
import threading
import time
import weakref
import xmlrpc.client
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
from processes import eventually
from raw_client import NAMES
from raw_server import PATIENCE, RawServer, client_of, library
from simulated_clock import SimulatedClock


def serve(name, before=0, after=0):
    """A server that works before (s) it ends a goal, or until it is asked to stop one of a minute, and after (s) it."""
    def execute(goal):
        time.sleep(before)
        while goal.number_of_minutes and not server.is_preempt_requested():
            time.sleep(0.01)
        (server.set_preempted if goal.number_of_minutes else server.set_succeeded)()
        time.sleep(after)

    server = library.SimpleActionServer(name, WashTheDishesAction, execute, False)
    server.start()
    return server


def meet(name):
    client = client_of(name)
    client.wait_for_server()
    return client


def client(name):
    print(NAMES[meet(name).send_goal_and_wait(WashTheDishesGoal())])


def moment():
    """A server in a moment of simulated time. It runs until it is stopped, as the next one does."""
    SimulatedClock()
    serve("work")
    print("ready", flush=True)
    rospy.spin()


def works():
    """A server of actionlib's own, as most are: it works a goal's seconds in its goal callback, with its lock held."""
    def work():
        goal = server.accept_new_goal()
        print("works", flush=True)
        for _ in range(100 * goal.number_of_minutes):
            time.sleep(0.01)  # all at once, it would end while it is frozen (since Python 3.11)
        server.set_succeeded()

    server = actionlib.SimpleActionServer("works", WashTheDishesAction, None, False)
    server.register_goal_callback(work)
    server.start()
    rospy.spin()


def fails():
    server = library.SimpleActionServer("work", WashTheDishesAction, auto_start=False)
    server.register_goal_callback(server.accept_new_goal)
    server.start()
    raise rospy.ROSException("failed")


def clock_set_back():
    """For each case a server of its own, and a goal on a clock that was set back then."""
    clock = SimulatedClock()
    for number, case in enumerate(("after a goal", "after a cancel up to then", "during a goal", "for a heartbeat")):
        serve("work_%d" % number)
        client = meet("work_%d" % number)
        client.send_goal(WashTheDishesGoal(int(case != "after a goal")))
        eventually(lambda: client.get_state() != GoalStatus.PENDING, "a goal that runs, or has ended")
        if "cancel" in case:
            client.cancel_goals_at_and_before_time(clock.now)
        if "after" in case:
            client.wait_for_result()
        clock.set(clock.now - rospy.Duration(200))
        if "heartbeat" in case:
            later, status = clock.now + rospy.Duration(1), client.action_client
            eventually(lambda: clock.turn(0.1) or later < status.last_status_msg.header.stamp <= clock.now,
                       "a heartbeat", timeout=10)
        print("%s: %s" % (case, NAMES[client.send_goal_and_wait(WashTheDishesGoal())]), flush=True)


def clock_begins():
    """Three waits begin before a clock does: for nobody, for a server, for a result."""
    def say():
        print([one.result() if one.done() else "waits" for one in waits])

    raw, late, nobody, threads = RawServer("raw"), client_of("late"), client_of("nobody"), ThreadPoolExecutor()
    goal = raw.send()
    waits = [threads.submit(call, rospy.Duration(timeout)) for call, timeout in (
        (nobody.wait_for_server, 0.5), (late.wait_for_server, 10), (raw.client.wait_for_result, 10))]
    wait(waits, 10, FIRST_COMPLETED)
    say()
    SimulatedClock()
    wait(waits, 0.5)  # the fault itself: they end now
    serve("late")
    raw.result(goal)
    wait(waits, 10)
    say()


def leave_nothing():
    here = weakref.WeakSet()

    def come_and_go(name):
        server = serve(name, before=0.05)  # actionlib's client may drop what comes before send_goal returns
        client = meet(name)
        here.update((client, server))
        client.send_goal_and_wait(WashTheDishesGoal())
        client.action_client.stop()
        server.action_server.stop()
        server.__del__()

    def left():
        gc.collect()
        node = xmlrpc.client.ServerProxy(rospy.get_node_uri())
        return threading.active_count(), len(node.getBusInfo("/t")[2]), len(here)

    for number in range(3):
        come_and_go("work_%d" % number)
    before = left()
    for number in range(20):
        come_and_go("more_%d" % number)
    # Requests of the master and what has just been stopped keep some for a while; a leak of ours would be 20.
    eventually(lambda: all(now < then + 10 for now, then in zip(left(), before)),
               "threads, connections, objects after 20 more, %s, as after 3, %s" % (left(), before),
               here, threading.enumerate(), timeout=10)
    print("nothing")


def fast():
    serve("work")
    client = meet("work")
    for number in range(200):
        client.send_goal(WashTheDishesGoal())
        if number % 2:
            client.wait_for_result(PATIENCE)
    print(NAMES[client.get_state()])


def pauses():
    """Goals of a server whose callback goes on for a moment after it has ended its goal."""
    serve("work", after=0.01)
    client, took = meet("work"), []
    for _ in range(21):
        begun = time.monotonic()
        client.send_goal_and_wait(WashTheDishesGoal())
        took.append(time.monotonic() - begun)
    print("none" if sorted(took)[10] < 0.1 else took)  # actionlib's server makes most of them wait for that long


if __name__ == "__main__":
    program, arguments = sys.argv[1], rospy.myargv()[2:]
    rospy.init_node(program, disable_signals=True)
    globals()[program](*arguments)
    sys.stdout.flush()
    os._exit(0)  # how actionlib's server ends is not what is tried here
