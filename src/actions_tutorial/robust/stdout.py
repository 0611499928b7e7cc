# SPDX-License-Identifier: BSD-3-Clause
"""Standard output of print: its lines are there at once, and a node whose lines nobody can read ends."""
import functools
import os
import sys
import threading

import rospy


def take_over(close_node):
    """Mend Python's own sys.stdout; one that somebody has redirected stays. close_node() is called when it cannot be
    written any more, from a thread that is not the main one."""
    stream = sys.stdout
    if stream is sys.__stdout__ and getattr(stream, "name", None) == "<stdout>":
        stream.lines_before = stream.line_buffering
        stream.reconfigure(line_buffering=False, errors=stream.errors.replace("strict", "backslashreplace"))
        stream.write = functools.partial(_write, stream, stream.write, close_node)


def give_back():
    """In a child process, whose end is not the node's."""
    stream = sys.__stdout__
    if hasattr(stream, "lines_before"):  # there is one to mend, and it is not a child's child
        del stream.write
        if vars(stream).pop("lines_before"):  # else its lines are seen when it ends
            stream.write = functools.partial(_write_lines, stream)


def _write_lines(stream, text):
    """With a child's first print; at the fork, it could wait for a lock that a thread of the parent had."""
    del stream.write
    stream.reconfigure(line_buffering=True)
    return stream.write(text)


def _write(stream, write, close_node, text):
    """Without it, whoever reads a pipe gets the lines many at once and much later, another thread's line can get into
    one of several lines, and when nobody reads, each print is a traceback and the node works on for nobody."""
    try:
        written = write(text)
        if not text or text.endswith("\n") or "\r" in text:  # the last that print writes, or a progress
            stream.flush()
        return written
    except BlockingIOError:  # a pipe that does not wait: plain Python's print raises this, too
        raise
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        rospy.logerr("cannot write to stdout: %s", error)
        if threading.current_thread() is threading.main_thread():
            sys.exit(1)
        close_node()
        return len(text)
