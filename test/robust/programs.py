#!/usr/bin/env python3
"""Programs that tests start: programs.py NAME [ARGUMENT …] calls the function NAME.

What a program prints is its finding. ACTIONLIB=plain in the environment tries actionlib instead of robust in next_goal
and in those of known_issue.
"""
import gc
import os
import signal
import sys
import threading
import time
import weakref

import actionlib
from actionlib.msg import TestRequestAction, TestRequestGoal
from actionlib_msgs.msg import GoalStatus
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesActionGoal, WashTheDishesGoal
import rosgraph
import rospy

sys.path.insert(0, os.path.realpath(__file__ + "/../.."))  # test/, where support is
from support.processes import eventually
from support.simulated_clock import SimulatedClock
from support.states import NAMES, PENDING

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


# Servers

def crashing_driver():
    """A robust server, driver, that prints "executes" for a goal, and crashes with exit status 1."""
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


def next_goal():
    """A server that prints "executes N" for goal N, and sends itself the next goal for each line on stdin."""
    def execute_cb(goal):
        print("executes", goal.number_of_minutes, flush=True)
        while not server.is_preempt_requested():
            rospy.sleep(0.05)
        server.set_preempted()

    rospy.init_node("next_goal")
    server = library.SimpleActionServer("next_goal", WashTheDishesAction, execute_cb, auto_start=False)
    server.start()
    goals = rospy.Publisher("next_goal/goal", WashTheDishesActionGoal, queue_size=10, latch=True)
    for number in range(1, 100):
        goals.publish(WashTheDishesActionGoal(goal=WashTheDishesGoal(number_of_minutes=number)))
        sys.stdin.readline()


def servers_and_clients():
    """Five robust servers and three clients of each, whose topics take a while to close. Prints "ready" when all are
    connected."""
    rospy.init_node("servers_and_clients")
    names = ["action_%d" % number for number in range(5)]
    servers = [robust.SimpleActionServer(name, WashTheDishesAction, print, auto_start=False) for name in names]
    for server in servers:
        server.start()
    clients = [robust.SimpleActionClient(name, WashTheDishesAction) for name in names * 3]
    for client in clients:
        client.wait_for_server()
    print("ready", flush=True)
    rospy.spin()


# Clients of the scripted server

def shutdown_client(words, how, hook="0"):
    """Sends a goal, waits and prints its state and get_failure().

    words: what the scripted server does. hook: seconds that a function given to rospy.on_shutdown takes. how:
    * default: without cancel_on_shutdown.
    * cancels: with cancel_on_shutdown.
    * stops_another: the same beside ten such clients with a goal whose action_client was stopped.
    * breaks_another: the same beside ten such clients whose action_client was set to None, too.
    * signals_shutdown: with cancel_on_shutdown, and done_cb calls rospy.signal_shutdown.
    """
    def done_cb(*_):
        if how == "signals_shutdown":
            print("done_cb", flush=True)
            rospy.signal_shutdown("done")

    rospy.init_node("shutdown_client", anonymous=True)
    # os.write, since the signal may have interrupted print().
    rospy.on_shutdown(lambda: time.sleep(float(hook)) or os.write(1, b"hook ended\n"))
    clients = [robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=how != "default")
               for _ in range(11 if how.endswith("another") else 1)]
    client = clients.pop(len(clients) // 2)  # neither the first nor the last
    client.wait_for_server()
    for another in clients:
        another.send_goal(TestRequestGoal(result_text="ACTIVE"))
        another.action_client.stop()
        if how == "breaks_another":
            another.action_client = None
    active = threading.Event()
    client.send_goal(TestRequestGoal(result_text=words), done_cb, active.set)
    active.wait()
    print("active", flush=True)
    over = client.wait_for_result()
    print(over, NAMES[client.get_state()], client.get_failure(), flush=True)


def shutdown_while_connections_settle():
    """The node is shut down just after the server was connected."""
    rospy.init_node("shutdown")
    client = robust.SimpleActionClient("scripted", TestRequestAction)

    def shut_down():
        client.action_client.wait_for_server()
        time.sleep(0.05)  # the other thread has seen it, too, and waits for 0.2 s
        rospy.signal_shutdown("connected")

    threading.Thread(target=shut_down).start()
    print(client.wait_for_server(), client.get_failure(), flush=True)


def goal_at_exit_without_threads():
    """A goal with a heartbeat_timeout is sent while the interpreter ends and starts no more threads."""
    rospy.init_node("goal")

    def send():
        threading.stack_size(1 << 46)  # no computer has that memory
        client.send_goal(TestRequestGoal())
        print("sent", flush=True)

    client = robust.SimpleActionClient("scripted", TestRequestAction, heartbeat_timeout=30)
    client.wait_for_server()
    rospy.on_shutdown(send)


def two_arms(kind):
    """A program for actionlib, with the import changed: two arms move, and SIGINT stops both, as public drivers do it.

    kind: is_not_none or true, how the handler looks at gh.
    """
    stopped = threading.Event()

    def stop(*_):
        for arm in arms:
            if arm.gh if kind == "true" else arm.gh is not None:
                if arm.get_state() == GoalStatus.ACTIVE:
                    arm.cancel_goal()
        stopped.set()

    rospy.init_node("two_arms", disable_signals=True)
    arms = [robust.SimpleActionClient("scripted", TestRequestAction) for _ in range(2)]
    for arm in arms:
        arm.wait_for_server()
        arm.send_goal(TestRequestGoal(result_text="ACTIVE cancel result:PREEMPTED"))
    while not all(arm.get_state() == GoalStatus.ACTIVE for arm in arms):
        time.sleep(0.01)
    signal.signal(signal.SIGINT, stop)
    print("both move", flush=True)
    while not stopped.is_set():
        time.sleep(0.01)
    print([arm.wait_for_result(rospy.Duration(20)) and arm.get_state() for arm in arms], flush=True)


# What is left of those that were dropped

def drops_clients():
    """Makes and drops 200 clients, and 50 servers, and prints what they leave."""
    rospy.init_node("drops_clients")
    print("clients", leave_clients())
    plain, ours = leave_servers(actionlib), leave_servers(robust)
    print("servers", all(one <= other for one, other in zip(ours, plain)), plain, ours, flush=True)
    rospy.signal_shutdown("done")


def topics(word):
    """Returns the topics (set of str) with word in their names that this node still publishes or subscribes to."""
    published, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
    return {topic for topic, nodes in published + subscribed if rospy.get_name() in nodes and word in topic}


def leave_clients():
    """Returns the clients, threads and topics (int) that are left."""
    threads, clients = threading.active_count(), []
    for number in range(200):
        client = robust.SimpleActionClient("client_%d" % number, TestRequestAction)
        client.send_goal(TestRequestGoal(), feedback_cb=print, done_cb=print)
        client.action_client.stop()
        clients.append(weakref.ref(client))
        del client
    gc.collect()
    return sum(one() is not None for one in clients), threading.active_count() - threads, len(topics("client_"))


def leave_servers(module):
    """Returns the threads and topics (int) that are left."""
    threads = threading.active_count()
    for number in range(50):
        name = "server_%s_%d" % (module.__name__.split(".")[-1], number)
        server = module.SimpleActionServer(name, WashTheDishesAction, print, auto_start=False)
        server.start()
        server.action_server.stop()
    time.sleep(1)  # a timer ends when it wakes next
    return threading.active_count() - threads, len(topics("server_"))


# What users of actionlib have reported

def known_issue(name):
    """Prints "ready", and calls the function name, one of those below. The test starts those with a clock in simulated
    time."""
    rospy.init_node("known_issue")
    print("ready", flush=True)
    globals()[name]()
    sys.stdout.flush()
    rospy.signal_shutdown("done")  # or the thread of actionlib's server goes on


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
    globals()[sys.argv[1]](*sys.argv[2:])
