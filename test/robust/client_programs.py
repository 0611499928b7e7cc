"""Programs with a client that tests start, in test/: python3 -m robust.client_programs NAME [ARGUMENT …]

They call the function NAME with the arguments (str). What a program prints is its finding. ACTIONLIB=plain in the
environment tries actionlib instead of robust in simulated time.
"""
import os
import signal
import sys
import threading
import time

import actionlib
from actionlib.msg import TestRequestAction, TestRequestGoal
from actions_tutorial import robust
import rospy

from support.simulated_clock import SimulatedClock
from support.states import NAMES

library = actionlib if os.environ.get("ACTIONLIB") == "plain" else robust


# The shutdown

def sends_goal(words, option, value):
    """Sends a goal of these words with a client that has this option, waits for it and for 2 s more."""
    rospy.init_node("sends_goal")
    client = robust.SimpleActionClient("scripted", TestRequestAction, **{option: float(value)})
    client.wait_for_server()
    # os.write, since the signal may have interrupted print().
    client.send_goal(TestRequestGoal(result_text=words), done_cb=lambda state, _: os.write(
        1, f"done_cb {NAMES[state]}\n".encode()), active_cb=lambda: os.write(1, b"active\n"))
    client.wait_for_result()
    time.sleep(2)


class Interrupting(str):
    """A goal's id that sends SIGINT to this process when it is first serialized: rospy holds a lock then."""

    is_first = True

    def encode(self, *args):
        if Interrupting.is_first:
            Interrupting.is_first = False
            os.kill(os.getpid(), signal.SIGINT)
        return super().encode(*args)


def interrupted(call):
    """Ctrl-C comes within a call, cancel_goal or send_goal, of a client with cancel_on_shutdown."""
    def publish_and_interrupt(goal):
        client.action_client.pub_goal.publish(goal)
        time.sleep(0.2)  # the goal is on its way
        os.kill(os.getpid(), signal.SIGINT)

    rospy.init_node("interrupted")
    client = robust.SimpleActionClient("scripted", TestRequestAction, cancel_on_shutdown=True)
    client.wait_for_server()
    if call == "send_goal":
        client.action_client.manager.register_send_goal_fn(publish_and_interrupt)
    client.send_goal(TestRequestGoal(result_text="ACTIVE cancel result:PREEMPTED"))
    goal_id = client.gh.comm_state_machine.action_goal.goal_id
    goal_id.id = Interrupting(goal_id.id)
    client.cancel_goal()


def shutdown_while_connections_settle():
    """The node is shut down just after the server was connected."""
    def shut_down():
        client.action_client.wait_for_server()
        time.sleep(0.05)  # the other thread has seen it, too, and waits for 0.2 s
        rospy.signal_shutdown("connected")

    rospy.init_node("settles")
    client = robust.SimpleActionClient("scripted", TestRequestAction)
    threading.Thread(target=shut_down).start()
    print(client.wait_for_server(), client.get_failure(), flush=True)


# Simulated time. The test has set /use_sim_time

def no_clock_while_waiting_for_server():
    rospy.init_node("waits")
    client = library.SimpleActionClient("nobody", TestRequestAction)
    thread = threading.Thread(target=client.wait_for_server, args=[rospy.Duration(0.5)], daemon=True)
    thread.start()
    thread.join(5)
    print("waits" if thread.is_alive() else "ends", flush=True)


def clock_begins_while_waiting_for_server():
    rospy.init_node("waits")
    client = library.SimpleActionClient("nobody", TestRequestAction)
    thread = threading.Thread(target=client.wait_for_server, args=[rospy.Duration(20)], daemon=True)
    thread.start()
    thread.join(0.5)
    SimulatedClock()
    thread.join(1)
    print("waits" if thread.is_alive() else "ends", flush=True)


def goal_in_a_moment_of_simulated_time():
    rospy.init_node("sends")
    SimulatedClock().set(rospy.Time(1000))
    client = library.SimpleActionClient("scripted", TestRequestAction)
    client.wait_for_server()
    client.send_goal(TestRequestGoal())
    print(client.gh.comm_state_machine.action_goal.goal_id.id, flush=True)


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
