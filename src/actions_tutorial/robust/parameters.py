# SPDX-License-Identifier: BSD-3-Clause
"""Checks parameters and arguments: a wrong one is named, with its value and what is allowed."""
from __future__ import annotations

import contextlib
import math
import sys
from typing import Any, Optional

import rosgraph
import rospy
import yaml

_rospy_get_param = rospy.get_param  # a program may put ours in its place
_UNSPECIFIED = object()
_KINDS = {int: "a whole number", float: "a number", str: "a string", bool: "true or false", list: "a list",
          dict: "a dictionary"}
_ROS_S_OWN = "__name", "__ns", "__log", "__master", "__ip", "__hostname"


def get_param(param_name: str, default: Any = _UNSPECIFIED, *, lowest: Optional[float] = None,
              highest: Optional[float] = None) -> Any:
    """Get a parameter, as rospy.get_param does, and check its value: it has the type of default, and a number lies from
    lowest to highest (None: no limit). Without a default, with one of None, or of a type not ROS's, nothing is checked.

    Before init_node it knows the private parameters of the command line, so that a node can refuse those first.
    Raises ValueError with parameter, value and what is allowed, KeyError if there is neither value nor default.
    """
    in_rospys_place = rospy.get_param is get_param and lowest is highest is None  # programs written for rospy convert
    return _get(param_name, default, lowest, highest, checks=not in_rospys_place)


def _get(param_name, default, lowest, highest, checks=True):
    given = _from_command_line(param_name)
    started = rospy.core.is_initialized()
    own = param_name[:1] == "~"
    if default is _UNSPECIFIED:
        return given[param_name] if own and not started else _rospy_get_param(param_name)
    value = given.get(param_name, default) if own and not started else _rospy_get_param(param_name, default)
    kind = type(default)
    if kind not in _KINDS or not checks:
        return value
    right = isinstance(value, (int, float) if kind is float else kind) and isinstance(value, bool) == (kind is bool)
    if right and (lowest is None or lowest <= value < math.inf) and (highest is None or -math.inf < value <= highest):
        with contextlib.suppress(OverflowError):  # of a whole number that no float holds
            return kind(value)

    must_be = _KINDS[kind]
    for word, limit in (("from", lowest), ("to", highest)):
        if limit is not None:
            must_be += " %s %.12g" % (word, limit)
    if any(argument.startswith("__log:=") for argument in sys.argv):  # which only roslaunch gives
        must_be += "; this one is from the launch"
    elif started and param_name not in given and value is not default:  # ROS keeps the parameters of earlier runs
        must_be += "; this one is from the parameter server; `rosparam delete %s`" % (
            rospy.get_name() if own else rospy.resolve_name(param_name))
    raise ValueError("%s is %r, must be %s" % (param_name, value, must_be))


def get_params(table):
    """Returns the values (tuple) of the parameters in table, {name: (default, lowest, highest)}. Raises ValueError."""
    return tuple(_get(name, *row) for name, row in table.items())


def check_arguments(arguments, known, node):
    """Raises ValueError for one (str) that sets none of the known private parameters ([~NAME]) of node (str) and is
    nothing that ROS knows. Without it, ROS takes a misspelt parameter, and `name:=3` for a topic renamed to 3."""
    for argument in arguments:
        name, _, value = argument.partition(":=")
        if ":=" in value or not value or not rosgraph.names.is_legal_remap(argument):
            raise ValueError("unknown argument %r, must be --help or, as in _NAME:=VALUE, set one of %s" % (
                argument, ", ".join(known)))
        if name[0] == "_" and name not in _ROS_S_OWN and "~" + name[1:] not in known:
            raise ValueError("unknown parameter ~%s, must be one of %s%s" % (
                name[1:], ", ".join(known), "; __name:=VALUE names the node" if name == "_name" else ""))
        for own in (one[1:] for one in known):
            if name.lstrip("~/") == own or ("/" + name).endswith("/%s/%s" % (node, own)):
                raise ValueError("%r renames a topic, must be _%s:=%s to set the parameter" % (argument, own, value))


def _from_command_line(param_name):
    """Returns {param_name: value} if the command line gives that private parameter, else {}."""
    given = {}
    for argument in sys.argv[1:]:
        name, _, text = argument.partition(":=")
        if param_name == "~" + name[1:] and name[:1] == "_":
            given[param_name] = text
            with contextlib.suppress(yaml.YAMLError, ValueError):  # of 2024-13-45, too: judge it as text
                given[param_name] = yaml.safe_load(text)
    return given
