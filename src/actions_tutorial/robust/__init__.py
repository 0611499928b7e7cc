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
from typing import Any, Callable

import actionlib
import rospy
from actionlib import *  # noqa: F401, F403  # what is not replaced below

from . import client, common, rate, server
from .client import SimpleActionClient  # noqa: F401
from .server import SimpleActionServer  # noqa: F401

__all__ = [name for name in vars(actionlib) if not name.startswith("_")]
__version__ = "2.3.0"


def _on_shutdown() -> None:
    """Ask servers and clients to end their goals, and wait for the outcomes. This may run in a signal's handler, and
    may have interrupted code that holds a lock, so threads publish and call the program. The function that waits is
    called last, so it does not delay those of the program."""
    common.shutdown.set()
    servers, clients = _begin(server.servers), _begin(client.clients)
    asks = [rate.wake] + [ask for ask, _, _ in servers + clients]
    ends = sorted([(deadline, end) for _, end, deadline in servers if end], key=lambda one: one[0])
    ender = threading.Thread(target=_end, args=[ends], daemon=True)
    try:
        ender.start()
        while asks:
            threading.Thread(target=_call, args=asks[:1], daemon=True).start()  # it may block, in a callback
            del asks[0]
    except RuntimeError:  # Python 3.12 starts no thread while the interpreter ends
        for ask in asks:
            _call(ask)
        _end(ends)
    if ends or clients:
        rospy.on_shutdown(lambda: _wait(ender, ends, clients))


def _begin(objects: Any) -> list:
    """Returns what each server or client has to do on shutdown."""
    alive = [one for one in [reference() for reference in objects.valuerefs()] if one is not None]
    return list(filter(None, [_call(one._robust_begin_shutdown) for one in alive]))


def _end(ends: list) -> None:
    for deadline, end in ends:
        _call(end, deadline)


def _wait(ender: threading.Thread, ends: list, clients: list) -> None:
    for _, end, deadline in clients:  # in this thread: it releases the client's lock, which it may have interrupted
        _call(end, deadline)
    while ends and ender.is_alive() and time.monotonic() < ends[-1][0] + 0.3:
        time.sleep(0.01)
    time.sleep(0.1)  # rospy sends from threads of its own


def _call(function: Callable[..., Any], *args: Any) -> Any:
    """Call function, and return what it returns. What it raises is logged: the other goals are ended all the same."""
    try:
        return function(*args)
    except Exception:
        return common.log(rospy.logerr, "robust: the shutdown of a goal failed\n%s", traceback.format_exc())


rospy.on_shutdown(_on_shutdown)
