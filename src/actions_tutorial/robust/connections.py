"""Peers that connect and stay silent, or many at once: the next peer is served all the same."""
import collections
import errno
import os
import socket
import threading
import time

from rospy.impl import registration, tcpros_base

from .libraries import need

PATIENCE = 10  # s that a peer may take to send its first byte


class _ListeningSocket(socket.socket):

    def accept(self):
        """Without it, rospy's thread that accepts connections ends for good when the node's files have run out."""
        while True:
            try:
                return super().accept()
            except OSError as error:
                if error.errno not in (errno.EMFILE, errno.ENFILE):
                    raise
            time.sleep(0.1)


def serve_all_peers():
    """Call it after rospy.init_node, before the topics are there."""
    _read_side_by_side()
    _connect_once()


def _read_side_by_side():
    """Give each connection a thread. Without it, rospy reads the first bytes of one before it accepts the next: one
    silent peer locks all others out (rospy/impl/tcpros_base.py, TCPServer.run)."""
    need("rospy", tcpros_base, "start_tcpros_server", "init_tcpros_server")
    tcpros_base.start_tcpros_server()
    server = tcpros_base.init_tcpros_server().tcp_ros_server  # the one that is there
    need("rospy", server, "server_sock", "inbound_handler")
    if isinstance(server.server_sock, _ListeningSocket):
        return
    handle = server.inbound_handler

    def wait_and_handle(connection, address):
        connection.settimeout(PATIENCE)
        try:
            speaks = connection.recv(1, socket.MSG_PEEK)
        except OSError:
            speaks = False
        if speaks:
            connection.settimeout(None)
            handle(connection, address)
        else:
            connection.close()

    server.inbound_handler = lambda *peer: threading.Thread(target=wait_and_handle, args=peer, daemon=True).start()
    server.server_sock = _ListeningSocket(fileno=os.dup(server.server_sock.fileno()))  # the other is in accept() now


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
        self.connect, self.locks = connect, collections.defaultdict(threading.Lock)

    def __call__(self, topic, uri):
        with self.locks[topic, uri]:
            return self.connect(topic, uri)
