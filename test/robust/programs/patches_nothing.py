#!/usr/bin/env python3
"""Imports robust, has a goal succeed, and prints what changed in other modules; at last "compared N".

Compared are the functions, classes and handlers in these modules and in their classes.
"""
import atexit
import logging
import signal
import sys

import actionlib
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal
import rospy

MODULES = "actionlib", "atexit", "genpy", "logging", "os", "rosgraph", "rospy", "signal", "socket", "sys", "threading"


def snapshot():
    """Returns {name: object} of what one may patch."""
    owners = {name: module for name, module in list(sys.modules.items()) if name.split(".")[0] in MODULES}
    for name, module in list(owners.items()):
        owners.update(("%s.%s" % (name, key), one) for key, one in list(vars(module).items()) if isinstance(one, type))
    found = {"%s.%s" % (name, key): one for name, owner in owners.items() for key, one in list(vars(owner).items())
             if callable(one) and name + "." + key not in owners}
    found.update(("signal %d" % number, signal.getsignal(number)) for number in range(1, signal.NSIG))
    found.update(("handlers of %s" % name, logging.getLogger(name).handlers[:]) for name in ("", "rosout"))
    found["functions of atexit"] = atexit._ncallbacks()
    return found


def use(library, name):
    server = library.SimpleActionServer(name, WashTheDishesAction, lambda _: server.set_succeeded(), False)
    server.start()
    client = library.SimpleActionClient(name, WashTheDishesAction)
    client.wait_for_server()
    client.send_goal_and_wait(WashTheDishesGoal(), rospy.Duration(30))


rospy.init_node("patches_nothing", disable_signals=True)
use(actionlib, "plain")  # what rospy changes by itself
before = snapshot()
from actions_tutorial import robust  # noqa: E402
use(robust, "robust")
after = snapshot()
for changed in [name for name in before if before[name] != after.get(name)]:
    print("change of %s" % changed)
print("compared %d" % len(before), flush=True)
