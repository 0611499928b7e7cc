# SPDX-License-Identifier: BSD-3-Clause
"""Peers that connect and stay silent, or many at once: the next peer is served all the same."""
import errno
import socket
import threading
import time
import weakref

from rospy.impl import registration, tcpros_base

from .internals import need

SPEAKS_WITHIN = 10  # s that a peer may take to send its first byte
ANSWERS_WITHIN = 2  # s that a publisher may take before others of its address are connected to as well


class _ListeningSocket(socket.socket):
    __slots__ = ()  # so that rospy's socket can become one

    def accept(self):
        """Without it, rospy's thread that accepts connections ends for good when the node's files have run out."""
        while True:
            try:
                return super().accept()
            except OSError as error:
                if self.fileno() < 0:
                    raise SystemExit from None  # closed, because the node ends; so does this thread
                if error.errno not in (errno.EMFILE, errno.ENFILE):
                    raise
            time.sleep(0.1)


def serve_all_peers():
    """Mends rospy's connections, once for the process. Call it after rospy.init_node."""
    _read_side_by_side()
    _connect_once()


def _read_side_by_side():
    """Give each connection a thread. Without it, rospy reads the first bytes of one before it accepts the next: one
    silent peer locks all others out (rospy/impl/tcpros_base.py, TCPServer.run)."""
    need("rospy", tcpros_base, "start_tcpros_server", "init_tcpros_server")
    tcpros_base.start_tcpros_server()
    server = tcpros_base.init_tcpros_server().tcp_ros_server  # the one that is there
    need("rospy", server, "server_sock", "inbound_handler", "start")
    if isinstance(server.server_sock, _ListeningSocket):
        return
    handle = server.inbound_handler

    def wait_and_handle(connection, address):
        connection.settimeout(SPEAKS_WITHIN)
        try:
            speaks = connection.recv(1, socket.MSG_PEEK)
        except OSError:
            speaks = False
        if speaks:
            connection.settimeout(None)
            handle(connection, address)
        else:
            connection.close()

    def handle_side_by_side(*peer):
        try:
            threading.Thread(target=wait_and_handle, args=peer, daemon=True).start()
        except RuntimeError:  # out of threads; it would end the one that accepts
            peer[0].close()

    server.inbound_handler = handle_side_by_side
    # Not one of our own for the same port: with the time-out of 60 s that rospy makes the default when it connects,
    # neither would block any more, and rospy's thread, about to accept, would end with a BlockingIOError.
    server.server_sock.__class__ = _ListeningSocket
    server.start()  # one more thread: the other is in rospy's accept(), or reads from a silent peer


def _connect_once():
    need("rospy", registration, "get_registration_listeners")
    for listener in registration.get_registration_listeners().listeners:
        need("rospy", listener, "handler")
        need("rospy", listener.handler, "_connect_topic")
        if not isinstance(listener.handler._connect_topic, _OneAtATime):
            listener.handler._connect_topic = _OneAtATime(listener.handler._connect_topic)


class _OneAtATime:
    """Without it, a peer that the master names twice in a moment, as it does when several start, is connected to twice:
    each end drops one of the two and, if not the same one, no connection is left (rospy/impl/masterslave.py,
    _connect_topic, looks for a connection and makes it later; rospy/topics.py, add_connection)."""

    def __init__(self, connect):
        self._connect, self._mutex = connect, threading.Lock()
        self._locks = weakref.WeakValueDictionary()  # (topic, URI) -> lock, as long as somebody connects

    def __call__(self, topic, uri):
        with self._mutex:
            lock = self._locks.setdefault((topic, uri), threading.Lock())
        mine = lock.acquire(timeout=ANSWERS_WITHIN)  # or the one before hangs, at a peer that is gone
        try:
            return self._connect(topic, uri)
        finally:
            if mine:
                lock.release()
