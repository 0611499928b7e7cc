# SPDX-License-Identifier: BSD-3-Clause
"""Action servers and clients that behave well for their goals: the calls of actionlib, and a few more.

    from actions_tutorial import robust

robust.SimpleActionServer and robust.SimpleActionClient take the place of actionlib's classes of the same names. What
else actionlib has, robust has, too. doc/robust.md is the reference.

Importing this module registers one function with rospy.on_shutdown, and changes nothing else. Import it before the
program registers its own, so that goals are asked to stop first.
"""
import time

import rospy
from actionlib import *  # noqa: F401, F403  # what is not replaced below

from . import client, server
from .client import SimpleActionClient  # noqa: F401
from .server import SimpleActionServer  # noqa: F401

__version__ = "2.0.0"


def _on_shutdown() -> None:
    """Ask servers and clients to end their goals. The function that this one registers is called last, and waits for
    the outcomes, so the program's own functions are not delayed."""
    waits: list = list(filter(None, [one._begin_shutdown() for one in [*server.servers, *client.clients]]))

    def wait_for_outcomes() -> None:
        for wait in waits:
            wait()
        time.sleep(0.1)  # rospy sends from threads of its own

    if waits:
        rospy.on_shutdown(wait_for_outcomes)


rospy.on_shutdown(_on_shutdown)
