"""Stand-ins for what rospy and actionlib offer a node: the same calls, with the gaps behind them closed.

    from actions_tutorial import robust

robust.init_node, robust.get_param, robust.SimpleActionServer and robust.SimpleActionClient take the place of
rospy.init_node, rospy.get_param, actionlib.SimpleActionServer and actionlib.SimpleActionClient. Import it before rospy.
"""
import signal
import sys
import threading

# Without this, Ctrl-C in the half second that the imports below take prints a traceback. init_node takes over.
if threading.current_thread() is threading.main_thread() and not hasattr(sys, "ps1"):
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)

# rospy complains of these when it is imported, and does not say what is allowed. init_node does.
_argv, sys.argv = sys.argv, [argument for argument in getattr(sys, "argv", []) if argument.count(":=") < 2]

from .client import SimpleActionClient  # noqa: E402
from .node import init_node  # noqa: E402
from .parameters import get_param  # noqa: E402
from .server import SimpleActionServer  # noqa: E402

sys.argv = _argv

__all__ = ["SimpleActionClient", "SimpleActionServer", "get_param", "init_node"]
