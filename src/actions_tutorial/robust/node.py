# SPDX-License-Identifier: BSD-3-Clause
"""init_node: a node that starts, or says in one line why it cannot."""
from __future__ import annotations

import contextlib
import functools
import logging
import sys
import threading
import time
import urllib.parse
from typing import Any, Dict, List, Optional, Tuple

import rosgraph
import rospy

from . import log, peers, stdout
from .internals import NO_ANSWER, CannotStart, ask, cannot_start, need, why
from .parameters import check_arguments, get_params
from .shutdown import Closer

_rospy_init_node = rospy.init_node  # a program may put ours in its place


def init_node(name: str, argv: Optional[List[str]] = None, anonymous: bool = False, log_level: Optional[int] = None,
              disable_rostime: bool = False, disable_rosout: bool = False, disable_signals: bool = False,
              xmlrpc_port: int = 0, tcpros_port: int = 0, *, usage: Optional[str] = None,
              parameters: Optional[Dict[str, Tuple[Any, Any, Any]]] = None) -> Tuple[Any, ...]:
    """Start the node, as rospy.init_node does, so that it ends within 2 s of SIGINT, SIGTERM and SIGHUP, and that no
    line of log can stop or fail it.

    usage: what --help prints (str). With it, unknown arguments are refused.
    parameters: {"~NAME": (default, lowest, highest)}, the private parameters. One that is called ~server_timeout is
        also how long to wait for the master (real s; 0: for ever).

    Returns the values (tuple) of parameters, also when it is called again. Raises ValueError for a name that is none
    (and when it is called again for a parameter), rospy.ROSInitException for whatever else prevents the start;
    uncaught, the latter is one line and exit status 1. A wrong argument or parameter is one line and exit status 2.
    """
    arguments, parameters = (sys.argv if argv is None else argv)[1:], parameters or {}
    options = name, argv, anonymous, log_level, disable_rostime, disable_rosout
    ports = dict(xmlrpc_port=xmlrpc_port, tcpros_port=tcpros_port)
    if rospy.core.is_initialized():
        _rospy_init_node(*options, disable_signals, **ports)
        return get_params(parameters)

    closer = Closer()
    try:
        if not disable_signals:
            closer.heed_signals()  # from here on Ctrl-C is no traceback; it is obeyed when the checks are done
        values, uri = _check(name, arguments, usage, parameters)
        closer.begin()  # from here on a signal ends the node, whatever the main thread waits for
        _wait_for_master(uri, dict(zip(parameters, values)).get("~server_timeout", 0))
        _start(options, ports)
        record = rospy.client._init_node_args
        rospy.client._init_node_args = record[:-1] + (disable_signals,)  # for a library that calls rospy.init_node, too
        log.ask_the_master_once()
        stdout.take_over(closer.close)
        peers.serve_all_peers()
        with _exit_status_2():
            return get_params(parameters)
    except BaseException as error:
        if not rospy.core.is_initialized():
            closer.give_up()
        if not closer.ident or isinstance(error, (CannotStart, ValueError)) or not isinstance(error, Exception):
            raise
        raise cannot_start("the node %s cannot start: %s" % (name, why(error))) from error
    finally:
        closer.start_is_over()


def wait_for(what, is_there, timeout=0):
    """Wait until is_there() and say every 5 s what for. Returns False on shutdown and after timeout s of real time
    (0: never; below 0: at once)."""
    begun = time.monotonic()
    say_next = begun + 5
    while not is_there():
        now = time.monotonic()
        if rospy.is_shutdown() or (timeout and now - begun >= timeout):
            return False
        if now >= say_next:
            rospy.logwarn("waiting for the %s, %.0f s so far", what, say_next - begun)
            say_next += 5
        time.sleep(0.02)
    return True


def _check(name, arguments, usage, parameters):
    """Returns the values of parameters and the master's URI. Refuses what can be refused without a master."""
    if not name or "/" in name:
        raise ValueError("namespaces are not allowed in node names" if name else "name must not be empty")
    if usage and {"-h", "--help"} & set(arguments):
        print(usage.strip())
        sys.exit(0)
    with _exit_status_2():
        if usage:
            given = dict(argument.partition(":=")[::2] for argument in arguments)
            check_arguments(arguments, list(parameters), given.get("__name", name))
        values = get_params(parameters)
    # Without it, what is wrong is said in words such as "too many values to unpack".
    for argument in arguments:
        if argument.count(":=") > 1 and rosgraph.names.is_legal_remap(argument):
            raise cannot_start("the argument is %r, must be NAME:=VALUE" % argument)
    uri = rosgraph.get_master_uri()
    with contextlib.suppress(ValueError):  # of the port
        parts = urllib.parse.urlsplit(uri)
        if parts.scheme == "http" and parts.hostname and " " not in parts.hostname and parts.port:
            return values, uri
    raise cannot_start("ROS_MASTER_URI is %r, must be like http://localhost:11311" % uri)


def _wait_for_master(uri, timeout):
    """Without it, rospy waits for ever, and says so on stdout."""
    def is_there():
        with contextlib.suppress(*NO_ANSWER):  # one that is frozen, or behind a firewall that drops packets, has none
            return ask(uri, "getPid")

    if not wait_for("master " + uri, is_there, timeout):
        raise cannot_start("interrupted while waiting for the master %s" % uri if rospy.is_shutdown() else
                           "no master %s within %g s (~server_timeout)" % (uri, timeout))


def _start(options, ports):
    """Takes over the logging.Handlers that rospy adds, without the program's own (ROS_PYTHON_LOG_CONFIG_FILE)."""
    need("rospy", rospy.client, "_init_node_args")
    for name, port in ports.items():
        peers.check_port(name, port)
    # rospy 1.15.9 (Debian 11) calls Thread.isAlive on shutdown, which Python 3.9 removed.
    if "isAlive" in rospy.signal_shutdown.__code__.co_names and not hasattr(threading.Thread, "isAlive"):
        threading.Thread.isAlive = threading.Thread.is_alive
    peers.end_quietly()
    loggers = logging.getLogger(), logging.getLogger("rosout")
    before = [handler for logger in loggers for handler in logger.handlers]
    # What goes wrong with them is said then: without it, a disk that is full costs a traceback for each line of log.
    complain, logging.raiseExceptions = logging.raiseExceptions, False
    configure, rospy.core.configure_logging = rospy.core.configure_logging, functools.partial(
        log.configure, rospy.core.configure_logging)
    try:
        _rospy_init_node(*options, True, **ports)
        log.hold_nobody_up(handler for logger in loggers for handler in logger.handlers if handler not in before
                           and type(handler).__module__.split(".")[0] in ("logging", "rosgraph", "rospy"))
    finally:
        logging.raiseExceptions, rospy.core.configure_logging = complain, configure
        if not rospy.core.is_initialized():  # or a second try returns at once, and there is no node
            rospy.client._init_node_args = None


@contextlib.contextmanager
def _exit_status_2():
    """For a ValueError of our own checks."""
    try:
        yield
    except ValueError as error:
        (rospy.logfatal if logging.getLogger("rosout").hasHandlers() else log.say)(str(error))
        sys.exit(2)
