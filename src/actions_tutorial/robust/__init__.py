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
    """Ask servers and clients to end their goals. The functions that this one registers are called last, and wait for
    the outcomes, so the program's own functions are not delayed."""
    waits = []
    for reference in [*server.servers.valuerefs(), *client.clients.valuerefs()]:
        server_or_client = reference()
        try:
            wait = server_or_client and (
                server_or_client._begin_shutdown() if isinstance(server_or_client, SimpleActionServer)
                else server_or_client._robust_begin_shutdown())
        except Exception:  # the other goals are ended all the same
            common.log(rospy.logerr, "robust: the shutdown of a goal failed\n%s", traceback.format_exc())
            continue
        if wait:
            waits.append(wait)
    if waits:
        waits.append(lambda: time.sleep(0.1))  # rospy sends from threads of its own
    for wait in waits:
        rospy.on_shutdown(wait)


rospy.on_shutdown(_on_shutdown)
