# SPDX-License-Identifier: BSD-3-Clause
"""What robust uses of rospy and actionlib without their documenting it, most of it checked when a node starts."""
import http.client
import operator
import sys
import threading
import time
import xml.parsers.expat
import xmlrpc.client

import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus

TESTED = {"rospy": "1.15.9 to 1.17.4", "actionlib": "1.13.2 to 1.14.3"}
# Of a master or a node that is asked; the last two of an answer that has no third part:
NO_ANSWER = OSError, http.client.HTTPException, xmlrpc.client.Error, xml.parsers.expat.ExpatError, IndexError, TypeError


class CannotStart(rospy.ROSInitException, SystemExit):
    """What prevents a start. Uncaught, it ends the program as any SystemExit with a text does: that one line on stderr,
    and exit status 1. So sys.excepthook stays whose it is."""

    def __init__(self, text):
        super().__init__(text)
        self.code = text


def cannot_start(text):
    """Returns a rospy.ROSInitException with text (str) that ends the main thread in one line, but no prompt."""
    in_main = threading.current_thread() is threading.main_thread()  # other threads end without a word on SystemExit
    return (CannotStart if in_main and not hasattr(sys, "ps1") else rospy.ROSInitException)(text)


def why(error):
    """Returns what to say (str, one line) of an error (Exception) of a start."""
    text = repr(error) if isinstance(error, KeyError) else str(error)  # which says the key and no more
    # is_shutdown() comes later: topics are closed in between.
    return "interrupted" if rospy.core.is_shutdown_requested() else " ".join(text.split())


def need(library, owner, *names):
    """Raises rospy.ROSInitException if owner, a part of library (a key of TESTED), lacks one of names (str, also those
    of parts of its parts): better now than as a traceback some time later."""
    for name in names:
        try:
            operator.attrgetter(name)(owner)
        except AttributeError:
            import importlib.metadata  # here, because it takes 1 MB
            raise cannot_start("%s %s has no %s.%s, which robust needs; it was tested with %s %s" % (
                library, importlib.metadata.version(library), getattr(owner, "__name__", type(owner).__name__), name,
                library, TESTED[library])) from None


need("rospy", rospy.core, "is_initialized", "is_shutdown_requested", "add_shutdown_hook", "_ros_atexit",
     "_xmlrpc_cache", "_client_shutdown_hooks", "_in_shutdown", "_shutdown_lock", "_log_filename")


def name_of(state):
    """Returns the name (str) of a state of actionlib_msgs/GoalStatus (int)."""
    # GoalStatus.to_string, of actionlib, calls PENDING "_has_header": that is False, which equals 0.
    return next((name for name, value in vars(GoalStatus).items() if name.isupper() and value == state), str(state))


def impatient_proxy(uri, timeout=0.5):
    """Returns a ServerProxy whose calls raise one of NO_ANSWER after timeout (real s): rospy's wait for ever."""
    return xmlrpc.client.ServerProxy(uri, transport=_Impatient(timeout))


def ask(uri, call, *arguments, timeout=0.5):
    """Returns the value that a master or a node answers to a call (str) of ROS's API. Raises one of NO_ANSWER, also
    where uri is empty, as a master's answer for a node that it does not know is."""
    with impatient_proxy(uri, timeout) as proxy:
        return getattr(proxy, call)(rospy.get_name(), *arguments)[2]


def ask_node(name, call, timeout=0.5):
    """As ask(), of the node with that name (str)."""
    return ask(ask(rosgraph.get_master_uri(), "lookupNode", name, timeout=timeout), call, timeout=timeout)


def clear(publisher):
    """Without it, the beginning of a message that cannot be sent goes out with the next (rospy/topics.py, publish)."""
    if publisher.impl:
        publisher.impl.buff.seek(0)
        publisher.impl.buff.truncate(0)


def wait_until(condition, seconds):
    """Returns condition(), which it waits for (real s)."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.001)
    return condition()


class _Impatient(xmlrpc.client.Transport, threading.local):
    """With a connection for each thread, as one takes no two calls at once, and nobody is to wait for another's."""

    def __init__(self, timeout):
        super().__init__()
        self.timeout = timeout

    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = self.timeout
        return connection

    def request(self, host, *args, **kwargs):
        try:
            return super().request(host, *args, **kwargs)
        except OSError as error:  # whose arguments rospy/impl/registration.py, cleanup, would trip over
            raise xmlrpc.client.ProtocolError(host, 0, str(error), {})
