#!/usr/bin/python3
"""A master that comes late, is killed, frozen or started again: goals go on, new nodes work, nobody hangs."""
import signal
import time
import unittest

import rostest

from scenes import SLACK, check_partial, check_quiet, concurrently
from processes import Master, check_client


@concurrently(Master)
class MasterFaults(unittest.TestCase):

    def test_client_before_the_master_says_so_every_5_s_and_goes_on_when_it_comes(self, master):
        master.kill()
        client = master.node("action_client.py", "_number_of_minutes:=1")
        for seconds in 5, 10:
            client.expect("waiting for .*%s.* %d s" % (master.uri, seconds))
        self.assertEqual(client.stdout, "", "expected nothing on stdout")
        master.run()
        master.node("action_server.py")
        check_client(client, 0, 1)

    def test_server_timeout_ends_the_wait_for_the_master(self, master):
        master.kill()
        client = master.node("action_client.py", "_server_timeout:=1")
        self.assertEqual(client.wait(), 1, client)
        self.assertRegex(client.stderr, "master.*server_timeout", client)
        self.assertEqual(client.stdout, "", "expected nothing on stdout")

    def test_goal_goes_on_without_the_master_and_new_nodes_work_with_the_next(self, master):
        server = master.node("action_server.py")
        client = master.node("action_client.py", "_number_of_minutes:=4")
        client.expect("bowl-1")
        master.kill()
        check_client(client, 0, 4)
        self.assertTrue(server.running(), server)
        master.run()
        master.node("action_server.py")
        check_client(master.node("action_client.py", "_number_of_minutes:=1"), 0, 1)

    def gone(self, node, begun, status):
        self.assertEqual(node.wait(), status, node)
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "expected an end within 2 s of %s" % node)
        check_quiet(node)

    def test_ctrl_c_without_a_master(self, master):
        self.interrupt(master, master.kill)

    def test_ctrl_c_while_the_master_is_frozen(self, master):
        self.interrupt(master, lambda: master.process.signal(signal.SIGSTOP))

    def interrupt(self, master, fault):
        """Client and server end as ever without the master."""
        server = master.node("action_server.py")
        first = master.node("action_client.py", "_number_of_minutes:=60")
        first.expect("bowl-1")
        second = master.node("action_client.py", "_number_of_minutes:=60", "__name:=second")
        second.expect("bowl-1")
        check_partial(first, 2)
        fault()
        begun = time.monotonic()
        server.signal(signal.SIGINT)
        self.gone(second, begun, 1)
        check_partial(second, 2)
        self.assertIn("ABORTED", second.stderr, second)
        self.gone(server, begun, 0)

    def test_ctrl_c_on_a_waiting_client_while_the_master_is_frozen(self, master):
        client = master.node("action_client.py")
        client.expect("waiting for")
        master.process.signal(signal.SIGSTOP)
        begun = time.monotonic()
        client.signal(signal.SIGINT)
        self.gone(client, begun, 1)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "master_faults", MasterFaults)
