#!/usr/bin/python3
"""Programs that show what users of actionlib have reported: reports_programs.py NAME [ARGUMENT]

A node with the program's name; NAME is that of a function here. What it prints is its finding.
"""
import contextlib
import faulthandler
import gc
import os
import socket
import sys
import threading
import time
import weakref
import xmlrpc.client

import actionlib
import rospy
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatus, GoalStatusArray

from actions_tutorial.msg import WashTheDishesAction
from processes import eventually
from raw_server import PATIENCE, RawServer, client_of, library
from simulated_clock import SimulatedClock


@contextlib.contextmanager
def forward(address, delay):
    """Gives a port whose connections are forwarded to address; each piece gets there delay (s) late."""
    def pump(source, sink):
        with contextlib.suppress(OSError):
            for piece in iter(lambda: source.recv(65536), b""):
                time.sleep(delay)
                sink.sendall(piece)
            sink.shutdown(socket.SHUT_WR)

    def accept():
        with contextlib.suppress(OSError):
            while True:
                ends = listener.accept()[0], socket.create_connection(address)
                for pair in ends, ends[::-1]:
                    threading.Thread(target=pump, args=pair, daemon=True).start()

    with socket.create_server(("localhost", 0)) as listener:
        threading.Thread(target=accept, daemon=True).start()
        yield listener.getsockname()[1]


endings = []  # the names of the states in which the goals of send() have ended


def serve(name, execute):
    server = library.SimpleActionServer(name, TestAction, execute, False)
    server.start()
    return server


def serve_at_once(name):
    server = serve(name, lambda goal: server.set_succeeded())
    return server


def meet(name):
    client = client_of(name, TestAction)
    client.wait_for_server()
    return client


def send(client, goal=0):
    client.send_goal(TestGoal(goal), lambda state, _: endings.append(GoalStatus.to_string(state)))


def ended(count=1):
    eventually(lambda: len(endings) >= count, "more endings than %s" % endings, timeout=15)


def server(name):
    """It runs until it is stopped."""
    serve_at_once(name)
    print("ready", flush=True)
    rospy.spin()


def clock_and_server(name):
    SimulatedClock()
    server(name)


def client(name):
    send(meet(name))
    ended()
    print(endings[-1])


def works():
    """A server of actionlib's own, as most are: it works a goal's seconds in its goal callback, with its lock held."""
    def work():
        goal = server.accept_new_goal()
        print("works", flush=True)
        time.sleep(goal.number_of_minutes)
        server.set_succeeded()

    server = actionlib.SimpleActionServer("works", WashTheDishesAction, None, False)
    server.register_goal_callback(work)
    server.start()
    print("ready", flush=True)
    rospy.spin()


def fails():
    server = library.SimpleActionServer("work", TestAction, auto_start=False)
    server.register_goal_callback(server.accept_new_goal)
    server.start()
    raise rospy.ROSException("failed")


def clock_set_back(before):
    """A goal on a clock that was set back after what its argument names."""
    def execute(goal):
        while goal.goal and not server.is_preempt_requested():
            time.sleep(0.01)
        (server.set_preempted if goal.goal else server.set_succeeded)()

    clock, stamps = SimulatedClock(), set()
    server = serve("work", execute)
    client = meet("work")
    send(client, goal=int(before != "ended"))
    if before == "ended":
        ended()
    eventually(lambda: client.get_state() == GoalStatus.ACTIVE or endings, "a goal that runs")
    if before == "cancelled":
        client.cancel_goals_at_and_before_time(clock.now)
        ended()
    clock.set(clock.now - rospy.Duration(300))
    if before == "heartbeat":
        rospy.Subscriber("work/status", GoalStatusArray, lambda message: stamps.add(message.header.stamp))
        eventually(lambda: clock.turn(0.1) or sum(one <= clock.now for one in stamps) > 5, "a heartbeat", timeout=10)
    send(client)
    ended(len(endings) + 1)
    print(endings[-1])


def clock_begins(what):
    """A wait for what its argument names, while a clock begins."""
    waited, raw = [], RawServer("raw")
    late, goal = client_of("late", TestAction), raw.send()
    wait, timeout = {"server": (late.wait_for_server, 10), "result": (raw.client.wait_for_result, 10),
                     "nothing": (late.wait_for_server, 0.5)}[what]
    waits = threading.Thread(target=lambda: waited.append(wait(rospy.Duration(timeout))), daemon=True)
    waits.start()
    waits.join(10 if what == "nothing" else 0.5)  # so that it waits, or the fault were missed
    if what != "nothing":
        SimulatedClock()
        waits.join(0.5)  # the fault itself: it ends now
        serve_at_once("late")
        raw.result(goal)
        waits.join(10)
    print(waited)


def leave_nothing():
    here = weakref.WeakSet()

    def come_and_go(number):
        # Not at once: actionlib's client may drop what comes before send_goal returns.
        server = serve("work_%d" % number, lambda goal: [time.sleep(0.05), server.set_succeeded()])
        client = meet("work_%d" % number)
        here.update((client, server))
        send(client)
        client.wait_for_result()
        client.action_client.stop()
        server.action_server.stop()
        server.__del__()

    def left():
        gc.collect()
        node = xmlrpc.client.ServerProxy(rospy.get_node_uri())
        requests = [one for one in threading.enumerate() if "process_request" in str(getattr(one, "_target", ""))]
        return threading.active_count() - len(requests), len(node.getBusInfo("/t")[2]), len(here), len(requests)

    for number in range(3):
        come_and_go(number)
    lefts = [left()]
    eventually(lambda: lefts.append(left()) or lefts[-1] == lefts[-10:][0] and len(lefts) > 10, "no change", pause=0.2)
    for number in range(20):
        come_and_go(number)
    try:
        # The master keeps some threads here for its requests, now more and now less; a leak of ours would be 20.
        eventually(lambda: all(now <= then + more for now, then, more in zip(left(), lefts[-1], (1, 1, 1, 9))),
                   "threads, connections, objects, requests after 20 more as after 3, %s" % (lefts[-1],), timeout=10)
    except AssertionError:
        print(left(), *here)
        faulthandler.dump_traceback()
        raise
    print("nothing")


def short_waits():
    serve_at_once("work")
    client, found = client_of("work", TestAction), False
    for _ in range(10):
        found = found or client.wait_for_server(rospy.Duration(0.01))
        time.sleep(0.5)  # the fault itself: longer than it takes to look
    before = threading.active_count()
    nobodies = [client_of("nobody_%d" % number, TestAction) for number in range(5)]
    for nobody in nobodies * 3:
        assert not nobody.wait_for_server(rospy.Duration(0.01))
    eventually(lambda: threading.active_count() <= before + 5, "one thread a client that waits", timeout=10)
    for nobody in nobodies:
        nobody.action_client.stop()
    eventually(lambda: threading.active_count() <= before, "no thread of clients that were stopped", timeout=10)
    print(found)


def fast():
    serve_at_once("work")
    client = meet("work")
    for number in range(200):
        send(client)
        number % 2 or client.wait_for_result(PATIENCE)
    print(client.wait_for_result(PATIENCE), endings[-1])


def pauses():
    """Goals of a server whose callback goes on for a moment after it has ended its goal."""
    server = serve("work", lambda goal: [server.set_succeeded(), time.sleep(0.01)])
    client, took = meet("work"), []
    for _ in range(21):
        begun = time.monotonic()
        client.send_goal(TestGoal())
        client.wait_for_result()
        took.append(time.monotonic() - begun)
    print(sorted(took)[10] < 0.08 or took)


if __name__ == "__main__":
    program, arguments = sys.argv[1], rospy.myargv()[2:]
    rospy.init_node(program, disable_signals=True)
    globals()[program](*arguments)
    sys.stdout.flush()
    os._exit(0)  # how actionlib's server ends is not what is tried here
