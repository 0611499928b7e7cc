#!/usr/bin/python3
"""The life of a goal: each bowl in its second, and one ending, on a clock that runs fast, stands still or is set back.
random_order_test.py has what clients do meanwhile."""
import signal
import time

import rospy
import rostest

from raw_client import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED
from scenes import ServerCase
from processes import bowls, check_client


class TestGoal(ServerCase):

    def test_each_bowl_and_the_result_have_their_second_without_drift(self):
        begun = self.clock.now
        goal_id = self.scene.send(60)
        for count in range(1, 61):
            self.scene.wait_bowls(goal_id, count)
            self.clock.turn(0.999, self.scene)  # too early still
            self.clock.turn(0.001)
        result = self.scene.check_ending(goal_id, SUCCEEDED, bowls(60))
        self.server.expect("goal SUCCEEDED")  # while the clock stands, and with it the heartbeat
        seconds = [(message.header.stamp - begun).to_sec() for message in self.scene.feedback[goal_id] + [result]]
        self.assertEqual([float(i) for i in range(61)], seconds, "seconds of bowls and result on the ROS clock")
        states = [state for state in self.scene.states[goal_id] if state != 0]  # PENDING may be too short to be seen
        self.assertEqual([ACTIVE, SUCCEEDED], states, str(self.scene))

    def test_goal_of_any_id_and_stamp_is_served_and_shuts_nobody_out(self):
        for unusual in ({"goal_id": "", "stamp": rospy.Time()}, {"goal_id": "long " * 200000},  # a megabyte
                        {"stamp": rospy.Time(4000000000)}, {"stamp": rospy.Time(1)}):
            for options in unusual, {}:
                known = set(self.scene.feedback)
                self.scene.send(1, **options)
                self.scene.wait(lambda: set(self.scene.feedback) - known, "feedback for a goal with %.99s" % options)
                goal_id, = set(self.scene.feedback) - known  # without an id, it is one of the server's
                self.finish(goal_id, 1)

    def test_cancel_before_the_goal_itself_comes(self):
        self.scene.cancel("early")
        self.scene.wait(lambda: self.clock.turn(0.25) or "early" in self.scene.states, "the cancel to be kept")
        self.scene.send(5, "early")
        self.assertIn("cancelled", self.scene.check_ending("early", RECALLED, []).status.text)
        self.scene.check_ending(self.scene.send(-1), ABORTED, [])
        self.assertNotIn("ignored", self.server.stderr)

    def test_burst_ends_every_goal_once_and_washes_the_last(self):
        for count in (20, 500):
            goals, last = [self.scene.send(2) for _ in range(count - 1)], self.wash(2, 1)
            self.finish(last, 2)
            self.assertNotIn(RECALLED, self.scene.states[last])
            for goal_id in goals:
                self.scene.wait(lambda: self.scene.ended(goal_id), "an ending of %s" % goal_id)
                endings = [result.status.status for result in self.scene.results.get(goal_id, [])]
                # Of so many results at once, actionlib drops some: its queue has room for 50.
                self.assertIn(endings, ([PREEMPTED], [RECALLED]) + ([],) * (count > 50), goal_id)
            self.assertLessEqual(self.scene.active_at_once, 1, "goals ACTIVE at once")

    def test_client_is_patient_while_the_clock_stands_and_when_it_jumps_while_the_server_is_stopped(self):
        self.clock.run(0.02, 0.02)  # slowly: it is to be stopped within the second after a bowl
        client = self.scene.client(3, "_heartbeat_timeout:=0.6")
        client.expect("bowl-1")
        self.clock.stop()
        with self.assertRaises(AssertionError, msg="a bowl while the clock stands"):
            client.expect("bowl-2", timeout=6)  # the fault itself: longer than the patience with a server that lives
        self.server.signal(signal.SIGSTOP)
        time.sleep(1)  # the client looks after its last status
        self.clock.turn(1000)
        time.sleep(1)  # the fault itself: the client looks again
        self.assertTrue(client.running(), client)
        self.server.signal(signal.SIGCONT)
        self.clock.run(0.08, 0.02)
        check_client(client, 0, 3)
        self.assertEqual("", client.stderr, "expected no alarm")

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
    rostest.rosrun("actions_tutorial", "goal", TestGoal)
