"""How a node ends: within 2 s of being told to, whatever its main thread, its master and its terminal do."""
import atexit
import os
import signal
import socket
import threading
import time
import xmlrpc.client

import rosgraph
import rospy

from . import log
from .libraries import is_initialized, need

CLOSED_WITHIN = 1.5  # s of being told to; then the program ends even if the node has not told everybody
KILLED_AFTER = 1.9  # s, if the program has not ended by itself


exit_status_if_killed = 1  # 0 for a node that is up and has no goal of its own under way


class Closer(threading.Thread):
    """Closes the node when a signal comes and when the program ends.

    Without it, rospy's signal handler calls the master from the main thread, which may be in the middle of such a call
    and then waits for itself for ever; a main thread that is looking up a host name does not even hear the signal; and
    SIGHUP, a closed terminal, kills the node.
    """

    def __init__(self):
        super().__init__(daemon=True)
        need("rospy", rospy.core, "_xmlrpc_cache", "add_shutdown_hook")
        self.requests, self.request = socket.socketpair()
        self.request.setblocking(False)
        self.closed = threading.Event()
        self.told = self.killer = None  # when (time.monotonic()), threading.Timer
        rospy.on_shutdown(self.begin)
        atexit.register(self.finish)
        self.start()

    def heed_signals(self):
        signal.set_wakeup_fd(self.request.fileno(), warn_on_full_buffer=False)  # which wakes the thread
        for number in signal.SIGINT, signal.SIGTERM, signal.SIGHUP:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # as nohup sets it
                signal.signal(number, lambda *_: None)

    def note_when_closed(self):
        """Call it after rospy.init_node, which adds the hooks that come before."""
        rospy.core.add_shutdown_hook(lambda _: self.closed.set())

    def close(self):
        try:
            self.request.send(b"\0")
        except OSError:
            pass  # it has been told often enough

    def run(self):
        self.requests.recv(1)
        rospy.signal_shutdown("told to end")

    def begin(self):
        """On shutdown, whoever asked for it."""
        self.told = time.monotonic()
        uri = rosgraph.get_master_uri()
        rospy.core._xmlrpc_cache[uri] = xmlrpc.client.ServerProxy(uri, transport=_Impatient())
        if threading.main_thread().is_alive():  # otherwise finish() does this
            self.killer = threading.Timer(KILLED_AFTER, lambda: os._exit(exit_status_if_killed))
            self.killer.daemon = True
            self.killer.start()

    def finish(self):
        """When the main thread has ended; the exit status stays what it is."""
        self.close()
        if is_initialized():
            self.closed.wait(max(0, (self.told or time.monotonic()) + CLOSED_WITHIN - time.monotonic()))
        if self.killer:
            self.killer.cancel()
        log.flush(0.3)


class _Impatient(xmlrpc.client.Transport):
    """How a node that closes calls the master. Without it, a call that the master has not answered yet, or never will,
    holds up all that comes after it (rospy/core.py, _LockedServerProxy)."""

    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = 0.5  # s
        return connection

    def request(self, host, *args, **kwargs):
        try:
            return super().request(host, *args, **kwargs)
        except OSError as error:  # whose arguments rospy/impl/registration.py, cleanup, would trip over
            raise xmlrpc.client.ProtocolError(host, 0, str(error), {})
