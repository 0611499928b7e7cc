# SPDX-License-Identifier: BSD-3-Clause
"""How a node ends: within 2 s of being told to, whatever its callbacks, its main thread, its master and terminal do.

Who may take how long, from the moment that a signal or `rosnode kill` tells the node to end:

    0 to 1.0 s  goals end, all of them side by side: the servers' own, and those that the clients sent. Meanwhile the
                program's own hooks (rospy.on_shutdown) run. With such hooks, both begin at 0.6 s at the latest
      to 1.1 s  rospy's threads send what has been published
      to 1.5 s  the node takes leave of the master, which may take 0.5 s for each answer
      to 1.7 s  lines of log are written
    at 1.8 s    whatever is still there is killed

The thread Closer hears the signals; each server and client has one while its goals end.
"""
import atexit
import contextlib
import functools
import math
import os
import signal
import socket
import sys
import threading
import time
import traceback
import weakref

import rosgraph
import rospy

from . import log, rate, stdout
from .internals import impatient_proxy, wait_until

GOALS_END_WITHIN = 1.0  # s of the beginning, as all of these
SENT_WITHIN = 0.1  # s more: rospy sends from threads of its own, which cannot be asked when they are done
CLOSED_WITHIN = 1.5
KILLED_AFTER = 1.8
LOG_WITHIN = 0.2  # s for itself
HEARD_WITHIN = 0.1  # s in which the main thread may hear a signal; then another one ends the node
HOOKS_WITHIN = 0.6  # s, if there are hooks: a GUI's loop gets round to signals twice a second, say
HELD_FOR = 0.2  # s that the main thread stands still after the hooks; the goals that are still ending may need it then

_END = 255  # beside the numbers of signals, what Closer can be told

unfinished: weakref.WeakSet = weakref.WeakSet()  # goals, say; with any, a node that is killed has exit status 1, not 0
servers: weakref.WeakSet = weakref.WeakSet()  # those of this node (server.py, _ActionServer)
_told_at = 0.0  # time.monotonic(), of a signal or rosnode kill
hooks_thread = None  # the number of the thread that runs the hooks, when the node ends; -1: they have run in main
_endings: dict = {}  # weakref.WeakMethod by the id of its object, which may be unhashable


def at_end(end_goals):
    """Have end_goals(deadline) called on shutdown, in a thread of its own: a method of a server or a client that sees
    to the endings of its goals until deadline (as of time.monotonic()). Its object may be forgotten before."""
    if not _endings:
        rospy.on_shutdown(_end_all_goals)
        rospy.core.add_shutdown_hook(lambda _: rate.wake())  # rospy.is_shutdown() from now on, which ends each sleep
    for key in [key for key, one in list(_endings.items()) if not one()]:
        _endings.pop(key, None)  # in place: other threads do so, too
    _endings[id(end_goals.__self__)] = weakref.WeakMethod(end_goals)


def let_loops_see_it():
    """While the node ends, wait for rospy.is_shutdown(). Without it, a loop until then hears that its goal was ended,
    and sends the next one. Hooks go on, and whoever works on a goal of a server here, whose end is waited for."""
    if hooks_thread not in (None, threading.get_ident()) and not any(server.unended() for server in list(servers)):
        wait_until(rospy.is_shutdown, GOALS_END_WITHIN)  # not for ever, for a hook may wait for whoever calls this


def aside(function, *args):
    """Call function in a thread of its own or, where none can be had (out of threads, or Python is ending), here."""
    thread = threading.Thread(target=function, args=args, daemon=True)
    try:
        thread.start()
    except RuntimeError:
        function(*args)
    return thread


def _end_all_goals():
    global hooks_thread
    hooks_thread = threading.get_ident()
    deadline = (_told_at or time.monotonic()) + GOALS_END_WITHIN
    threads = []
    while _endings:
        end_goals = _endings.popitem()[1]()
        if end_goals:
            threads.append(aside(end_goals, deadline))

    def wait():
        for thread in threads:
            if thread.ident:
                thread.join(deadline + SENT_WITHIN - time.monotonic())
        # The ending of a goal may be large; whatever else was sent, such as a goal that is to go on, is soon gone.
        time.sleep(SENT_WITHIN if unfinished or servers else SENT_WITHIN / 5)

    if threads:
        rospy.on_shutdown(wait)  # rospy comes to it when the other hooks have run


def _callbacks_run():
    """Returns whether callbacks may be at work: threads that wait for a peer's messages end with the node."""
    return any(isinstance(one, rospy.Timer) or getattr(getattr(one, "_target", None), "__name__", None) in (
        "robust_connect_subscriber", "handle") for one in threading.enumerate())


def _is_interactive():
    """Returns whether somebody is at Python's prompt or in a debugger, which go on without the node."""
    stacks = map(traceback.walk_stack, sys._current_frames().values())
    return hasattr(sys, "ps1") or sys.flags.interactive or any(
        frame.f_globals.get("__name__") == "bdb" for stack in stacks for frame, _ in stack)


class Closer(threading.Thread):
    """Ends the node when a signal comes and when the program ends.

    Without it, rospy's signal handler calls the master from the main thread, which may be in such a call and then waits
    for itself for ever; one that looks up a host name does not hear the signal; and SIGHUP kills the node.
    """

    def __init__(self):
        super().__init__(daemon=True)
        self._ears, self._mouth = socket.socketpair()
        self._mouth.setblocking(False)
        self._before = {}  # signal handlers by number
        self._fd_before = -1  # the wake-up descriptor
        self._deadline = None  # time.monotonic()
        self._fork = threading.local()
        self._hooks = threading.Lock()  # whoever has it runs them, once
        self._hooks_ran = threading.Event()
        self._heard = None  # the number of a signal that the main thread went on after
        self._closed = threading.Event()

    def heed_signals(self):
        """In the main thread. A program that has a use of its own for SIGHUP, or runs under nohup, keeps it."""
        for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
            if number != signal.SIGHUP or signal.getsignal(number) == signal.SIG_DFL:
                self._before[number] = signal.signal(number, self._heed)
        # Python writes the signal's number there at once, even while the main thread does not get round to _heed().
        self._fd_before = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)

    def begin(self):
        """Before rospy.init_node, so that the goals' endings do not wait for the program's hooks."""
        unfinished.add(self)
        rospy.core._client_shutdown_hooks.insert(0, self._begin)
        atexit.register(self._main_has_ended)
        rospy.core.signal_shutdown = self._signal_shutdown
        os.register_at_fork(before=self._hold_signals, after_in_parent=self._free_signals, after_in_child=self._forget)
        rospy.impl.masterslave.print = self._hear_request
        self.start()

    def start_is_over(self):
        """Until then a node that is killed has exit status 1."""
        unfinished.discard(self)

    def give_up(self):
        """The node cannot start: leave the process as it was."""
        self._give_back()
        rospy.core.signal_shutdown = rospy.signal_shutdown
        self._mouth.close()
        if not self.ident:  # else the thread hears of it, and ends
            self._ears.close()

    def close(self):
        """End the node as a signal does."""
        with contextlib.suppress(OSError):  # it has been told often enough
            self._mouth.send(bytes([_END]))

    def run(self):
        while True:
            self._ears.settimeout(self._deadline and max(0.01, self._deadline - time.monotonic()))
            try:
                told = self._ears.recv(100)
            except socket.timeout:
                if self._deadline:
                    os._exit(1 if unfinished else 0)
                continue
            if not told:
                return
            with contextlib.suppress(OSError):  # whoever was there before, if anybody, hears of all signals
                os.write(self._fd_before, bytes(number for number in told if number != _END))
            signals = self._before.keys() & set(told)
            if _END in told or any(signal.getsignal(number) == self._heed for number in signals):
                if not self._deadline and not _is_interactive():
                    self._deadline = time.monotonic() + KILLED_AFTER
                aside(self._shut_down, bool(signals))

    def _shut_down(self, by_signal):
        global _told_at
        _told_at = _told_at or time.monotonic()
        patience = KILLED_AFTER if self._deadline else math.inf  # this may be the thread that kills
        # Without it, a hook that needs the main thread's windows, or a database that it has opened, fails.
        late = HOOKS_WITHIN if by_signal and self._hooks_of_the_program() else HEARD_WITHIN
        wait_until(lambda: self._hooks.locked() or self._heard, late)
        if not self._hooks.locked() or wait_until(self._hooks_ran.is_set, patience):
            rospy.signal_shutdown("told to end")

    def _heed(self, number, frame):
        """The signal handler. Whoever has the wake-up descriptor now, such as asyncio: this tells the thread, too."""
        before = self._before.get(number)
        self.close()
        calls_before = callable(before) and before is not signal.default_int_handler
        if any(server.lock._is_owned() for server in list(servers)):  # a hook may wait for whoever waits for that
            self._heard = number
            return
        # Else it is obeyed when the checks are done, or this interrupts the hooks.
        if self.ident and hooks_thread != threading.get_ident():
            self._run_hooks()
            wait_until(self._hooks_ran.is_set, CLOSED_WITHIN)  # in a signal handler an Event might wait for itself
            if not wait_until(self._closed.is_set, CLOSED_WITHIN if calls_before else HELD_FOR):
                self._heard = number
        if calls_before:
            try:  # with contextlib, a debugger, whose handler this may be, would stop in that
                before(number, frame)
            except KeyboardInterrupt:
                pass

    def _run_hooks(self):
        """Run the program's hooks here, in the main thread, as rospy does. Without it, the main program drives on when
        one of them has stopped the robot. The rest is not for here: a goal's end may need what this interrupts."""
        global hooks_thread
        lock = rospy.core._shutdown_lock
        if not lock.acquire(timeout=HEARD_WITHIN):
            return  # another thread runs them
        try:
            if rospy.core.is_shutdown_requested() or not self._hooks.acquire(blocking=False):
                return
            rospy.core._in_shutdown = True  # else whoever calls rospy.signal_shutdown closes the node meanwhile
        finally:
            lock.release()
        hooks, theirs = rospy.core._client_shutdown_hooks, self._hooks_of_the_program()
        del hooks[:]
        self._begin()
        ours, hooks[:] = hooks[:], theirs
        for hook in hooks:  # also those that they add
            try:
                hook()
            except BaseException:  # as rospy does
                traceback.print_exc()
        hooks[:], rospy.core._in_shutdown = ours, False
        hooks_thread = -1  # what the main program sends from now on is no hook's
        self._hooks_ran.set()

    def _hooks_of_the_program(self):
        return [hook for hook in rospy.core._client_shutdown_hooks if hook not in (self._begin, _end_all_goals)]

    def _is_down(self, _):
        """From now on rospy.is_shutdown(). A main thread in signal.pause() looked before: the signal comes again."""
        if self._heard and signal.getsignal(self._heard) == self._heed:
            signal.pthread_kill(threading.main_thread().ident, self._heard)
        self._closed.set()

    def _hear_request(self, text):
        """In place of print in rospy/impl/masterslave.py, shutdown, whose line would stand in the node's stdout."""
        name, is_for_twin = rospy.get_name(), "same name" in text
        if is_for_twin and "[%s]" % name not in text:  # a node that was killed, and had our port
            raise ValueError("this is " + name)
        self.close()
        rospy.logwarn("%s", "another node took the name %s, so this one ends" % name if is_for_twin else text)

    def _begin(self):
        """On shutdown, whoever asked for it."""
        # Without it, a call that the master never answers holds up all that follow (rospy/core.py, _LockedServerProxy).
        uri = rosgraph.get_master_uri()
        rospy.core._xmlrpc_cache[uri] = impatient_proxy(uri)
        rospy.on_shutdown(self._hooks_ran.set)  # after the program's own, and before the goals are waited for
        rospy.on_shutdown(functools.partial(log.flush, SENT_WITHIN))  # while there is /rosout
        _end_all_goals()
        rospy.core.add_shutdown_hook(self._is_down)  # the last one, after the program's own

    def _main_has_ended(self):
        if self._deadline:
            self._finish()

    def _signal_shutdown(self, reason):
        """In place of what rospy's own atexit function calls, which comes after the program's: their node is up yet."""
        if reason == "atexit":
            self._finish()
        else:
            rospy.signal_shutdown(reason)

    def _finish(self):
        """Once; the exit status stays what it is. A program that ends by itself waits for its hooks, as with rospy."""
        rospy.core.signal_shutdown = rospy.signal_shutdown
        self._heard = None  # nobody waits in pause() any more
        self._run_hooks()
        try:
            if not self._closed.is_set():  # a thread that starts while Python ends can crash it (3.11)
                # Aside, for rospy goes on for 0.6 s when it has closed the node; callbacks may need that.
                closing = aside(rospy.signal_shutdown, "the program has ended")
                wait_until(lambda: not closing.is_alive() or self._closed.is_set() and not _callbacks_run(), math.inf)
        finally:  # KeyboardInterrupt
            begun = self._deadline - KILLED_AFTER if self._deadline else time.monotonic()
            self._closed.wait(begun + CLOSED_WITHIN - time.monotonic())
            self._deadline = None
            log.flush(LOG_WITHIN)

    def _give_back(self):
        for number, before in self._before.items():
            if signal.getsignal(number) == self._heed:  # nobody else has come since
                signal.signal(number, signal.SIG_DFL if before is None else before)
        if self._before:
            signal.set_wakeup_fd(-1)
            with contextlib.suppress(OSError, ValueError):  # closed since, or it waits now
                signal.set_wakeup_fd(self._fd_before)
        self._before = {}
        atexit.unregister(self._main_has_ended)

    def _hold_signals(self):
        """Without it, a signal to a child that has just been forked is heard here."""
        log.pause()
        self._fork.mask = signal.pthread_sigmask(signal.SIG_BLOCK, self._before)

    def _free_signals(self):
        log.go_on()
        signal.pthread_sigmask(signal.SIG_SETMASK, self._fork.mask)

    def _forget(self):
        """In a child process: its signals and its end are not the node's."""
        self._give_back()
        atexit.unregister(rospy.core._ros_atexit)  # it would take the parent's topics off the master
        log.give_back()
        stdout.give_back()
        signal.pthread_sigmask(signal.SIG_SETMASK, self._fork.mask)
