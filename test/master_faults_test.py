#!/usr/bin/python3
"""A master that comes late, is killed, frozen or started again: goals go on, new nodes work, nobody hangs."""
import signal
import time
import unittest

import rostest
from fault_case import SLACK, assert_partial, bowls, concurrently, printed_bowls
from harness import Master


@concurrently
class MasterFaults(unittest.TestCase):
    def test_client_before_the_master_says_so_every_5_s_and_goes_on_when_it_comes(self):
        with Master() as master:
            master.kill()
            client = master.node("action_client.py", "_number_of_minutes:=1")
            client.expect("waiting for .*%s.* 5 s" % master.uri, stream="stderr")
            client.expect("waiting for .*%s.* 10 s" % master.uri, stream="stderr")
            self.assertEqual(client.stdout, "", "expected nothing on stdout")
            master.start()
            master.node("action_server.py")
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(1), bowls(1)), client)

    def test_server_timeout_ends_the_wait_for_the_master(self):
        with Master() as master:
            master.kill()
            client = master.node("action_client.py", "_server_timeout:=1")
            self.assertEqual(client.wait(), 1, client)
            self.assertRegex(client.stderr, "master.*server_timeout", client)
            self.assertEqual(client.stdout, "", "expected nothing on stdout")

    def test_goal_goes_on_without_the_master_and_new_nodes_work_with_the_next(self):
        with Master() as master:
            server = master.node("action_server.py")
            client = master.node("action_client.py", "_number_of_minutes:=4")
            client.expect("bowl-1")
            master.kill()
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(4), bowls(4)), client)
            self.assertTrue(server.running(), server)
            master.start()
            master.node("action_server.py")
            client = master.node("action_client.py", "_number_of_minutes:=1")
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(1), bowls(1)), client)

    def gone(self, node, begun):
        status = node.wait()
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "expected an end within 2 s of %s" % node)
        self.assertNotIn("Traceback", node.stdout + node.stderr, node)
        return status

    def test_ctrl_c_without_a_master(self):
        self.interrupt(lambda master: master.kill())

    def test_ctrl_c_while_the_master_is_frozen(self):
        self.interrupt(lambda master: master.signal(signal.SIGSTOP))

    def interrupt(self, fault):
        """Client and server end as ever without the master."""
        with Master() as master:
            server = master.node("action_server.py")
            first = master.node("action_client.py", "_number_of_minutes:=60")
            first.expect("bowl-1")
            second = master.node("action_client.py", "_number_of_minutes:=60", "__name:=second")
            second.expect("bowl-1")
            assert_partial(self, first, 2)
            fault(master)
            begun = time.monotonic()
            server.signal(signal.SIGINT)
            self.assertEqual(self.gone(second, begun), 1)
            assert_partial(self, second, 2)
            self.assertIn("ABORTED", second.stderr, second)
            self.assertEqual(self.gone(server, begun), 0)

    def test_ctrl_c_on_a_waiting_client_while_the_master_is_frozen(self):
        with Master() as master:
            client = master.node("action_client.py")
            client.expect("waiting for", stream="stderr")
            master.signal(signal.SIGSTOP)
            begun = time.monotonic()
            client.signal(signal.SIGINT)
            self.assertEqual(self.gone(client, begun), 1)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "master_faults", MasterFaults)
