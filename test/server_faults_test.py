#!/usr/bin/python3
"""Servers that are killed, frozen, restarted or replaced mid-goal: the client ends, and says why."""
import signal
import time

import rospy
import rostest
from actions_tutorial.msg import WashTheDishesActionGoal

from raw_client import SUCCEEDED
from scenes import SLACK, NodeCase, Scene, check_quiet, concurrently
from processes import check_client


@concurrently(Scene)
class ServerFaults(NodeCase):

    def test_sigkill_and_sigstop_end_the_client_when_the_server_was_silent_for_the_time_out(self, scene):
        for number in signal.SIGKILL, signal.SIGSTOP:
            server = scene.node("action_server.py")
            client = scene.client(60, "_heartbeat_timeout:=2")
            client.expect("bowl-1")
            begun = time.monotonic()
            server.signal(number)
            self.assertEqual(1, client.wait(), client)
            took = time.monotonic() - begun
            self.assertLess(took, 2 + 2 + SLACK, "expected an end within ~heartbeat_timeout + 2 s of %s" % client)
            self.assertGreater(took, 1.5, "expected patience for ~heartbeat_timeout of %s" % client)
            self.assertEqual(1, client.stderr.count("silent"), "expected one line on the silence from %s" % client)
            self.assertNotIn("The result is", client.stdout, client)
            check_quiet(client)

    def test_server_killed_or_robbed_of_its_name_has_a_successor_that_serves_also_after_a_short_sigstop(self, scene):
        server = scene.node("action_server.py")
        for number, words in (signal.SIGKILL, "goal LOST"), (None, "ABORTED|LOST|silent"):
            client = scene.client(60, "_heartbeat_timeout:=60")
            client.expect("bowl-1")
            before = server
            if number:
                server.signal(number)
            server = scene.node("action_server.py")
            before.wait()
            self.assertEqual(1, client.wait(), client)
            self.assertRegex(client.stderr, words, client)
            check_quiet(before)  # rospy's client may end while it connects to the next server, with a traceback
            client = scene.client(3)
            client.expect("bowl-0")
            server.signal(signal.SIGSTOP)
            time.sleep(1.5)  # the fault itself: longer than a bowl, shorter than the time-out
            server.signal(signal.SIGCONT)
            check_client(client, 0, 3)

    def test_goal_that_waits_on_the_topic_for_the_server_is_served(self, scene):
        goal = WashTheDishesActionGoal()
        goal.goal_id.id, goal.goal.number_of_minutes = "latched", 2
        latched = rospy.Publisher(scene.action + "goal", WashTheDishesActionGoal, latch=True, queue_size=1)
        latched.publish(goal)
        scene.node("action_server.py")
        scene.wait(lambda: SUCCEEDED in scene.states.get("latched", []), "two bowls washed")
        latched.unregister()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "server_faults", ServerFaults)
