#!/usr/bin/python3
"""Connections of peers, without a node."""
import os
import socket
import struct
import threading
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import rosgraph.xmlrpc
import rospy
import rosunit
from rosgraph.network import encode_ros_handshake_header
from rospy.impl import registration, tcpros_base

from actions_tutorial.robust import internals, peers
from processes import eventually
from units import UnitCase


class PeersUnits(UnitCase):

    def peers_server(self, connection_handler=None):
        """Returns rospy's server for peers, a new one, mended; and a function that connects to it and sends bytes."""
        def connect(data=b"\0\0\0\0"):
            peer = socket.create_connection(("localhost", server.port))
            self.addCleanup(peer.close)
            peer.sendall(data)
            return peer

        self.enter(mock.patch.object(tcpros_base, "_tcpros_server", None))
        tcpros_base.start_tcpros_server()
        tcpros_base.init_tcpros_server().topic_connection_handler = connection_handler
        self.addCleanup(socket.setdefaulttimeout, socket.getdefaulttimeout())
        socket.setdefaulttimeout(60)  # as rospy does when it connects
        peers.serve_all_peers()
        server = tcpros_base.init_tcpros_server().tcp_ros_server
        self.addCleanup(server.shutdown)
        return server, connect

    def test_two_threads_ask_the_master_at_once_and_a_server_whose_socket_was_closed_does_not_ask_it_on_and_on(self):
        def answer():
            asked.wait(10)
            return 1, "", "yes"

        peers.end_quietly()
        asked = threading.Barrier(2)
        with ThreadPoolExecutor(3) as threads, rosgraph.xmlrpc.ThreadingXMLRPCServer(("localhost", 0), 0) as other:
            other.register_function(answer)
            served = threads.submit(other.serve_forever)
            proxy = internals.impatient_proxy("http://localhost:%d" % other.server_address[1], 10)
            answers = [threads.submit(proxy.answer) for _ in range(2)]
            self.assertEqual(["yes", "yes"], [one.result()[2] for one in answers])
            other.server_close()
            try:
                self.assertEqual("closed", str(served.exception(10)))
            finally:
                other.shutdown()

    def test_socket_for_peers_waits_whatever_the_default_time_out_and_may_be_closed_before_its_thread_runs(self):
        server, tcpros = self.peers_server()[0], tcpros_base.init_tcpros_server()
        connect = tcpros.topic_connection_handler
        peers.serve_all_peers()
        self.assertIs(connect, tcpros.topic_connection_handler, "that of the first call")
        self.assertTrue(os.get_blocking(server.server_sock.fileno()))
        server.shutdown()
        server.run()

    def test_silent_peer_is_let_go_and_holds_up_nobody_one_that_speaks_slowly_is_heard_and_one_may_be_gone(self):
        heard, header = [], encode_ros_handshake_header({"topic": "topic"})
        _, connect = self.peers_server(lambda peer, *_: heard.append(peer.gettimeout()))
        with mock.patch.object(peers, "SPEAKS_WITHIN", 3), mock.patch.object(threading, "excepthook") as complaint:
            silent, slow, gone = connect(b""), connect(header[:3]), connect(b"")
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # with a reset
            gone.close()
            connect(header)
            eventually(lambda: heard, "the peer that speaks")
            silent.settimeout(30)
            self.assertEqual(b"", silent.recv(1))
            slow.sendall(header[3:])
            eventually(lambda: len(heard) == 2, "the slow one")
        self.assertEqual([None, None], heard, "time-outs of those that have spoken")
        complaint.assert_not_called()

    def test_peer_is_let_go_where_no_thread_can_be_had(self):
        (accepting, _), peer = self.peers_server(), mock.Mock()
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError):
            accepting.inbound_handler(peer, None)
        peer.close.assert_called_once()

    def test_peers_are_connected_one_after_the_other_by_locks_that_are_looked_up_so_and_forgotten(self):
        def alone(*_):
            inside.append(1)
            most.append(len(inside))
            threading.Event().wait(0.01)
            inside.pop()
            return threading.Lock()

        inside, most = [], []
        _, connect = self.peers_server(alone)
        one_at_a_time = peers._OneAtATime(alone)
        with mock.patch.object(peers, "ANSWERS_WITHIN", 60), ThreadPoolExecutor(20) as threads:
            for _ in range(20):
                connect(encode_ros_handshake_header({"topic": "topic"}))
            eventually(lambda: len(most) == 20 and not inside, "20 connections")
            threads.map(one_at_a_time, ["topic"] * 20, ["uri"] * 20)
        self.assertEqual(0, len(one_at_a_time._locks))
        one_at_a_time = peers._OneAtATime(lambda *_: None)
        one_at_a_time._locks = mock.Mock(setdefault=alone)
        with ThreadPoolExecutor(20) as threads:
            threads.map(one_at_a_time, range(20), range(20))
        self.assertEqual([1] * 60, most)

    def test_what_rospy_quotes_of_a_peer_steers_no_terminal(self):
        said, (_, connect) = self.logged(), self.peers_server(lambda *_: "\x1b[2J\nfake")
        connect(encode_ros_handshake_header({"topic": "topic"}))
        self.assertIn(r"\x1b[2J\nfake", eventually(lambda: said, "a warning")[0])

    def test_publishers_of_a_topic_are_those_of_all_lists_that_have_come(self):
        listener = rospy.impl.masterslave.ROSHandler("/node", None).reg_man
        registration.get_registration_listeners().add_listener(listener)
        self.addCleanup(registration.get_registration_listeners().listeners.remove, listener)
        peers.serve_all_peers()
        listener.publisher_update("another", ["elsewhere"])
        for uris in ["uri", "other"], ["uri"], []:
            listener.publisher_update("topic", uris)
        self.assertEqual([("another", ["elsewhere"]), ("topic", ["uri", "other"])], listener.updates)
        mended = listener.handler._connect_topic
        self.assertIsInstance(mended, peers._OneAtATime)
        peers.serve_all_peers()
        self.assertIs(mended, listener.handler._connect_topic, "mended once")

    def test_peer_that_fails_leaves_the_lock_to_the_next_or_to_whom_it_has_waited_for_in_vain(self):
        self.assertLessEqual(peers.ANSWERS_WITHIN, 2, "s for which one at the port of a lost peer would wait")
        lock = threading.Lock()
        patience = threading.Timer(20, lock.release)
        self.addCleanup(patience.cancel)
        patience.start()
        for is_held in False, True:
            with mock.patch.object(peers, "ANSWERS_WITHIN", 0), self.assertRaises(OSError):
                peers._in_turn(lock, mock.Mock(side_effect=OSError))
            self.assertEqual(is_held, lock.locked())
            lock.acquire(blocking=False)


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_peers", PeersUnits)
