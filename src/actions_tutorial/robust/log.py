"""The log of a node, written by separate threads, so that no line of it can block or break the node."""
import logging
import queue
import sys
import threading
import time

import rospy

from .libraries import need

LATER = 0.005  # s that a line waits while what it tells of goes out
WAITING = 1000  # lines that may wait for a handler; further ones are lost

_lines = queue.SimpleQueue()  # (_Front, record or, as a mark, threading.Event) in the order of their coming
_hurry = threading.Event()  # somebody waits until they are written


class _Front(logging.Handler):
    """Takes the place of a handler, which gets the lines in a thread.

    Without it, a terminal that is stopped, a log file on a disk that hangs or a frozen master holds up whoever logs,
    and a stdout that is closed or full raises in the midst of a goal (rosgraph/roslogging.py, RosStreamHandler).
    """

    def __init__(self, handler):
        super().__init__(handler.level)
        self.handler, self.records = handler, queue.SimpleQueue()
        threading.Thread(target=self.write, daemon=True).start()

    def emit(self, record):
        record.msg, record.args = record.getMessage(), None  # the arguments may change before the thread gets at them
        if self.records.qsize() < WAITING:
            _lines.put((self, record))

    def write(self):
        while True:
            record = self.records.get()
            try:
                if isinstance(record, threading.Event):
                    record.set()
                else:
                    self.handler.emit(record)  # not handle(): what exits must not wait for the handler's lock
            except Exception:
                self.handler.handleError(record)


def _hand_on():
    """Whoever logs wakes this one thread. Without it, the threads of three handlers compete with a goal for Python's
    lock: its first feedback took a third longer."""
    while True:
        lines = [_lines.get()]
        _hurry.wait(LATER)
        while not _lines.empty():
            lines.append(_lines.get())
        for front, record in lines:
            front.records.put(record)


def say_faults_in_one_line():
    """Without it, a disk that is full costs a traceback for each line of log."""
    said = set()

    def handle_error(handler, _):
        if handler not in said:
            said.add(handler)
            try:
                sys.stderr.write("cannot log to %s: %s\n" % (
                    getattr(handler, "baseFilename", "the terminal"), sys.exc_info()[1]))
            except OSError:
                pass  # nobody is left to tell

    logging.Handler.handleError = handle_error


def hold_nobody_up():
    """Put threads between the log and its handlers, after rospy.init_node."""
    threading.Thread(target=_hand_on, daemon=True).start()
    for logger in logging.getLogger(), logging.getLogger("rosout"):
        for handler in list(logger.handlers):
            logger.removeHandler(handler)
            logger.addHandler(_Front(handler))


def ask_the_master_once():
    """Without it, each line of log asks the master whether to list the node's topics with it (rospy/impl/rosout.py): a
    node whose name another one has taken takes it back with its last words, and the master shuts that one down, too."""
    key = "/rosout_disable_topics_generation"
    need("rospy", rospy.impl.paramserver, "get_param_server_cache")
    rospy.impl.paramserver.get_param_server_cache().set(key, rospy.get_param(key, False))


def flush(seconds):
    """Wait until the lines so far are written, at most so many seconds."""
    end, marks = time.monotonic() + seconds, []
    for logger in logging.getLogger(), logging.getLogger("rosout"):
        for front in logger.handlers:
            if isinstance(front, _Front) and front.records.qsize() < WAITING:
                marks.append(threading.Event())
                _lines.put((front, marks[-1]))
    _hurry.set()
    for mark in marks:
        mark.wait(max(0, end - time.monotonic()))
    _hurry.clear()
