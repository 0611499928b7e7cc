#!/usr/bin/env python3
"""Two robust servers of WashTheDishes, for a test that shuts this program down: shutdown_server.py SCRIPT [HOOK]

They are first/wash_dishes_as, which has an execute_cb, and second/wash_dishes_as, which has a goal callback, and a
shutdown_timeout of 2 s. HOOK: seconds that a function given to rospy.on_shutdown takes, by default 0.
stdin ends the program: "end_main_thread", or "signal_shutdown", which calls rospy.signal_shutdown.

SCRIPT is what each goal does: words that are carried out one after the other. Then it calls set_preempted, with a bowl
for each minute.

| word | what the goal does |
| --- | --- |
| wait | waits at the server's rate until it should stop |
| poll | looks every 0.01 s whether it should stop |
| preempt_callback | waits until the preempt callback was called |
| hook | waits until HOOK begins, whatever the server says |
| work | works on for a minute |
| raise | raises a ValueError |
| lock | takes the server's lock, and keeps it |
| block | registers a preempt callback that takes a minute |
| stop_server | stops its server |
| no_threads | lets nobody start a thread any more, as Python 3.12 does when the main thread has ended |
| 20_MB | gives set_preempted a result of 20 MB |
| text:rinsed | gives it that text |
"""
import os
import sys
import threading
import time

from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesResult
import rospy

script, hook_time = sys.argv[1].split(), float((sys.argv[2:] or [0])[0])
hook_begun, main_ends = threading.Event(), threading.Event()


class Server(robust.SimpleActionServer):

    def __init__(self, name, execute_cb=None, **options):
        super().__init__(name + "/wash_dishes_as", WashTheDishesAction, execute_cb, auto_start=False, **options)
        self.preempted = threading.Event()
        self.register_preempt_callback(self.preempt_cb)

    def __len__(self):  # some programs have such a server: it is false in a condition
        return 0

    def preempt_cb(self):
        os.write(1, b"preempt callback\n")  # the signal may have interrupted print()
        self.preempted.set()

    def goal_cb(self):
        threading.Thread(target=self.work, args=[self.accept_new_goal()], daemon=True).start()

    def work(self, goal):
        result, text = WashTheDishesResult(["bowl-%d" % i for i in range(goal.number_of_minutes)]), ""
        for word in script:
            if word == "wait":
                self.rate(0.01).sleep()
            elif word == "poll":
                while not self.is_preempt_requested():
                    time.sleep(0.01)
            elif word == "preempt_callback":
                self.preempted.wait()
            elif word == "hook":
                hook_begun.wait()
            elif word == "work":
                time.sleep(60)
            elif word == "raise":
                raise ValueError("out of soap")
            elif word == "lock":
                self.action_server.lock.acquire()
                print("locked", flush=True)
            elif word == "block":
                self.register_preempt_callback(lambda: time.sleep(60))
            elif word == "stop_server":
                self.action_server.stop()
                print("stopped", flush=True)
            elif word == "no_threads":
                threading.stack_size(1 << 45)  # no computer has that memory
            elif word == "20_MB":
                result.dishes_washed = ["x" * 20000000]
            else:
                text = word.split("text:")[1]
        self.set_preempted(result, text)


def hook():
    hook_begun.set()
    time.sleep(hook_time)
    os.write(1, b"hook ended, preempt requested: %r\n" % first.is_preempt_requested())


def read_stdin():
    for line in sys.stdin:
        main_ends.set() if line == "end_main_thread\n" else rospy.signal_shutdown("the program says so")


rospy.init_node("shutdown_server")
rospy.on_shutdown(hook)
first = Server("first", lambda goal: first.work(goal))
second = Server("second", shutdown_timeout=2.0)
second.register_goal_callback(second.goal_cb)
for server in first, second:
    server.start()
threading.Thread(target=read_stdin, daemon=True).start()
print("ready", flush=True)
while not main_ends.wait(0.02) and not rospy.is_shutdown():
    pass
