#!/usr/bin/env python3
"""Four robust servers of WashTheDishes, for a test that shuts this program down: shutdown_server.py [HOOK]

They are first/wash_dishes_as, second/wash_dishes_as, empty/wash_dishes_as, whose len() is 0, and
callbacks/wash_dishes_as with goal and preempt callbacks.
HOOK: seconds that a function given to rospy.on_shutdown takes, by default 0; no_threads: no thread can be started from
the shutdown on. Prints what happens. stdin ends it: "return" ends the main thread, "signal_shutdown" calls
rospy.signal_shutdown.

What its goals do is in ../ways_to_stop.py.
"""
import os
import sys
import threading
import time

import rospy

if rospy.myargv()[1:] == ["no_threads"]:
    rospy.on_shutdown(lambda: threading.stack_size(1 << 45))  # before that of robust, which the import registers

from actions_tutorial import robust  # noqa: E402
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesResult  # noqa: E402
from ways_to_stop import (  # noqa: E402
    BY_PREEMPT_CALLBACK, CALLBACK_BLOCKS, KEEPS_THE_LOCK, OF_ITS_OWN_ACCORD, ONLY_ON_SHUTDOWN, OWN_TEXT, POLLS, RAISES,
    RESULT_OF_20_MB, STOPS_ITS_SERVER, TEN_MORE_PERIODS, WORKS_ON)

shutdown, returns, preempted = threading.Event(), threading.Event(), threading.Event()


def work(server, minutes):
    if minutes == STOPS_ITS_SERVER:
        server.action_server.stop()
        print("stopped", flush=True)
    elif minutes == KEEPS_THE_LOCK:
        server.action_server.lock.acquire()
    elif minutes == CALLBACK_BLOCKS:
        server.register_preempt_callback(lambda: time.sleep(60))
    elif minutes == OF_ITS_OWN_ACCORD:
        server.register_preempt_callback(lambda: os.write(1, b"preempt callback\n"))
    if minutes in (WORKS_ON, STOPS_ITS_SERVER, KEEPS_THE_LOCK, CALLBACK_BLOCKS):
        time.sleep(60)
    elif minutes != OF_ITS_OWN_ACCORD:
        wait_until_asked(server, minutes)
    result = WashTheDishesResult(["bowl-%d" % i for i in range(minutes % 100)])
    if minutes == RESULT_OF_20_MB:
        result.dishes_washed = ["%060d" % i for i in range(300000)]
    server.set_preempted(result, "rinsed" if minutes == OWN_TEXT else "")


def wait_until_asked(server, minutes):
    """Wait until the goal should stop, in the way that minutes stands for."""
    if minutes == POLLS:
        while not server.is_preempt_requested():
            time.sleep(0.01)
    elif minutes in (ONLY_ON_SHUTDOWN, BY_PREEMPT_CALLBACK):
        (shutdown if minutes == ONLY_ON_SHUTDOWN else preempted).wait()
    elif minutes == TEN_MORE_PERIODS:
        rate = server.rate(20)
        while rate.sleep():
            pass
        for _ in range(10):
            rate.sleep()
    else:
        server.rate(0.01).sleep()
        if minutes == RAISES:
            raise ValueError("out of soap")


class Empty(robust.SimpleActionServer):
    """A server that is false in a condition."""

    def __len__(self):
        return 0


def serve(name, shutdown_timeout=1.0, kind=robust.SimpleActionServer):
    server = kind(
        name + "/wash_dishes_as", WashTheDishesAction, lambda goal: work(server, goal.number_of_minutes),
        auto_start=False, shutdown_timeout=shutdown_timeout)
    server.start()
    return server


def serve_callbacks():
    def goal_cb():
        goal = server.accept_new_goal()
        threading.Thread(target=work, args=[server, goal.number_of_minutes], daemon=True).start()

    server = robust.SimpleActionServer("callbacks/wash_dishes_as", WashTheDishesAction, auto_start=False)
    server.register_goal_callback(goal_cb)
    server.register_preempt_callback(preempted.set)
    server.start()


def hook():
    shutdown.set()
    time.sleep(float(rospy.myargv()[1]) if rospy.myargv()[1:] not in ([], ["no_threads"]) else 0)
    os.write(1, b"hook ended\n")  # the main thread, which this may interrupt, may be in print()


def read_stdin():
    for line in sys.stdin:
        returns.set() if line == "return\n" else rospy.signal_shutdown("the program says so")


def main():
    rospy.init_node("shutdown_server")
    rospy.on_shutdown(hook)
    first = serve("first")
    rospy.on_shutdown(lambda: os.write(1, ("preempt requested: %s\n" % first.is_preempt_requested()).encode()))
    serve("empty", kind=Empty)
    serve("second", 2.0)
    serve_callbacks()
    threading.Thread(target=read_stdin, daemon=True).start()
    print("ready", flush=True)
    while not returns.wait(0.02) and not rospy.is_shutdown():
        pass


if __name__ == "__main__":
    main()
