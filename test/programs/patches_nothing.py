#!/usr/bin/env python3
"""Prints what changes when robust is imported and used: a line for each attribute, and at last "compared N"."""
import atexit
import contextlib
import inspect
import logging
import signal
import sys
import threading

import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy

MODULES = "actionlib", "genpy", "logging", "roscpp", "rosgraph", "rospy", "signal", "socket", "socketserver", "sys", \
    "threading", "atexit", "os", "time", "builtins", "xmlrpc", "roslib"
COUNTERS = {"sys.flags", "threading._counter", "threading._limbo", "sys.last_value"}


def snapshot():
    """Returns {name: object} of all attributes of these modules and their classes, and of what else one may set."""
    seen = {}
    for name, module in list(sys.modules.items()):
        if module and name.split(".")[0] in MODULES:
            for key, value in list(vars(module).items()):
                seen["%s.%s" % (name, key)] = value
                if inspect.isclass(value) and value.__module__ == name:
                    seen.update(("%s.%s.%s" % (name, key, inner), one) for inner, one in list(vars(value).items()))
    seen.update(("handler of signal %d" % number, signal.getsignal(number)) for number in range(1, signal.NSIG))
    for logger in logging.root, logging.getLogger("rosout"):
        for number, handler in enumerate(logger.handlers):
            seen["%s.handlers[%d]" % (logger.name, number)] = handler
            seen["%s.handlers[%d].__class__" % (logger.name, number)] = type(handler)
            seen.update(("%s.handlers[%d].%s" % (logger.name, number, key), value)
                        for key, value in vars(handler).items())
    seen["atexit functions"] = atexit._ncallbacks()
    return seen


def use(library, name):
    """A goal that succeeds and one that is cancelled."""
    def execute_cb(goal):
        while goal.number_of_minutes and not server.is_preempt_requested():
            rospy.sleep(0.01)
        server.set_preempted() if goal.number_of_minutes else server.set_succeeded()

    server = library.SimpleActionServer(name, WashTheDishesAction, execute_cb, auto_start=False)
    server.start()
    client = library.SimpleActionClient(name, WashTheDishesAction)
    client.wait_for_server()
    for minutes in 0, 1:
        client.send_goal(WashTheDishesGoal(minutes), feedback_cb=print)
        if minutes:
            client.cancel_goal()
        client.wait_for_result(rospy.Duration(30))


def report(before, after, what):
    for name in sorted(set(before) | set(after)):
        old, new = before.get(name, "nothing"), after.get(name, "nothing")
        # Numbers, texts and modules that were imported meanwhile are no patches.
        if old is not new and name not in COUNTERS and not inspect.ismodule(new) and (
                callable(old) or callable(new) or isinstance(old, logging.Handler)):
            print("%s changes %s: %s is %s" % (what, name, old, new))


def main():
    rospy.init_node("patches_nothing")
    use(actionlib, "plain")  # what rospy changes by itself
    threads, before = threading.active_count(), snapshot()
    from actions_tutorial import robust
    imported = snapshot()
    report(before, imported, "import")
    if threading.active_count() != threads or before["atexit functions"] != imported["atexit functions"]:
        print("import starts a thread or registers with atexit")
    use(robust, "robust")
    report(before, snapshot(), "use")
    print("compared %d" % len(before), flush=True)
    with contextlib.suppress(AttributeError):  # of Debian 11's rospy, see harness.py
        rospy.signal_shutdown("done")  # or the thread of actionlib's server goes on


if __name__ == "__main__":
    main()
