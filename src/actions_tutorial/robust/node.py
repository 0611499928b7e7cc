"""init_node: a node that starts, or says in one line why it cannot."""
import contextlib
import sys
import threading
import time
import urllib.parse

import rosgraph
import rospy

from . import closing, connections, log, stdout
from .libraries import is_initialized
from .parameters import check_arguments, get_params

# rospy 1.15.9 (Debian 11) calls Thread.isAlive on shutdown, which Python 3.9 removed.
if not hasattr(threading.Thread, "isAlive"):
    threading.Thread.isAlive = threading.Thread.is_alive


def init_node(name, argv=None, anonymous=False, log_level=None, disable_rostime=False, disable_rosout=False,
              disable_signals=False, xmlrpc_port=0, tcpros_port=0, usage=None, parameters=None, timeout=0):
    """Like rospy.init_node, for a node that ends within 2 s of SIGINT, SIGTERM and SIGHUP, and that no log can block.

    usage: what --help prints (str). With it, unknown arguments are refused.
    parameters: {"~NAME": (default, lowest, highest)}, the private parameters, whose values are returned (tuple).
    timeout: real seconds to wait for the master, or the name of the parameter that holds them; 0: for ever.

    What prevents the start is a rospy.ROSInitException that says what; if nothing catches it, that is one line of log
    and exit status 1. A wrong argument or parameter is one line and exit status 2.
    """
    options = (name, argv, anonymous, log_level, disable_rostime, disable_rosout, True, xmlrpc_port, tcpros_port)
    if is_initialized():
        return rospy.init_node(*options)
    arguments, parameters = (sys.argv if argv is None else argv)[1:], parameters or {}
    if usage and {"-h", "--help"} & set(arguments):
        print(usage.strip())
        sys.exit(0)
    sys.excepthook = _say_in_one_line
    stdout.open_standard_files()
    with _exit_status_2():  # from the command line so far: a mistake there is refused without a master
        if usage:
            check_arguments(arguments, list(parameters))
        values = get_params(parameters)
    uri = _check_surroundings(arguments)
    closer = closing.Closer()
    if not disable_signals:
        closer.heed_signals()
    patience.begin(timeout, dict(zip(parameters, values)))
    _wait_for_master(uri)
    log.say_faults_in_one_line()
    sys.stdout = stdout.for_the_log()
    try:
        rospy.init_node(*options)
        log.ask_the_master_once()
        connections.serve_all_peers()
    except Exception as error:
        why = "interrupted" if rospy.is_shutdown() else error
        raise rospy.ROSInitException("the node %s cannot start: %s" % (name, why)) from error
    finally:
        sys.stdout = stdout.ForPrint(closer.close)
    log.hold_nobody_up()
    closer.note_when_closed()
    closing.exit_status_if_killed = 0
    with _exit_status_2():
        values = get_params(parameters)
    patience.change(dict(zip(parameters, values)))
    return values


class _Patience:
    """How long the node waits, from the beginning of init_node on: first for the master, then for a server."""

    def __init__(self):
        self.begin(0, {})

    def begin(self, timeout, parameters):
        self.begun, self.timeout = time.monotonic(), timeout
        self.change(parameters)

    def change(self, parameters):
        """parameters: {name: value} as they are known by now."""
        self.seconds = parameters.get(self.timeout, self.timeout)
        self.name = self.timeout if self.timeout in parameters else "timeout"

    def wait_for(self, what, is_there):
        """Returns None when is_there(), else why not (str)."""
        if wait_for(what, is_there, self.seconds and self.seconds - (time.monotonic() - self.begun)):
            return None
        if rospy.is_shutdown():
            return "interrupted while waiting for the %s" % what
        return "no %s within %g s (%s)" % (what, self.seconds, self.name)


patience = _Patience()


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
            rospy.logwarn("waiting for the %s, %.0f s so far", what, now - begun)
            say_next += 5
        time.sleep(0.02)
    return True


def _check_surroundings(arguments):
    """Returns the master's URI. Without it, what is wrong is said in words such as "too many values to unpack"."""
    for argument in arguments:
        if argument.count(":=") > 1:
            raise rospy.ROSInitException("the argument is %r, must be NAME:=VALUE" % argument)
    uri = rosgraph.get_master_uri()
    try:
        parts = urllib.parse.urlsplit(uri)
        right = parts.scheme == "http" and parts.hostname and parts.port
    except ValueError:  # of the port
        right = False
    if not right:
        raise rospy.ROSInitException("ROS_MASTER_URI is %r, must be like http://localhost:11311" % uri)
    return uri


def _wait_for_master(uri):
    """Without it, rospy waits for ever, and says so on stdout; and a master that is frozen, or behind a firewall that
    drops packets, holds up the main thread even so: rosgraph.is_master_online has no time-out."""
    answers, asking = [], threading.Thread()

    def is_online():
        nonlocal asking
        if not asking.is_alive() and not any(answers):
            asking = threading.Thread(target=lambda: answers.append(rosgraph.is_master_online()), daemon=True)
            asking.start()
            asking.join(0.2)
        return any(answers)

    why_not = patience.wait_for("master " + uri, is_online)
    if why_not:
        raise rospy.ROSInitException(why_not)


@contextlib.contextmanager
def _exit_status_2():
    """For a ValueError of our own checks."""
    try:
        yield
    except ValueError as error:
        rospy.logfatal("%s", error)
        sys.exit(2)


def _say_in_one_line(kind, error, trace):
    """For sys.excepthook. Without it, each thing that prevents the start is a traceback of twenty lines."""
    if isinstance(error, rospy.ROSInitException):
        rospy.logfatal("%s", error)
    else:
        sys.__excepthook__(kind, error, trace)
