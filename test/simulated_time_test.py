#!/usr/bin/python3
"""Simulated time is the only time of server and client: running fast, standing still, set back."""
import signal
import time

import rostest

from processes import bowls, check_client
from raw_client import SUCCEEDED
from scenes import ServerCase


class TestSimulatedTime(ServerCase):

    def test_fifty_times_faster_also_after_a_stop(self):
        begun = self.clock.now
        goal_id = self.scene.send(60)
        self.clock.run(0.2)
        self.scene.wait_bowls(goal_id, 5)
        self.clock.stop()
        self.clock.run(0.2)
        result = self.scene.check_ending(goal_id, SUCCEEDED, bowls(60))
        for i, message in enumerate(self.scene.feedback[goal_id]):
            self.assertGreaterEqual((message.header.stamp - begun).to_sec(), i, "second of bowl-%d" % i)
        took = (result.header.stamp - begun).to_sec()
        # Exact figures are goal_test's. By the wall clock it would take 60 * 50 s.
        self.assertTrue(60 <= took < 600, "expected 60 s of ROS time, took %.1f s" % took)

    def test_clock_set_back_delays_no_bowl_repeats_none_and_shuts_no_later_goal_out(self):
        goal_id = self.wash(4, 2)
        self.clock.turn(0.5, self.scene)
        self.set_back(100)
        begun = self.clock.now
        # Little by little: the server may see the clock late, and its second begins then.
        self.scene.wait(lambda: self.clock.turn(0.1) or len(self.scene.bowls_of(goal_id)) > 2, "a third bowl")
        self.assertLess((self.clock.now - begun).to_sec(), 50, "s until the third bowl; 100 by the clock as it was")
        self.finish(goal_id, 4)
        self.set_back(100)
        self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])

    def test_no_bowl_comes_and_the_client_is_patient_while_the_clock_stands(self):
        self.clock.run(0.08, 0.02)
        client = self.scene.client(3, "_heartbeat_timeout:=0.5")
        client.expect("bowl-1")
        self.clock.stop()
        with self.assertRaises(AssertionError, msg="a bowl while the clock stands"):
            client.expect("bowl-2", timeout=6)  # the fault itself: twice the patience with a server that lives
        self.assertTrue(client.running(), client)
        self.clock.run(0.08, 0.02)
        check_client(client, 0, 3)
        self.assertEqual("", client.stderr, "expected no alarm")

    def test_client_is_patient_with_a_server_that_is_stopped_while_the_clock_jumps(self):
        self.clock.run(0.08, 0.02)
        client = self.scene.client(3)
        client.expect("bowl-0")
        self.server.signal(signal.SIGSTOP)
        time.sleep(1)  # the client looks after its last status
        self.clock.turn(1000)
        time.sleep(1)  # the fault itself: the client looks again
        self.server.signal(signal.SIGCONT)
        check_client(client, 0, 3)

    def test_client_washes_on_when_the_clock_is_set_back(self):
        self.clock.run(0.08, 0.02)
        client = self.scene.client(5, "_heartbeat_timeout:=3")
        client.expect("bowl-1")
        self.clock.turn(-100)
        client.wait(20)  # the 100 s would take 25 s on this clock
        check_client(client, 0, 5)
        # Its next client works too, which hears the server's status, sent by a timer on the clock that was set back.
        check_client(self.scene.client(20, "_heartbeat_timeout:=2"), 0, 20)  # which take 5 s on this clock


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "simulated_time", TestSimulatedTime)
