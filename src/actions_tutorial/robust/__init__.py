# SPDX-License-Identifier: BSD-3-Clause
"""Stand-ins for what rospy and actionlib offer a node: the same calls, with the gaps behind them closed.

    from actions_tutorial import robust

robust.init_node, robust.get_param, robust.SimpleActionServer and robust.SimpleActionClient take the place of
rospy.init_node, rospy.get_param, actionlib.SimpleActionServer and actionlib.SimpleActionClient; whatever else actionlib
has, robust has, too. Import it first: while it and the messages of its package are loaded, Ctrl-C leaves no traceback.
"""
import contextlib
import importlib
import signal
import sys
import threading

__version__ = "1.1.0"

# While the imports below take half a second, Ctrl-C ends the program without a traceback; then it is as it was.
_quiet = threading.current_thread() is threading.main_thread() and "rospy" not in sys.modules and \
    not hasattr(sys, "ps1") and signal.getsignal(signal.SIGINT) is signal.default_int_handler
if _quiet:
    signal.signal(signal.SIGINT, signal.SIG_DFL)
# rospy complains of these when it is imported, and does not say what is allowed. init_node does.
_argv, sys.argv = sys.argv, [argument for argument in sys.argv if argument.count(":=") < 2]

from actionlib import *  # noqa: E402, F401, F403  # what is not replaced below
from .client import SimpleActionClient  # noqa: E402, F401
from .node import init_node  # noqa: E402, F401
from .parameters import get_param  # noqa: E402, F401
from .server import SimpleActionServer  # noqa: E402, F401

with contextlib.suppress(ImportError, ValueError):  # if the package around this has messages, its nodes load them next
    importlib.import_module("..msg", __package__)

sys.argv = _argv
if _quiet:
    signal.signal(signal.SIGINT, signal.default_int_handler)
