"""Programs that the tests of servers and of the shutdown start, in test/: python3 -m robust.server_programs NAME …

They call the function NAME with the arguments (str). What a program prints is its finding. ACTIONLIB=plain in the
environment tries actionlib in idle and raise_in_main_thread.
"""
import gc
import os
import sys
import threading
import time
import weakref

import actionlib
from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesResult
import psutil
import rosgraph
import rospy

from support.printed import bowls
from support.processes import eventually
from support.states import NAMES

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


# Servers

def idle():
    """Exits with status 1 if a thread of an idle server wakes more often than for the status, 5 times a second."""
    def wakes():
        counts = {}
        for thread in psutil.Process().threads():
            with open(f"/proc/self/task/{thread.id}/status", encoding="utf-8") as file:
                counts[thread.id] = int(dict(line.split(":", 1) for line in file)["voluntary_ctxt_switches"])
        return counts

    rospy.init_node("idle")
    server = library.SimpleActionServer("work", WashTheDishesAction, print, auto_start=False)
    server.start()
    time.sleep(1)  # it starts
    before = wakes()
    time.sleep(2)
    most = max(count - before.get(thread, count) for thread, count in wakes().items())
    print("the thread that wakes most often did so", most, "times", flush=True)
    os._exit(most > 16)


def raise_in_main_thread():
    """A server with an execute_cb is started. Then the main thread raises."""
    rospy.init_node("raises")
    library.SimpleActionServer("work", WashTheDishesAction, print, auto_start=False).start()
    raise rospy.ROSException("failed")


def crashing_driver():
    """A server, driver, that prints "executes" for a goal, and crashes with exit status 1."""
    def goal_cb():
        server.accept_new_goal()
        print("executes", flush=True)
        os._exit(1)

    rospy.init_node("driver")
    server = robust.SimpleActionServer("driver", WashTheDishesAction, auto_start=False)
    server.register_goal_callback(goal_cb)
    server.start()
    print("ready", flush=True)
    rospy.spin()


def shutdown_server(script, hook_seconds="0"):
    """Two servers: first/wash_dishes_as, which has an execute_cb, and second/wash_dishes_as, which has a goal callback,
    and a shutdown_timeout of 2 s.

    hook_seconds: what a function given to rospy.on_shutdown takes. stdin: "end_main_thread" or "signal_shutdown".
    script: what each goal does: words that are carried out in turn. Then it calls set_preempted, with a
    bowl for each minute.

    | word | what the goal does |
    | --- | --- |
    | rate | waits at the server's rate until it should stop |
    | poll | looks every 0.01 s whether it should stop |
    | preempt_callback | waits until the preempt callback was called |
    | hook | waits until that function begins |
    | lock | the same, with the server's lock held |
    | work | works on for a minute |
    | raise | raises a ValueError |
    | return | returns without an outcome |
    | reject | the goal callback of second rejects it |
    | block | registers a preempt callback that takes a minute |
    | text:rinsed | gives set_preempted that text |
    """
    hook_begun, main_ends = threading.Event(), threading.Event()

    class Server(robust.SimpleActionServer):

        def __init__(self, name, execute_cb=None, **options):
            super().__init__(f"{name}/wash_dishes_as", WashTheDishesAction, execute_cb, auto_start=False, **options)
            self.preempted = threading.Event()
            self.register_preempt_callback(self.preempt_cb)

        def preempt_cb(self):
            os.write(1, b"preempt callback\n")  # the signal may have interrupted print()
            self.preempted.set()

        def goal_cb(self):
            if script == "reject":
                self.next_goal.set_rejected()
            else:
                threading.Thread(target=self.work, args=[self.accept_new_goal()], daemon=True).start()

        def work(self, goal):
            text = ""
            for word in script.split():
                if word == "rate":
                    self.rate(0.01).sleep()
                elif word == "poll":
                    while not self.is_preempt_requested():
                        time.sleep(0.01)
                elif word == "preempt_callback":
                    self.preempted.wait()
                elif word == "hook":
                    hook_begun.wait()
                elif word == "lock":
                    with self.action_server.lock:
                        hook_begun.wait()
                elif word == "work":
                    time.sleep(60)
                elif word == "raise":
                    raise ValueError("out of soap")
                elif word == "return":
                    return
                elif word == "block":
                    self.register_preempt_callback(lambda: time.sleep(60))
                else:
                    text = word.split("text:")[1]
            self.set_preempted(WashTheDishesResult(bowls(goal.number_of_minutes)), text)

    def hook():
        hook_begun.set()
        time.sleep(float(hook_seconds))
        os.write(1, f"hook ended, preempt requested: {first.is_preempt_requested()}\n".encode())

    def read_stdin():
        for line in sys.stdin:
            if line == "end_main_thread\n":
                main_ends.set()
            else:
                rospy.signal_shutdown("the program says so")

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


# Clients of the scripted server

def shutdown_client(words, how):
    """Sends a goal, waits and prints its state and get_failure().

    words: what the scripted server does. how:
    * default: without cancel_on_shutdown.
    * cancels: with cancel_on_shutdown.
    * signals_shutdown: the same, and done_cb calls rospy.signal_shutdown.
    * patrols: the same, and a thread sends the goal again and again until rospy.is_shutdown().
    """
    def done_cb(*_):
        if how == "signals_shutdown":
            print("done_cb", flush=True)
            rospy.signal_shutdown("done")

    rospy.init_node("shutdown_client", anonymous=True)
    client = robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=how != "default")
    client.wait_for_server()
    active = threading.Event()

    def patrol():
        while not rospy.is_shutdown():
            client.send_goal(TestRequestGoal(result_text=words), done_cb, active.set)
            client.wait_for_result()

    if how == "patrols":
        threading.Thread(target=patrol, daemon=True).start()
    else:
        client.send_goal(TestRequestGoal(result_text=words), done_cb, active.set)
    active.wait()
    print("active", flush=True)
    over = client.wait_for_result()
    print(over, NAMES[client.get_state()], client.get_failure(), flush=True)


# What is left of clients and servers that were dropped

def drop_all():
    """Makes, uses and drops 200 clients and 50 servers, after one of each, and prints what they leave."""
    def drop_client(number):
        client = robust.SimpleActionClient(f"client_{number}", TestRequestAction)
        client.send_goal(TestRequestGoal(), feedback_cb=print, done_cb=print)
        client.action_client.stop()
        return weakref.ref(client)

    def drop_server(number):
        server = robust.SimpleActionServer(f"server_{number}", TestRequestAction, auto_start=False)
        server.start()
        server.action_server.stop()
        return weakref.ref(server)

    rospy.init_node("drops")
    for drop, count in (drop_client, 200), (drop_server, 50):
        drop("first")
        time.sleep(1)  # rospy may start a thread of its own; the timer of a status ends when it wakes next
        threads, dropped = threading.active_count(), [drop(number) for number in range(count)]
        eventually(lambda: not any(gc.collect() and one() for one in dropped), "they are freed")
        eventually(lambda: threading.active_count() <= threads, "their threads end")
    published, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    print("left:", [topic for topic, nodes in published + subscribed if rospy.get_name() in nodes and "_" in topic],
          flush=True)


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
