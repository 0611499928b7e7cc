#!/usr/bin/python3
"""Servers as other people write them, on robust: guest_servers.py KIND …

The node guest with a server of wash_dishes_as of each KIND, a key of KINDS or WAYS (and a number); several have a
namespace each, KIND. INIT=rospy in the environment makes it a node of rospy's own.
"""
import os
import pathlib
import socket
import sys
import time

from actions_tutorial import robust
import rospy
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesFeedback, WashTheDishesResult
from std_msgs.msg import Empty

from raw_client import ABORTED, PREEMPTED, SUCCEEDED

RESULT = WashTheDishesResult(["bowl-0"])
DIRTY = "the pans are dirty"


def say(text):
    """On stderr, for a stdout may be stopped."""
    print(text, file=sys.stderr, flush=True)


class Guest(robust.SimpleActionServer):
    """Washes one bowl, and is done with a goal of 1; with any other, work(server) is what it does next.

    goal_cb, preempt_cb: called with the server; with a goal_cb there is no execute_cb.
    """

    def __init__(self, name, work, goal_cb=None, preempt_cb=lambda _: say("told to stop")):
        self.work = work
        super().__init__(name, WashTheDishesAction, None if goal_cb else self.execute_cb, False)
        if goal_cb:
            self.register_goal_callback(lambda: goal_cb(self))
        self.register_preempt_callback(lambda: preempt_cb(self))
        self.start()

    def execute_cb(self, goal):
        self.wash("bowl-0")
        if goal.number_of_minutes == 1:
            self.set_succeeded(RESULT)
        else:
            self.work(self)

    def wash(self, bowl):
        self.publish_feedback(WashTheDishesFeedback(bowl))


class OwnNames(Guest):
    """Has attributes of its own, by names that a library might think of, too."""

    rate = _rate = _closed = _shut_down = _shutting_down = _stopped = _ended = 3
    _lock = _server = _goal = _log = _end_goal = _end = _name = _state = _thread = None


# --- what a server does with a goal of its own ---

def wait_for_stop(server):
    while not server.is_preempt_requested():
        time.sleep(0.02)


def polite(server):
    wait_for_stop(server)
    server.set_preempted(RESULT)


def nap(server):
    rate = server.rate(0.01)
    say("sleeps")
    say("slept to the end: %s" % rate.sleep())


def sleep(server):
    nap(server)
    if server.is_preempt_requested():
        server.set_preempted(RESULT)


def loop(_):
    while not rospy.is_shutdown():
        time.sleep(0.02)


def block(*_):
    time.sleep(60)


def go_on(server):
    """Until long after its goal has been ended for it."""
    wait_for_stop(server)
    time.sleep(1.6)
    server.wash("bowl-1")
    server.set_succeeded(RESULT)
    server.action_server.publish_status()


def throw(error):
    raise error


def dirty(*_):
    throw(RuntimeError(DIRTY))


def feed_wrongly(server):
    try:
        server.wash(5)
    except Exception:
        server.wash("bowl-1")
        server.set_succeeded(WashTheDishesResult(["bowl-0", "bowl-1"]), "raised")


class Odd:
    """A result that fails with words of its own."""

    dishes_washed = property(lambda _: throw(ValueError("a \ud800 \x1b[2J\nfake bowl")))


class Wordless(Exception):
    __str__ = None


# --- the servers ---

def in_a_thread(server):
    return robust.shutdown.aside(server.execute_cb, server.accept_new_goal())


def with_silent_peers(name):
    server, address = Guest(name, sleep), rospy.impl.tcpros_base.get_tcpros_server_address()
    return server, [socket.create_connection(address) for _ in range(2)]


def that_is_stopped(name):
    """With actionlib's way to do so, when the node ends."""
    server = Guest(name, go_on)
    rospy.on_shutdown(server.action_server.stop)
    return server


KINDS = {
    "polite": lambda name: Guest(name, polite),
    "sleeps": lambda name: Guest(name, sleep),
    "sleeps_when_main_has_ended": lambda name: Guest(name, sleep),
    "never_looks": lambda name: Guest(name, block),
    "just_returns": lambda name: Guest(name, wait_for_stop),
    "preempt_cb_raises": lambda name: Guest(name, block, preempt_cb=dirty),
    "preempt_cb_raises_and_sleeps": lambda name: Guest(name, sleep, preempt_cb=dirty),
    "preempt_cb_blocks": lambda name: Guest(name, block, preempt_cb=lambda _: say("blocks") or block()),
    "goes_on": lambda name: rospy.on_shutdown(block) or Guest(name, go_on),
    "is_interrupted": lambda name: Guest(name, lambda one: loop(one) or throw(rospy.ROSInterruptException(DIRTY))),
    "goal_cb_and_thread": lambda name: Guest(name, sleep, in_a_thread),
    # Ends nothing: between a look and set_preempted a newer goal may come, which that would end (so in actionlib, too).
    "goal_cb_and_nap": lambda name: Guest(name, nap, in_a_thread),
    "goal_cb_accepts_twice": lambda name: Guest(name, sleep, lambda one: (in_a_thread(one), one.accept_new_goal())),
    "goal_cb_loops": lambda name: Guest(name, loop, lambda server: server.execute_cb(server.accept_new_goal())),
    "hook_raises": lambda name: rospy.on_shutdown(dirty) or Guest(name, polite),
    "hook_blocks": lambda name: rospy.on_shutdown(block) or Guest(name, polite),
    "own_names": lambda name: OwnNames(name, polite),
    "with_silent_peers": with_silent_peers,
    "is_stopped": that_is_stopped,
}

# kind: what it does with a goal, the ending of that, its text (regex), and a line in the log (regex)
WAYS = {
    "text_that_is_none": (lambda one: one.set_succeeded(RESULT, None), SUCCEEDED, "^all done$", ""),
    "text_that_is_an_object": (lambda one: one.set_succeeded(RESULT, pathlib.Path("/sink")), SUCCEEDED, "^/sink$", ""),
    "text_that_no_utf8_holds": (lambda one: one.set_succeeded(RESULT, "a \ud800 bowl"), SUCCEEDED, "^a .* bowl$", ""),
    "text_that_steers_terminals": (lambda one: one.set_succeeded(RESULT, "\x1b[2Jok\nfake"), SUCCEEDED, "ok", ""),
    "result_of_wrong_fields": (
        lambda one: one.set_succeeded(WashTheDishesResult(["bowl-0" * 100, 1])), ABORTED, "(?i)result",
        r"\[ERROR.*cannot be sent"),
    "result_that_no_utf8_holds": (
        lambda one: one.set_succeeded(WashTheDishesResult(["\ud800"])), ABORTED, "(?i)result", ""),
    "result_whose_error_no_utf8_holds": (lambda one: one.set_succeeded(Odd()), ABORTED, "(?i)result", ""),
    "result_that_is_no_message": (lambda one: one.set_aborted("bowl-0"), ABORTED, "(?i)result", ""),
    "feedback_that_is_wrong": (feed_wrongly, SUCCEEDED, "^raised$", ""),
    "execute_cb_that_raises": (
        lambda _: throw(RuntimeError("\x1b[2J" + DIRTY)), ABORTED, DIRTY, "Traceback"),
    "execute_cb_that_raises_what_has_no_words": (lambda _: throw(Wordless()), ABORTED, "Wordless", "Traceback"),
    "execute_cb_that_calls_sys_exit": (lambda _: sys.exit(DIRTY), ABORTED, DIRTY, "Traceback"),
    "execute_cb_without_an_ending": (lambda _: None, ABORTED, "without ending", ""),
    "ending_twice": (lambda one: one.set_succeeded(RESULT) or one.set_aborted(), SUCCEEDED, "^all done$", ""),
    "work_after_the_ending": (
        lambda one: one.set_succeeded(RESULT) or one.wash("bowl-1") or dirty(), SUCCEEDED, "^all done$", "Traceback"),
    "set_aborted_without_a_text": (lambda one: one.set_aborted(RESULT), ABORTED, "gave up", ""),
    "set_preempted_unasked": (lambda one: one.set_preempted(RESULT), PREEMPTED, r"^(?!.*cancel).*\w", ""),
}

if __name__ == "__main__":
    (rospy if os.environ.get("INIT") == "rospy" else robust).init_node("guest")
    kinds = [argument for argument in sys.argv[1:] if ":=" not in argument]
    KINDS.update((kind, lambda name, work=work: Guest(name, work)) for kind, (work, *_) in WAYS.items())
    servers = [KINDS[kind.rstrip("0123456789")]((kind + "/" if kinds[1:] else "") + "wash_dishes_as") for kind in kinds]
    rospy.Subscriber("~end", Empty, lambda _: rospy.signal_shutdown("the program's own wish"))
    if kinds != ["sleeps_when_main_has_ended"]:
        rospy.spin()
