#!/usr/bin/python3
"""Servers that are interrupted, killed, frozen, restarted or replaced mid-goal: the client ends, and says why."""
import signal
import time

import rostest
from fault_case import SLACK, FaultCase, Scene, assert_partial, bowls, concurrently, kill_node, printed_bowls


@concurrently
class ServerFaults(FaultCase):

    def shut_down(self, name, interrupt):
        """A server that is told to go ends its goal first."""
        with Scene(self.master, name) as scene:
            server = scene.server()
            client = scene.client(60)
            client.expect("bowl-1")
            interrupted = time.monotonic()
            interrupt(server)
            self.assertEqual(server.wait(), 0, server)
            self.assertLess(time.monotonic() - interrupted, 2 + SLACK, "expected an end within 2 s of %s" % server)
            self.assertEqual(client.wait(), 1, client)
            self.assertLess(time.monotonic() - interrupted, 2 + SLACK, "expected an end within 2 s of %s" % client)
            self.assertRegex(client.stderr, "ABORTED.*shutting down", client)
            assert_partial(self, client, 2)
            for node in client, server:
                self.assertNotIn("Traceback", node.stdout + node.stderr, node)

    def test_sigint_aborts_the_goal_with_its_bowls(self):
        self.shut_down("sigint", lambda server: server.signal(signal.SIGINT))

    def test_sigterm_aborts_the_goal_with_its_bowls(self):
        self.shut_down("sigterm", lambda server: server.signal(signal.SIGTERM))

    def test_rosnode_kill_aborts_the_goal_with_its_bowls(self):
        self.shut_down("kill", lambda server: kill_node("/kill/action_server"))

    def silent(self, name, number):
        """A client ends when its server is silent for ~heartbeat_timeout."""
        with Scene(self.master, name) as scene:
            server = scene.server()
            client = scene.client(60, "_heartbeat_timeout:=2")
            client.expect("bowl-1")
            begun = time.monotonic()
            server.signal(number)
            self.assertEqual(client.wait(), 1, client)
            took = time.monotonic() - begun
            self.assertLess(took, 2 + 2 + SLACK, "expected an end within ~heartbeat_timeout + 2 s of %s" % client)
            self.assertGreater(took, 1.5, "expected patience for ~heartbeat_timeout of %s" % client)
            said = [line for line in client.stderr.splitlines() if "silent" in line]
            self.assertEqual(len(said), 1, "expected one line on the silence from %s" % client)
            self.assertRegex(said[0], r"silent for \d+\.\d s", client)
            self.assertNotIn("The result is", client.stdout, client)
            self.assertNotIn("Traceback", client.stderr, client)

    def test_sigkill_ends_the_client(self):
        self.silent("sigkill", signal.SIGKILL)

    def test_sigstop_ends_the_client(self):
        self.silent("sigstop", signal.SIGSTOP)

    def test_short_sigstop_is_survived(self):
        with Scene(self.master, "nap") as scene:
            server = scene.server()
            client = scene.client(4)
            client.expect("bowl-0")
            server.signal(signal.SIGSTOP)
            time.sleep(1.5)  # the fault itself: longer than a bowl, shorter than the time-out
            server.signal(signal.SIGCONT)
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(4), bowls(4)), client)

    def test_server_killed_and_started_again(self):
        with Scene(self.master, "respawn") as scene:
            server = scene.server()
            client = scene.client(60, "_heartbeat_timeout:=60")
            client.expect("bowl-1")
            server.signal(signal.SIGKILL)
            server.wait()
            scene.start_server()
            self.assertEqual(client.wait(), 1, client)
            self.assertIn("LOST", client.stderr, client)
            self.assertNotIn("The result is", client.stdout, client)
            self.assertEqual(scene.client(1, "__name:=next").wait(), 0, "the new server serves")

    def test_second_server_with_the_same_name(self):
        with Scene(self.master, "twin") as scene:
            first = scene.server()
            client = scene.client(60)
            client.expect("bowl-1")
            scene.start_server()
            first.wait()
            self.assertEqual(client.wait(), 1, client)
            self.assertRegex(client.stderr, "ABORTED|LOST|silent", client)
            for node in client, first:
                self.assertNotIn("Traceback", node.stdout + node.stderr, node)
            self.assertEqual(scene.client(1, "__name:=next").wait(), 0, "the new server serves")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "server_faults", ServerFaults)
