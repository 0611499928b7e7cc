# SPDX-License-Identifier: BSD-3-Clause
"""What the server and the client both use."""
from __future__ import annotations

import contextlib
import io
import threading
from typing import Any, Callable

import genpy
import rospy
from actionlib_msgs.msg import GoalStatus

STATE_NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}

shutdown = threading.Event()  # set when the shutdown of the node begins


def log(write: Callable[..., None], *line: Any) -> None:
    """Call write(*line), such as rospy.loginfo. What it raises, as with a closed stdout, must not affect a goal."""
    with contextlib.suppress(Exception):
        write(*line)


def check_serializable(message: genpy.Message, **fields: Any) -> None:
    """Set these fields of a message, and serialize it as a trial: rospy sends half of a message that it cannot
    serialize in front of the next one. Raises rospy.ROSSerializationException if it cannot be sent."""
    for name, value in fields.items():
        setattr(message, name, value)  # the constructor would replace None
    try:
        message.serialize(io.BytesIO())
    except Exception as error:
        raise rospy.ROSSerializationException(str(error)) from error
