#!/usr/bin/python3
"""Clients that are interrupted, killed, started too early, or too many: no goal is lost, and nobody hangs."""
import signal
import time

import rostest
from fault_case import SLACK, STATE, FaultCase, Scene, assert_partial, bowls, concurrently, kill_node, printed_bowls


@concurrently
class ClientFaults(FaultCase):

    def interrupted(self, name, interrupt):
        """A client that is interrupted cancels its goal, and no other."""
        with Scene(self.master, name) as scene:
            scene.server()
            client = scene.client(60)
            client.expect("bowl-1")
            interrupted = time.monotonic()
            interrupt(client)
            ended, result = scene.ending()
            status = client.wait()
            took = time.monotonic() - interrupted
            self.assertEqual(result.status.status, STATE["PREEMPTED"], result)
            self.assertGreaterEqual(len(result.result.dishes_washed), 2, "bowl-0 and bowl-1 were named")
            self.assertEqual(result.result.dishes_washed, bowls(len(result.result.dishes_washed)))
            self.assertLess(ended - interrupted, 1 + SLACK, "expected the goal's end within 1 s")
            self.assertEqual(status, 1, client)
            self.assertLess(took, 2 + SLACK, "expected the client's end within 2 s of %s" % client)
            self.assertNotIn("Traceback", client.stderr, client)
            [(_, cancel)] = scene.cancels
            self.assertEqual((cancel.id, cancel.stamp.to_sec()), (result.status.goal_id.id, 0), "its goal, no other")
            scene.serves()

    def test_sigint_cancels_the_goal(self):
        self.interrupted("sigint", lambda client: client.signal(signal.SIGINT))

    def test_sigterm_cancels_the_goal(self):
        self.interrupted("sigterm", lambda client: client.signal(signal.SIGTERM))

    def test_rosnode_kill_cancels_the_goal(self):
        self.interrupted("kill", lambda client: kill_node("/kill/action_client"))

    def test_late_ctrl_c_leaves_the_goal_of_another_client_alone(self):
        with Scene(self.master, "late") as scene:
            scene.server()
            older = scene.client(60)
            older.expect("bowl-0")
            older.signal(signal.SIGSTOP)  # so that it does not hear that its goal ends
            newer = scene.client(3, "__name:=newer")
            newer.expect("bowl-0")
            older.signal(signal.SIGINT)
            older.signal(signal.SIGCONT)
            self.assertEqual(older.wait(), 1, older)
            self.assertEqual(newer.wait(), 0, newer)
            self.assertEqual(printed_bowls(newer), (bowls(3), bowls(3)), newer)

    def test_after_sigkill_the_server_finishes_the_goal_and_serves_the_next(self):
        with Scene(self.master, "sigkill") as scene:
            scene.server()
            client = scene.client(4)
            client.expect("bowl-1")
            client.signal(signal.SIGKILL)
            client.wait()
            _, result = scene.ending()
            self.assertEqual((result.status.status, result.result.dishes_washed), (STATE["SUCCEEDED"], bowls(4)))
            scene.serves()

    def test_newer_goal_of_another_client(self):
        with Scene(self.master, "newer") as scene:
            scene.server()
            older = scene.client(60)
            older.expect("bowl-1")
            newer = scene.client(2, "__name:=newer")
            self.assertEqual(older.wait(), 1, older)
            self.assertEqual(newer.wait(), 0, newer)
            assert_partial(self, older, 2)
            self.assertIn("PREEMPTED", older.stderr, older)
            self.assertEqual(printed_bowls(newer), (bowls(2), bowls(2)), newer)

    def test_second_client_with_the_same_name(self):
        """ROS shuts the first one down; its last words must not take the name back."""
        with Scene(self.master, "twin") as scene:
            scene.server()
            first = scene.client(60)
            first.expect("bowl-1")
            second = scene.client(3)
            self.assertEqual(first.wait(), 1, first)
            self.assertEqual(second.wait(), 0, second)
            self.assertEqual(printed_bowls(second), (bowls(3), bowls(3)), second)

    def test_largest_goal_cancelled_after_3_s(self):
        with Scene(self.master, "largest") as scene:
            scene.server()
            client = scene.client(2147483647)
            client.expect("bowl-2")
            client.signal(signal.SIGINT)
            _, result = scene.ending()
            washed = result.result.dishes_washed
            self.assertGreaterEqual(len(washed), 3)
            self.assertEqual((result.status.status, washed), (STATE["PREEMPTED"], bowls(len(washed))))
            self.assertEqual(client.wait(), 1, client)
            scene.serves()

    def test_smallest_goal_is_aborted_with_the_reason(self):
        with Scene(self.master, "smallest") as scene:
            scene.server()
            client = scene.client(-2147483648)
            self.assertEqual(client.wait(), 1, client)
            self.assertRegex(client.stderr, r"ABORTED.*-2147483648", client)
            self.assertEqual(printed_bowls(client), ([], []), client)
            scene.serves()

    def test_client_before_the_server_says_so_every_5_s_and_goes_on_when_it_comes(self):
        with Scene(self.master, "early") as scene:
            client = scene.client(1)
            client.expect("waiting for .*/early/wash_dishes_as.* 5 s", stream="stderr")
            client.expect("waiting for .*/early/wash_dishes_as.* 10 s", stream="stderr")
            self.assertEqual(client.stdout, "", "expected nothing on stdout")
            scene.server()
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(1), bowls(1)), client)

    def test_server_timeout_ends_the_wait(self):
        with Scene(self.master, "noserver") as scene:
            client = scene.client(1, "_server_timeout:=1")
            self.assertEqual(client.wait(), 1, client)
            self.assertRegex(client.stderr, "/noserver/wash_dishes_as.*server_timeout", client)
            self.assertEqual(client.stdout, "", "expected nothing on stdout")

    def test_ctrl_c_ends_the_wait(self):
        with Scene(self.master, "impatient") as scene:
            client = scene.client(1)
            client.expect("waiting for", stream="stderr")
            client.signal(signal.SIGINT)
            self.assertEqual(client.wait(), 1, client)
            self.assertNotIn("Traceback", client.stderr, client)

    def test_twenty_clients_at_once(self):
        with Scene(self.master, "twenty") as scene:
            scene.server()
            clients = [scene.client(1, "__name:=client_%d" % number) for number in range(20)]
            statuses = [client.wait(60) for client in clients]
            self.assertLessEqual(set(statuses), {0, 1})
            self.assertIn(0, statuses, "the last goal at least is washed: nobody preempts it")
            endings = [result.status.goal_id.id for _, result in scene.results]
            self.assertEqual(len(set(endings)), 20, "expected an ending for each goal, came %s" % endings)
            self.assertEqual(len(endings), 20, "expected one ending a goal, came %s" % endings)
            for client, status in zip(clients, statuses):
                self.assertNotIn("Traceback", client.stderr, client)
                self.assertIn(printed_bowls(client)[1], [None, [], bowls(1)] if status else [bowls(1)], client)
            scene.serves()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "client_faults", ClientFaults)
