"""Checks at the start that rospy and actionlib have the undocumented names that robust uses."""
import importlib.metadata

import actionlib  # noqa: F401  # gives GoalStatus its to_string
import rospy
from actionlib_msgs.msg import GoalStatus

TESTED = {"rospy": "1.15.9 to 1.17.4", "actionlib": "1.13.2 to 1.14.3"}


def need(library, owner, *names):
    """Raises rospy.ROSInitException if owner, a part of library (a key of TESTED), lacks one of names (str).

    Without it, another version of the library ends in a traceback some time later, or in a node that hangs.
    """
    for name in names:
        if not hasattr(owner, name):
            raise rospy.ROSInitException("%s %s has no %s.%s, which robust needs; it was tested with %s %s" % (
                library, importlib.metadata.version(library), getattr(owner, "__name__", type(owner).__name__), name,
                library, TESTED[library]))


def is_initialized():
    """Returns whether rospy.init_node has done its work."""
    need("rospy", rospy.core, "is_initialized")
    return rospy.core.is_initialized()


def name_of(state):
    """Returns the name (str) of a state of actionlib_msgs/GoalStatus (int)."""
    need("actionlib", GoalStatus, "to_string")
    return GoalStatus.to_string(state)
