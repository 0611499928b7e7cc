# SPDX-License-Identifier: BSD-3-Clause
"""More reliable action servers and clients: the calls of actionlib, and a few more.

    from actions_tutorial import robust

robust.SimpleActionServer and robust.SimpleActionClient take the place of actionlib's classes of the same names. The
rest of actionlib is passed on. doc/robust.md says what differs from actionlib.

Importing this module registers one function with rospy.on_shutdown, and changes nothing else. Import it before the
program registers its own, so that goals are asked to stop first.

Undocumented behaviour of rospy that is used: a function registered with rospy.on_shutdown during the shutdown is still
called, after the others, since rospy does not copy its list of them.
"""
import threading
import time
import traceback

import actionlib
import rospy
from actionlib import *  # noqa: F401, F403  # what is not replaced below

from . import client, common, server
from .client import SimpleActionClient  # noqa: F401
from .server import SimpleActionServer  # noqa: F401

__all__ = [name for name in vars(actionlib) if not name.startswith("_")]
__version__ = "2.3.0"


def _on_shutdown() -> None:
    """Have threads ask servers and clients to end their goals, and another one end what is left: this may run in a
    signal's handler, which may have interrupted code that holds a lock. The function that it registers is called last,
    so the program's own functions are not delayed."""
    asks, ends = [], []
    for one in [each() for each in (*server.servers.valuerefs(), *client.clients.valuerefs())]:
        if isinstance(one, SimpleActionServer):  # of 2.2
            wait = one._begin_shutdown()
            if wait:
                rospy.on_shutdown(wait)
                rospy.on_shutdown(lambda: time.sleep(0.1))  # rospy sends from threads of its own
            continue
        begun = one is not None and one._robust_begin_shutdown()
        if begun:
            ask, end, deadline = begun
            asks.append((ask,))
            ends.append((end, deadline))
    if not ends:
        return
    ends.sort(key=lambda end: end[1])
    try:
        for ask in [*asks]:
            threading.Thread(target=_call, args=[[ask]], daemon=True).start()
            asks.remove(ask)
        ender = threading.Thread(target=_call, args=[ends], daemon=True)
        ender.start()
    except RuntimeError:  # Python 3.12 starts no thread while the interpreter ends, and no other at the limit
        _call([*asks, *ends])
        return
    latest = ends[-1][1] + 0.3
    rospy.on_shutdown(lambda: ender.join(max(0, latest - time.monotonic())))
    rospy.on_shutdown(lambda: time.sleep(0.1))  # rospy sends from threads of its own


def _call(calls: list) -> None:
    """Call functions, each with its arguments. If one raises, the others are called all the same."""
    for function, *args in calls:
        try:
            function(*args)
        except Exception:
            common.log(rospy.logerr, "robust: the shutdown of a goal failed\n%s", traceback.format_exc())


rospy.on_shutdown(_on_shutdown)
