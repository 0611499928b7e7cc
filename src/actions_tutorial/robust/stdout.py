"""Standard output, of print and of the log."""
import io
import os
import sys
import threading

import rospy


def open_standard_files():
    """Without it, a node that starts with its stdout closed gives that number to a connection, and prints into it."""
    number = 0
    while number <= 2:
        number = os.open(os.devnull, os.O_RDWR)
    os.close(number)
    sys.stderr = sys.stderr or open(2, "w", buffering=1, closefd=False)


def _encoding():
    return sys.__stdout__.encoding if sys.__stdout__ else None


def for_the_log():
    """Returns a file of the log's own. Without it, a stdout that nobody reads holds up the end of the program, for the
    thread that writes the log keeps the lock of Python's own one."""
    return open(1, "w", buffering=1, encoding=_encoding(), errors="backslashreplace", closefd=False)


class ForPrint(io.TextIOWrapper):
    """Takes the place of sys.stdout. Without it, lines get into a pipe in lumps, much later; and when nobody reads the
    pipe any more, each print is a traceback, and the node works on for nobody. close_node() is called then."""

    def __init__(self, close_node):
        super().__init__(open(1, "wb", closefd=False), encoding=_encoding(), errors="backslashreplace")
        self.close_node = close_node
        self.line_is_rospys = False

    def write(self, text):
        if text.startswith("shutdown request: "):  # rospy/impl/masterslave.py prints it, and then the end of the line
            self.line_is_rospys = True
            twin = "another node took the name %s, so this one ends" % rospy.get_name()
            rospy.logwarn(twin if "same name" in text else text)
            return len(text)
        if self.line_is_rospys and text == "\n":
            self.line_is_rospys = False
            return len(text)
        try:
            written = super().write(text)
            if text.endswith("\n"):
                self.flush()  # all that is printed at once, so that no other node's line gets in between
            return written
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            rospy.logerr("cannot write to stdout: %s", error)
            if threading.current_thread() is threading.main_thread():
                sys.exit(1)
            self.close_node()
            return len(text)
