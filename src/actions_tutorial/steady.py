"""Mends from outside what rospy 1.15 and actionlib 1.14 leave open; each function says what happens without it."""
import logging
import os
import signal
import sys
import threading
import time

import actionlib
import rosgraph
import rospy
from rospy.impl.paramserver import get_param_server_cache
from rospy.impl.tcpros_base import init_tcpros_server


def init_node(name, timeout=0, interrupted=0):
    """Like rospy.init_node, for a node that ends within 2 s of SIGINT or SIGTERM, with exit status interrupted if it
    cannot end by itself. Raises rospy.ROSException if there is no master within timeout s (0: for ever), on shutdown.

    rospy's signal handler calls the master from the main thread, which may be in the midst of a call to it and would
    wait for itself for ever: ours does so in a thread. And rospy says on stdout that it waits for the master.
    """
    def shut_down(*_):
        threading.Thread(target=rospy.signal_shutdown, args=["interrupted"]).start()
        _end_by(1.8, interrupted)

    signal.signal(signal.SIGINT, shut_down)
    signal.signal(signal.SIGTERM, shut_down)
    sys.stdout.reconfigure(line_buffering=True)  # or a pipe would get the log in lumps, hours later
    wait_for("master " + rosgraph.get_master_uri(), rosgraph.is_master_online, timeout)
    _log_without_the_disk()
    rospy.init_node(name, disable_signals=True)
    _log_without_the_master()


def leave(status):
    """Close the node and end the process with status (int), within 2 s."""
    _end_by(1.8, status)
    rospy.signal_shutdown("done")
    sys.exit(status)


def _end_by(seconds, status):
    """A node that closes tells the master, and waits for minutes for one that is out of reach: then it goes without."""
    watchdog = threading.Timer(seconds, os._exit, [status])
    watchdog.daemon = True
    watchdog.start()


def _log_without_the_disk():
    """Once the disk for the log file is full, each line of log would cost a traceback. We say it once."""
    said = set()

    def handle_error(handler, _):
        if handler not in said:
            said.add(handler)
            sys.stderr.write("cannot log to %s: %s\n" % (getattr(handler, "baseFilename", handler), sys.exc_info()[1]))

    logging.Handler.handleError = handle_error


def _log_without_the_master():
    """rospy asks the master at each line of log whether to list the node's topics with it: a master that does not
    answer stops the node. And when a newer node takes our name, the question of our last line takes it back: the
    master shuts down the newer one, too. We ask once."""
    key = "/rosout_disable_topics_generation"
    get_param_server_cache().set(key, rospy.get_param(key, False))


def wait_for(what, is_there, timeout=0):
    """Wait until is_there() and say so every 5 s. Raises rospy.ROSException after timeout s (0: never), on shutdown."""
    begun = time.monotonic()
    say_next = begun + 5
    while not is_there() and not rospy.is_shutdown():
        now = time.monotonic()
        if 0 < timeout <= now - begun:
            raise rospy.ROSException("no %s within %g s (~server_timeout)" % (what, timeout))
        if now >= say_next:
            rospy.logwarn("waiting for the %s, %.0f s so far", what, now - begun)
            say_next += 5
        time.sleep(0.02)
    if rospy.is_shutdown():
        raise rospy.ROSException("shut down while waiting for the %s" % what)


# For servers

def start(a_server, goal_type):
    """Start an actionlib.SimpleActionServer that warns of repeated ids, keeps up its status and lets all peers in."""
    server = a_server.action_server

    def warn_of_repeated_id(goal):
        """actionlib ignores a goal with the id of a recent one, without a word."""
        with server.lock:
            known = [tracker.status.goal_id.id for tracker in server.status_list if tracker.goal]
        if goal.goal_id.id in known:
            rospy.logwarn("goal ignored: its id '%.60s' is that of a recent goal", goal.goal_id.id)

    rospy.Subscriber(rospy.remap_name(server.ns) + "/goal", goal_type, warn_of_repeated_id)  # called before actionlib's
    a_server.start()
    if server.status_timer:
        # actionlib's own timer, the clients' heartbeat, dies when the ROS clock is set back.
        server.status_timer.shutdown()
        server.status_timer = rospy.Timer(
            rospy.Duration(1 / server.status_frequency), server.publish_status_async, reset=True)
    # rospy reads the first bytes of a connection before it accepts the next one: a peer that connects and says nothing
    # would lock all others out. Each gets a thread here.
    tcp_server = init_tcpros_server().tcp_ros_server  # the one that is there
    handle = tcp_server.inbound_handler
    tcp_server.inbound_handler = lambda *peer: threading.Thread(target=handle, args=peer, daemon=True).start()


def end_goal(a_server, set_state, result, text):
    """End the goal of an actionlib.SimpleActionServer by one of its methods set_state, and make it forget the goal.

    It refuses goals with a stamp older than its last one's, even when that has ended: after one stamp from the future,
    or with a clock set back, it would serve nobody any more.
    """
    with a_server.action_server.lock, a_server.lock:
        set_state(result, text)
        if not a_server.is_new_goal_available():
            a_server.current_goal = a_server.next_goal = actionlib.ServerGoalHandle()


# For clients

def send_goal(client, goal, **callbacks):
    """Send a goal through an actionlib.SimpleActionClient, so that neither it nor an answer is lost. Returns its id."""
    # An answer that comes before send_goal has returned would be dropped as one to another goal: it waits for the lock.
    with client.action_client.manager.list_mutex:
        client.send_goal(goal, **callbacks)
    handle, message = client.gh, client.gh.comm_state_machine.action_goal

    def repeat():
        """rospy may connect twice and drop what was sent by then (rospy/topics.py); its id makes a repeat harmless."""
        time.sleep(1)
        while handle.get_comm_state() == actionlib.CommState.WAITING_FOR_GOAL_ACK and not rospy.is_shutdown():
            client.action_client.pub_goal.publish(message)
            time.sleep(1)

    threading.Thread(target=repeat, daemon=True).start()
    return message.goal_id.id
