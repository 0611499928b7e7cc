# SPDX-License-Identifier: BSD-3-Clause
"""Standard output of print: what it prints is there at once, and a node whose lines nobody can read ends."""
import contextlib
import io
import os
import select
import sys
import threading

import rospy

_kept: list = []  # without it, a program that puts another stream around its buffer finds that closed
_turn = threading.RLock()  # of who writes


def take_over(close_node):
    """Take the place of Python's own sys.stdout; one that somebody has redirected stays. close_node() is called when
    it cannot be written any more, from a thread that is not the main one."""
    if sys.stdout is sys.__stdout__ and getattr(sys.stdout, "name", None) == "<stdout>":
        sys.stdout.reconfigure(line_buffering=True)  # some have it from before, as a default of an argument
        sys.stdout = _Stdout(close_node)
        _kept.append(sys.stdout)


def give_back():
    """In a child process, where a thread that was writing is no more."""
    global _turn
    _turn = threading.RLock()


class _File(io.FileIO):
    """Without a buffer of its own, which would refuse a signal handler's print in the midst of another one."""

    raw = property(lambda self: self)

    def write(self, data):
        left = memoryview(data).cast("B")
        size = len(left)
        # The system keeps a short one whole, and a signal handler in the midst of it may wait for another thread's.
        with _turn if size > select.PIPE_BUF else contextlib.nullcontext():
            while left:
                written = super().write(left)
                if written is None:  # a full pipe that does not block
                    select.select([], [self], [])
                else:
                    left = left[written:]
        return size


class _Stdout(io.TextIOWrapper):
    """Without it, whoever reads a pipe gets the lines many at once and much later; and when nobody reads it any more,
    each print is a traceback, and the node works on for nobody."""

    def __init__(self, close_node):
        file, before = _File(1, "wb", closefd=False), sys.__stdout__
        file.name = before.name
        super().__init__(file, before.encoding, "backslashreplace" if before.errors == "strict" else before.errors,
                         write_through=getattr(before, "write_through", False))  # as with python3 -u
        self.mode, self.close_node = before.mode, close_node
        self._CHUNK_SIZE = 65536  # characters: a line up to there is one write, its end as well

    def write(self, text):
        try:
            written = super().write(text)
            if not text or text.endswith("\n") or "\r" in text:  # the last that print writes, or a progress
                self.flush()  # all that is printed at once, so that no other node's line gets in between
            return written
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            rospy.logerr("cannot write to stdout: %s", error)
            if threading.current_thread() is threading.main_thread():
                sys.exit(1)
            self.close_node()
            return len(text)
