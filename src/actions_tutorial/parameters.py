"""Private parameters that are checked: one of the wrong type or out of its range is named, with what is allowed.

A table describes them: {name: (default, type (int or float), lowest, highest, the last two in words)}.
"""
import sys

import rospy
from rospy.client import load_command_line_node_params


def get(table, name):
    """Return the parameter ~name of this node as its type. Raises ValueError."""
    return checked(table, name, rospy.get_param("~" + name, table[name][0]))


def from_command_line(table):
    """Return those given there, {name: value}, also before rospy.init_node, which fails with a traceback on broken YAML
    and on numbers of more than 32 bits. Raises ValueError, also for a name that is not in the table."""
    given = {}
    for argument in sys.argv[1:]:
        try:
            given.update(load_command_line_node_params([argument]))
        except rospy.ROSInitException:  # no YAML: judge it as text
            name, text = argument.split(":=")
            given[name[1:]] = text
    return {name: checked(table, name, value) for name, value in given.items()}


def checked(table, name, value):
    """Return value as the type of the parameter. Raises ValueError."""
    if name not in table:
        raise ValueError("~%s is no parameter, allowed are ~%s" % (name, ", ~".join(table)))
    _, kind, lowest, highest, allowed = table[name]
    if isinstance(value, bool) or not isinstance(value, (int, kind)) or not lowest <= value <= highest:
        raise ValueError("~%s is %r, allowed is %s" % (name, value, allowed))
    return kind(value)
