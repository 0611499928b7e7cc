#!/usr/bin/env python3
"""Three robust servers of WashTheDishes, for a test that shuts this program down: shutdown_server.py [HOOK]

They are first/wash_dishes_as and second/wash_dishes_as, and callbacks/wash_dishes_as with goal and preempt callbacks.
HOOK: seconds that a function given to rospy.on_shutdown takes, by default 0; no_threads: no thread can be started from
the shutdown on. Prints what happens. stdin ends it: "return" ends the main thread, "signal_shutdown" calls
rospy.signal_shutdown.

A goal of n minutes stops when asked to, with n bowls. Others:
* 100: it does not stop for a minute.
* 200: it stops with a text of its own.
* 300: it looks once in 10 ms whether it should stop, without a rate.
* 400: it was asked to stop by a client, and does so only during the shutdown.
* 500: it stops when the preempt callback is called.
* 600: it raises when it should stop.
* 700: it goes on for ten periods of 0.05 s when it should stop.
* 800: it stops its server, and works on for a minute.
* 900: it keeps the server's lock for a minute.
* 1000: it stops when asked to, with a result of 20 MB, which takes a while to send.
* 1100: it works on, and the preempt callback blocks for a minute.
* 1200: it stops of its own accord, and the preempt callback prints that it was called.
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

shutdown, returns, preempted = threading.Event(), threading.Event(), threading.Event()


def work(server, minutes):
    if minutes == 800:
        server.action_server.stop()
        print("stopped", flush=True)
    elif minutes == 900:
        server.action_server.lock.acquire()
    elif minutes == 1100:
        server.register_preempt_callback(lambda: time.sleep(60))
    elif minutes == 1200:
        server.register_preempt_callback(lambda: os.write(1, b"preempt callback\n"))
    if minutes in (100, 800, 900, 1100):
        time.sleep(60)
    elif minutes != 1200:
        wait_until_asked(server, minutes)
    result = WashTheDishesResult(["bowl-%d" % i for i in range(minutes % 100)])
    if minutes == 1000:
        result.dishes_washed = ["%060d" % i for i in range(300000)]
    server.set_preempted(result, "rinsed" if minutes == 200 else "")


def wait_until_asked(server, minutes):
    """Wait until the goal should stop, in the way that minutes stands for."""
    if minutes == 300:
        while not server.is_preempt_requested():
            time.sleep(0.01)
    elif minutes in (400, 500):
        (shutdown if minutes == 400 else preempted).wait()
    elif minutes == 700:
        rate = server.rate(20)
        while rate.sleep():
            pass
        for _ in range(10):
            rate.sleep()
    else:
        server.rate(0.01).sleep()
        if minutes == 600:
            raise ValueError("out of soap")


def serve(name, shutdown_timeout=1.0):
    server = robust.SimpleActionServer(
        name + "/wash_dishes_as", WashTheDishesAction, lambda goal: work(server, goal.number_of_minutes),
        auto_start=False, shutdown_timeout=shutdown_timeout)
    server.start()


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
    serve("first")
    serve("second", 2.0)
    serve_callbacks()
    threading.Thread(target=read_stdin, daemon=True).start()
    print("ready", flush=True)
    while not returns.wait(0.02) and not rospy.is_shutdown():
        pass


if __name__ == "__main__":
    main()
