#!/usr/bin/python3
"""A simulation that is paused for longer than the time-out, or set back mid-goal: no false alarm, no bowl twice."""
import threading
import time
import unittest

import rospy
import rostest
from fault_case import STATE, Scene, bowls, printed_bowls, watch
from harness import Master, eventually
from rosgraph_msgs.msg import Clock


class SimulatedClock(threading.Thread):
    """Publishes /clock 50 times a second, four times as fast as real time."""

    def __init__(self):
        super().__init__(daemon=True)
        self.now, self.paused, self.lock = 1000.0, False, threading.Lock()
        self.publisher = rospy.Publisher("/clock", Clock, queue_size=1)

    def run(self):
        while not rospy.is_shutdown():
            if not self.paused:
                self.set_back(-0.08)
            time.sleep(0.02)

    def set_back(self, seconds):
        with self.lock:
            self.now -= seconds
            self.publisher.publish(rospy.Time.from_sec(self.now))


class ClockFaults(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.master = Master()
        cls.master.api.setParam("/use_sim_time", True)
        watch(cls.master)
        cls.clock = SimulatedClock()
        cls.clock.start()

    @classmethod
    def tearDownClass(cls):
        cls.master.stop()

    def test_paused_for_longer_than_the_time_out(self):
        with Scene(self.master, "paused") as scene:
            scene.server()
            client = scene.client(3, "_heartbeat_timeout:=1")
            client.expect("bowl-1")
            self.clock.paused = True
            with self.assertRaises(AssertionError, msg="expected neither an end nor a bowl of %s" % client):
                client.expect("bowl-2", timeout=4)  # the fault itself: four times ~heartbeat_timeout
            self.assertTrue(client.running(), client)
            self.clock.paused = False
            self.assertEqual(client.wait(), 0, client)
            self.assertEqual(printed_bowls(client), (bowls(3), bowls(3)), client)
            self.assertEqual(client.stderr, "", "expected no alarm")
            scene.serves()

    def test_set_back_100_s(self):
        with Scene(self.master, "back") as scene:
            scene.server()
            client = scene.client(5, "_heartbeat_timeout:=3")
            client.expect("bowl-1")
            self.clock.set_back(100)
            self.assertEqual(client.wait(20), 0, client)  # the 100 s would take 25 s on this clock
            self.assertEqual(printed_bowls(client), (bowls(5), bowls(5)), client)
            self.assertEqual([said.feedback.last_dish_washed for _, said in scene.feedback], bowls(5))
            # Its client works too, which hears the server's status, sent by a timer on the clock that was set back.
            after = scene.client(20, "_heartbeat_timeout:=2")  # which take 5 s on this clock
            self.assertEqual(after.wait(), 0, after)

    def test_set_back_between_goals(self):
        with Scene(self.master, "between") as scene:
            scene.server()
            scene.send(1, "before", rospy.Time.now())
            scene.ending("before")
            before = rospy.get_time()
            self.clock.set_back(100)
            eventually(lambda: rospy.get_time() < before - 50, "the clock set back")
            scene.send(1, "after", rospy.Time.now())
            _, result = scene.ending("after")
            self.assertEqual(result.status.status, STATE["SUCCEEDED"], result)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "clock_faults", ClockFaults)
