# SPDX-License-Identifier: BSD-3-Clause
"""The log of a node: no line of it can block or break the node, and what others sent cannot steer a terminal.

A line goes to the terminal at once, if that takes it without waiting, so the lines of several nodes on one terminal
stand in their order. A thread takes it to /rosout and the log file a moment later. A second one writes to a terminal,
and holds its lines while that is stopped or nobody reads it.
"""
import collections
import contextlib
import copy
import functools
import io
import logging
import os
import select
import sys
import threading
import time
import traceback

import rospy
from rosgraph.roslogging import LoggingException, RosStreamHandler

from .internals import need, wait_until

LATER = 0.005  # s that a line for /rosout and the file waits, while what it tells of goes out
WAITING = 1000  # lines that may wait for one of the two threads; further ones are lost
AT_ONCE = 1500  # bytes; a pipe that takes anything takes 4096 without waiting, and a letter of 4 bytes is 10 in ASCII
READ_WITHIN = 0.2  # s that a terminal may keep whoever logs, once

_rosout = logging.getLogger("rosout")  # rospy's
_taken: list = []  # the handlers, as long as nobody has to wait for them
_usual: list = []  # the terminal's, if its lines have rospy's own form
_soon: collections.deque = collections.deque(maxlen=WAITING)  # lines on goals: functions that return them


def printable(text):
    """Returns text (str) in one line, without what a terminal would obey."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def say(line):
    """Write a line on stderr, past Python's buffer: what that cannot get rid of makes the exit status 120."""
    with contextlib.suppress(OSError, ValueError):  # nobody is left to tell
        _own(sys.stderr).write(line + "\n")


def failed(what):
    """Log that what (str) failed, with the traceback of the exception that is being handled."""
    rospy.logerr("%s failed: %s", what, "\n".join(map(printable, traceback.format_exc().splitlines())))


def soon(line):
    """Log line() (str) at the next catch_up(), to which the caller sees when what it tells of has gone out. Only in a
    node that our init_node has started: elsewhere a line could hold up a goal."""
    if _taken:
        _soon.append(line)


def catch_up():
    """Write the lines that were logged with soon()."""
    for line in _taken_off():  # taken first, because loginfo() gets here again
        rospy.loginfo("%s", line())


def show():
    """Write the lines of soon() to the terminal, now, in the form that rospy's handler has by default. /rosout and the
    file get them at the next catch_up(). Without it, a first feedback waits 0.3 ms for rospy's own way to a line."""
    if not _soon:
        return
    terminal = _usual and _usual[0]
    if not terminal or not rospy.rostime.is_wallclock() or not _rosout.isEnabledFor(logging.INFO) or \
            logging.INFO < terminal.level:
        return catch_up()
    for line in _taken_off():
        text = line()
        if not isinstance(text, _Shown):
            text = _Shown(text)
            terminal._stdout.write("[INFO] [%f]: %s\n" % (time.time(), text))
        _soon.append(lambda text=text: text)


def hold_nobody_up(handlers):
    """Take over the handlers (logging.Handler) that rospy.init_node has made.

    Without it, a terminal that is stopped, a disk that hangs or a frozen master holds up whoever logs, and a stdout
    that is closed or full raises in the midst of a goal (rosgraph/roslogging.py, RosStreamHandler).
    """
    for handler in handlers:
        handler.handleError = functools.partial(_say_once, handler, [])
        if isinstance(handler, RosStreamHandler):
            need("rospy", handler, "_stdout", "_stderr")
            handler.before = handler._stdout, handler._stderr
            handler._stdout, handler._stderr = (_Stream(_own(one), handler) for one in handler.before)
            emit = functools.partial(_write_to_terminal, handler.emit)
            _usual[:] = [] if "ROSCONSOLE_FORMAT" in os.environ else [handler]  # to look there takes 15 µs
        else:
            emit = functools.partial(_write_later, functools.partial(_write, handler, handler.emit))
        handler.emit = functools.partial(_write, handler, emit)
        _taken.append(handler)


def configure(rospy_s, *args):
    """In place of rospy_s, rospy.core.configure_logging. Without it, a log file that cannot be opened prevents the
    start, and where no folder for it can be made, no line gets to the terminal either (rosgraph/roslogging.py)."""
    try:
        rospy_s(*args)
    except (OSError, ValueError, LoggingException) as error:  # ValueError: of a configuration in YAML
        say("cannot set up the log: %s" % error)
    if not rospy.core._log_filename:
        _rosout.addHandler(RosStreamHandler())
        _rosout.setLevel(logging.INFO)


def pause():
    """Before a fork. Without it, a child that is forked while the thread writes never gets the lock of the file."""
    _others.at_work.acquire(timeout=1)


def go_on():
    """After a fork."""
    with contextlib.suppress(RuntimeError):  # pause() did not get it: the disk hangs
        _others.at_work.release()


def give_back():
    """In a child process, which has no threads of ours."""
    go_on()
    while _taken:
        handler = _taken.pop()
        del handler.emit, handler.handleError
        if isinstance(handler, RosStreamHandler):
            handler._stdout, handler._stderr = handler.before  # else its lines overtake what it has printed


def flush(seconds):
    """Wait until the lines so far are written, at most so many seconds."""
    catch_up()
    wait_until(lambda: not (_terminal or _others), seconds)


def ask_the_master_once():
    """Without it, each line of log asks the master whether to list the node's topics with it (rospy/impl/rosout.py): a
    node whose name another one has taken takes it back with its last words, and the master shuts that one down, too."""
    key = "/rosout_disable_topics_generation"
    need("rospy", rospy.impl.paramserver, "get_param_server_cache")
    cache, value = rospy.impl.paramserver.get_param_server_cache(), rospy.get_param(key, False)
    get = cache.get
    cache.get = lambda name: value if name == key else get(name)  # not in the cache, where it would be all of "/"


class _Caller(collections.deque):
    """The calls that wait for a thread, which makes them pause (s) after they came. It is started with the first one.

    Only that thread waits for a lock: with a queue.Queue, a signal handler that logs waits for what it interrupted.
    """

    def __init__(self, pause):
        super().__init__()
        self._pause, self.at_work = pause, threading.RLock()
        self._begins, self._news = threading.Lock(), threading.Lock()

    def call(self, function):
        """Returns whether there is a thread: none if they have run out, or Python 3.12.1 is ending."""
        if len(self) < WAITING:
            self.append(function)
        if self._begins.acquire(blocking=False):  # else there is one
            try:
                threading.Thread(target=self._run, daemon=True).start()
            except RuntimeError:  # the next call tries again
                self._begins.release()
                return False
        with contextlib.suppress(RuntimeError):  # it has been told already
            self._news.release()
        return True

    def _run(self):
        while self._news.acquire():
            time.sleep(self._pause)
            while self:
                with self.at_work:
                    self[0]()
                self.popleft()


class _Stream:
    """What handler, the terminal's, writes to in place of stream: at once, or in the thread if it may have to wait."""

    def __init__(self, stream, handler):
        self._stream, self._file, self._is_terminal = stream, None, False
        self._write = functools.partial(_write, handler, stream.write)
        with contextlib.suppress(AttributeError, OSError, ValueError):  # no file of the system's
            self._file = stream.fileno()
            self._is_terminal = os.isatty(self._file)

    def __getattr__(self, name):  # rospy asks whether it is a terminal, which has colours
        return getattr(self._stream, name)

    def write(self, text):
        if _terminal or len(text.encode("utf-8", "replace")) >= AT_ONCE or not self._takes_a_line():
            _terminal.call(functools.partial(self._write, text))
        elif self._is_terminal:  # it says so if it takes a byte: nobody may read it (ssh, and the network is gone)
            written = threading.Event()
            if _terminal.call(lambda: (self._write(text), written.set())):
                written.wait(READ_WITHIN)
            elif _terminal:
                _terminal.popleft()()
        else:
            self._write(text)

    def _takes_a_line(self):
        if self._file is None:
            return True
        poll = select.poll()  # select() knows no file above 1023
        poll.register(self._file, select.POLLOUT)
        return bool(poll.poll(0))


class _Shown(str):
    """A line that stands on the terminal."""


def _taken_off():
    """Returns the lines of soon(), which are the caller's from now on."""
    lines = []
    try:  # without contextlib, which would take 7 µs of a first feedback
        while _soon:
            lines.append(_soon.popleft())
    except IndexError:  # another thread has taken the last one
        pass
    return lines


_terminal, _others = _Caller(0), _Caller(LATER)


def _write_to_terminal(emit, record):
    catch_up()
    if any(isinstance(one, _Shown) for one in record.args or ()):  # which may be a dict
        return
    record = _with_text(record)
    if "rospy/impl/" in record.pathname:  # its warnings quote what a peer has sent
        record.msg = printable(record.msg)
    emit(record)


def _write_later(write, record):
    _others.call(functools.partial(write, _with_text(record)))


def _with_text(record):
    """Returns record (logging.LogRecord) with its text, for its arguments may change before a thread gets at them."""
    record = copy.copy(record)  # the program's own handlers have it, too
    try:
        record.msg = record.getMessage()
    except Exception as error:  # a wrong format, which is seldom the fault of whoever runs the program
        record.msg = "%s, with %r: %s" % (record.msg, record.args, error)
    record.args = None
    return record


def _write(handler, write, line):
    """Call write(line): a record, or the text of one."""
    try:
        write(line)
    except Exception:
        handler.handleError(line)


def _say_once(handler, said, _):
    """For handleError. Without it, a disk that is full costs a traceback for each line of log."""
    if not said:
        said.append(True)
        place = "the terminal" if isinstance(handler, RosStreamHandler) else "/rosout"
        say("cannot log to %s: %s" % (getattr(handler, "baseFilename", place), sys.exc_info()[1]))


def _own(stream):
    """Returns a stream of the log's own in place of Python's. Without it, a terminal that nobody reads holds up the end
    of the program, because whoever writes to it keeps its lock."""
    if stream is None:
        return open(os.devnull, "w")
    if stream not in (sys.__stdout__, sys.__stderr__):
        return stream
    # Not buffered, or Python 3.13 complains of what it cannot flush.
    file = io.FileIO(1 if stream is sys.__stdout__ else 2, "w", closefd=False)
    return io.TextIOWrapper(file, stream.encoding, "backslashreplace", write_through=True)
