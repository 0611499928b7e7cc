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

    def waits(self, master, fault, mend):
        """Nodes say every 5 s that they wait for the master, and go on when it comes; the time-out is for it alone."""
        fault()
        server = master.node("action_server.py")
        client = master.node("action_client.py", "_number_of_minutes:=1")
        waits = "waiting for the master %s, %%d s" % master.uri
        short = master.node("action_client.py", "_server_timeout:=3", "__name:=short")
        self.assertEqual((1, ""), (short.wait(), short.stdout), short)
        self.assertRegex(short.stderr, r"^.*no master %s within 3 s \(~server_timeout\)\n$" % master.uri, short)
        self.assertGreater(short.lines[-1][0], 3, short)
        # Not sooner: a busy machine may take longer than a few seconds to start a master within its time-out.
        hasty = master.node("action_client.py", "_server_timeout:=12", "wash_dishes_as:=nobodys", "__name:=hasty")
        for node, seconds in (server, 5), (server, 10), (client, 5), (client, 10), (hasty, 5):
            node.expect(waits % seconds)
        self.assertLess(server.usage.num_threads(), 15, server)  # one that asks, not one each 0.2 s
        mend()
        server.expect("waits for goals")
        check_client(client, 0, 1)
        self.assertEqual((1, ""), (hasty.wait(), hasty.stdout), hasty)
        self.assertIn("no action /nobodys within 12 s", hasty.stderr, hasty)
        self.assertGreater(hasty.lines[-1][0], 5 + 12, hasty)

    def test_nodes_before_the_master_say_so_every_5_s_and_go_on_when_it_comes_or_end_by_server_timeout(self, master):
        self.waits(master, master.kill, master.run)

    def test_frozen_master_is_said_every_5_s_and_its_return_is_noticed_unless_server_timeout_is_over(self, master):
        self.waits(master, lambda: master.process.signal(signal.SIGSTOP),
                   lambda: master.process.signal(signal.SIGCONT))

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

    def test_ctrl_c_while_the_master_is_well(self, master):
        self.interrupt(master, lambda: None)

    def test_ctrl_c_without_a_master(self, master):
        self.interrupt(master, master.kill)

    def test_ctrl_c_while_the_master_is_frozen(self, master):
        self.interrupt(master, lambda: master.process.signal(signal.SIGSTOP))

    def interrupt(self, master, fault):
        """Clients and server end in the same way with the master and without."""
        server = master.node("action_server.py")
        first = master.node("action_client.py", "_number_of_minutes:=60")
        first.expect("bowl-1")
        second = master.node("action_client.py", "_number_of_minutes:=60", "__name:=second")
        second.expect("bowl-1")
        check_partial(first, 2)
        waiting = master.node("action_client.py", "wash_dishes_as:=nobodys", "__name:=waiting")
        waiting.expect("waiting for")
        fault()
        begun = time.monotonic()
        for node in server, waiting:
            node.signal(signal.SIGINT)
        for node, status in (second, 1), (server, 0), (waiting, 1):
            self.assertEqual(status, node.wait(), node)
            self.assertLess(time.monotonic() - begun, 2 + SLACK, "expected an end within 2 s of %s" % node)
            check_quiet(node)
        check_partial(second, 2)
        for node in server, second:
            node.expect("goal ABORTED: the server is shutting down$")
        self.assertIn("interrupted while waiting for the action", waiting.stderr, waiting)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "master_faults", MasterFaults)
