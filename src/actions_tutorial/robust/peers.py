# SPDX-License-Identifier: BSD-3-Clause
"""Peers that connect and stay silent, or many at once: the next peer is served all the same."""
import contextlib
import functools
import socket
import threading
import time
import weakref

import rosgraph.xmlrpc
from rospy.impl import registration, tcpros_base

from .internals import cannot_start, need

SPEAKS_WITHIN = 10  # s that a peer may take to send its first byte
ANSWERS_WITHIN = 2  # s that a peer may take before others are served as well

_rospy_run = tcpros_base.TCPServer.run


def end_quietly():
    """Have rospy's threads for calls and peers end with the node, and not before. Call it before rospy.init_node."""
    need("rospy", rosgraph.xmlrpc, "ThreadingXMLRPCServer")
    rosgraph.xmlrpc.ThreadingXMLRPCServer.service_actions = _end_when_closed
    tcpros_base.TCPServer.run = _run


def check_port(name, port):
    """Raises rospy.ROSInitException if the port (int; 0: any) that is called name (str) cannot be had. Without it,
    rospy waits for ever for the one for calls, and starts deaf without the one for peers."""
    if port:
        try:
            tcpros_base.TCPServer(None, port).server_sock.close()
        except (OSError, OverflowError, TypeError) as error:
            raise cannot_start("%s is %r: %s" % (name, port, error)) from error


def serve_all_peers():
    """Mends rospy's connections, once for the process. Call it after rospy.init_node."""
    _read_side_by_side()
    need("rospy", registration, "get_registration_listeners")
    for listener in registration.get_registration_listeners().listeners:
        need("rospy", listener, "publisher_update", "updates", "cond", "handler._connect_topic")
        if not isinstance(listener.handler._connect_topic, _OneAtATime):
            listener.handler._connect_topic = _OneAtATime(listener.handler._connect_topic)
            listener.publisher_update = functools.partial(_update, listener, listener.publisher_update)


def _end_when_closed(server):
    """In place of a hook of socketserver's that does nothing. Without it, rospy's thread for calls asks its closed
    socket for the next one as fast as it can, from the node's end to the program's (ros/ros_comm #2238)."""
    if server.socket.fileno() < 0:
        raise OSError("closed")


def _run(server):
    """In place of rospy's TCPServer.run: a traceback if files ran out or if the node ended before it began."""
    while server.server_sock.fileno() >= 0:
        with contextlib.suppress(OSError):
            return _rospy_run(server)
        time.sleep(0.1)


def _read_side_by_side():
    """Give each connection a thread. Without it, rospy reads the first bytes of one before it accepts the next: one
    silent peer locks all others out (rospy/impl/tcpros_base.py, TCPServer.run)."""
    need("rospy", tcpros_base, "_tcpros_server", "start_tcpros_server")
    end_quietly()
    tcpros = tcpros_base._tcpros_server
    if not tcpros:
        return  # before init_node, which says which port it has
    tcpros_base.start_tcpros_server()
    need("rospy", tcpros, "topic_connection_handler", "tcp_ros_server.server_sock", "tcp_ros_server.inbound_handler")
    server, connect, turn = tcpros.tcp_ros_server, tcpros.topic_connection_handler, threading.Lock()
    if getattr(connect, "func", None) is _in_turn:
        return
    handle = server.inbound_handler

    def wait_and_handle(connection, address):
        connection.settimeout(SPEAKS_WITHIN)
        with contextlib.suppress(OSError):
            if connection.recv(1, socket.MSG_PEEK):
                connection.settimeout(None)
                return handle(connection, address)
        connection.close()

    def handle_side_by_side(*peer):
        try:
            threading.Thread(target=wait_and_handle, args=peer, daemon=True).start()
        except RuntimeError:  # out of threads; it would end the one that accepts
            peer[0].close()

    server.inbound_handler = handle_side_by_side
    # Without it, a peer's first messages are lost now and then: rospy tells it that it is connected and then writes
    # that down (rospy/impl/tcpros_pubsub.py, topic_connection_handler), which takes long side by side.
    tcpros.topic_connection_handler = functools.partial(_in_turn, turn, connect)


def _update(listener, update, topic, uris):
    """Without it, a node that starts beside another may never be connected to it: of two lists of a topic's publishers
    rospy believes the one that came last, which can be the master's answer to the registration, made before the other
    was there, after the master's news of the other (rospy/impl/registration.py, RegManager.run)."""
    with listener.cond:
        waiting = [uri for name, older in listener.updates if name == topic for uri in older]
        listener.updates = [one for one in listener.updates if one[0] != topic]
        update(topic, list(dict.fromkeys(waiting + uris)))


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
        return _in_turn(lock, self._connect, topic, uri)


def _in_turn(lock, function, *args):
    """Returns function(*args), called with the lock, or after a while without: who has it hangs, at a lost peer."""
    mine = lock.acquire(timeout=ANSWERS_WITHIN)
    try:
        return function(*args)
    finally:
        if mine:
            lock.release()
