#!/usr/bin/python3
"""The client as its user sees it, for each parameter, ending and interruption: no goal is lost, and nobody hangs; and
the service to compare the action with."""
import os
import signal
import tempfile
import time

import rospy
import rostest
from actionlib_msgs.msg import GoalID
from actions_tutorial.srv import AddTwoNumbers

from processes import bowls, check_client, check_seconds, eventually, printed_bowls
from raw_client import PREEMPTED, SUCCEEDED
from scenes import SLACK, NodeCase, Scene, check_partial, check_quiet, concurrently


@concurrently(Scene)
class TestClient(NodeCase):

    def test_stdout_is_the_posts_lines_seven_bowls_by_default_each_there_before_the_next(self, scene):
        scene.server()
        client = scene.node("action_client.py", PYTHONUNBUFFERED="")  # whoever calls us may have set it
        self.assertEqual(0, client.wait(60), client)
        self.assertEqual("".join('Feedback received: last_dish_washed: "%s"\n' % bowl for bowl in bowls(7))
                         + "The result is: dishes_washed: \n" + "".join("  - %s\n" % bowl for bowl in bowls(7)),
                         client.stdout)
        self.assertEqual("", client.stderr)
        # Were stdout a buffer, all lines would come at the end. They are a second apart; half of it tells the two from
        # each other on a slow machine, too.
        check_seconds(client, within=0.5)

    def test_server_and_client_on_one_terminal_tell_the_story_in_its_order(self, scene):
        with tempfile.TemporaryFile("w+") as terminal:
            scene.server(stdout=terminal)
            client = scene.client(2, stdout=terminal)
            self.assertEqual(0, client.wait(), client)
            eventually(lambda: b"SUCCEEDED" in os.pread(terminal.fileno(), 9999, 0), "the server's last line", scene)
            scene.stop()
            terminal.seek(0)
            said = terminal.read()
        places = [said.find(words) for words in ("goal accepted", "bowl-0", "bowl-1", "goal SUCCEEDED: all done")]
        self.assertEqual(sorted(places), places, said)
        self.assertNotIn(-1, places, said)

    def test_no_minutes_succeed_with_an_empty_result_and_the_smallest_goal_is_aborted_with_the_reason(self, scene):
        scene.server()
        for minutes, status, why in (0, 0, "^$"), (-2**31, 1, "ABORTED: .*-2147483648.*0 or more"):
            client = scene.client(minutes)
            self.assertEqual((status, "The result is: dishes_washed: []\n"), (client.wait(), client.stdout), client)
            self.assertRegex(client.stderr, why, client)
        scene.serves()

    def test_ctrl_c_sigterm_a_closed_terminal_and_rosnode_kill_cancel_the_goal_and_no_other(self, scene):
        cancels = []
        rospy.Subscriber(scene.action + "cancel", GoalID, cancels.append)
        scene.server()
        for how in "SIGINT", "SIGTERM", "SIGHUP", "rosnode_kill":
            scene.forget()
            del cancels[:]
            client = scene.client(60, "_heartbeat_timeout:=20", "__name:=until_" + how)
            client.expect("bowl-1")
            begun = time.monotonic()
            scene.end(client, how)
            check_partial(client, 2)
            self.assertIn("goal PREEMPTED: cancelled", client.stderr, client)
            self.assertLess(time.monotonic() - begun, 2 + SLACK, "expected an end within 2 s of %s" % client)
            check_quiet(client)
            result = scene.wait_result()
            washed, goal_id = result.result.dishes_washed, result.status.goal_id.id
            scene.check_ending(goal_id, PREEMPTED, bowls(max(2, len(washed))))
            self.assertLess(scene.times[goal_id, "result"] - begun, 1 + SLACK, "s until the end of %s" % client)
            scene.wait(lambda: cancels, "the cancel, which the result may overtake")
            self.assertEqual([(goal_id, 0)], [(cancel.id, cancel.stamp.to_sec()) for cancel in cancels], client)
        scene.serves()

    def test_after_sigkill_the_server_finishes_and_the_next_says_on_ctrl_c_that_the_server_is_too_slow_to_stop(
            self, scene):
        server, client = scene.server(), scene.client(4)
        client.expect("bowl-1")
        client.signal(signal.SIGKILL)
        scene.check_ending(scene.wait_result().status.goal_id.id, SUCCEEDED, bowls(4))
        client = scene.client(60)
        client.expect("bowl-1")
        server.signal(signal.SIGSTOP)
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        self.assertIn("a cancel was sent, no ending came within 1 s", client.stderr, client)

    def test_newer_goal_preempts_a_late_ctrl_c_leaves_it_alone_and_a_newer_client_takes_the_name_over(self, scene):
        """ROS shuts the one with the name down; its last words must not take the name back."""
        scene.server()
        first = scene.client(60)
        first.expect("bowl-1")
        second = scene.client(60, "__name:=second")
        check_partial(first, 2)
        self.assertRegex(first.stderr, "PREEMPTED: .*newer goal", first)
        second.expect("bowl-0")
        second.signal(signal.SIGSTOP)  # so that it does not hear that its goal ends
        third = scene.client(60, "__name:=third")
        third.expect("bowl-0")
        second.signal(signal.SIGINT)
        second.signal(signal.SIGCONT)
        self.assertEqual(1, second.wait(), second)
        third.expect("bowl-%d" % (1 + len(printed_bowls(third)[0])))
        fourth = scene.client(3, "__name:=third")
        self.assertEqual(1, third.wait(), third)
        self.assertIn("another node took the name %s/third" % scene.namespace, third.stderr, third)
        self.assertEqual([], [line for line in third.stdout.splitlines() if not line or "shutdown" in line], third)
        self.assertEqual(0, fourth.wait(), fourth)
        named, result = printed_bowls(fourth)
        # The first bowl may be missing: it cannot tell the server's connections to it from those to the third client.
        self.assertIn((named, result), [(bowls(3), bowls(3)), (bowls(3)[1:], bowls(3))], fourth)

    def test_client_before_the_server_says_so_every_5_s_and_goes_on_when_it_comes_or_ends_by_ctrl_c(self, scene):
        client, other = scene.client(1), scene.client(1, "__name:=other")
        for seconds in 5, 10:
            client.expect("waiting for .*%s/wash_dishes_as.* %d s" % (scene.namespace, seconds))
            self.assertGreater(client.lines[-1][0], seconds - 0.5, client)
        self.assertLess(client.stderr.count("waiting for"), 10, client)
        self.assertEqual(client.stdout, "", "expected nothing on stdout")
        other.expect("waiting for")
        other.signal(signal.SIGINT)
        self.assertEqual((1, ""), (other.wait(), other.stdout), other)
        self.assertIn("interrupted while waiting for the action", other.stderr, other)
        check_quiet(other)
        scene.server()
        check_client(client, 0, 1)

    def test_sum_that_float32_cannot_hold_is_an_error_reply_and_the_server_goes_on_with_those_of_float32(self, scene):
        scene.node("add_two_numbers_server.py")
        add = rospy.ServiceProxy(scene.namespace + "/add_two_numbers", AddTwoNumbers)
        add.wait_for_service(50)
        for a in 3e38, -3e38:
            with self.assertRaises(rospy.ServiceException) as reply:
                add(a, a)
            self.assertIn("%g is %g, must be within" % (a, 2 * a), str(reply.exception))
        for a, b, total in (
                (1.5, -2.25, -0.75), (3e38, -3e38, 0), (float("inf"), 1, float("inf")),
                (0.1, 0.2, 0.30000001192092896),  # float32 of the sum of both as float32
                (16777216, 1, 16777216)):  # float32 has 24 bits
            self.assertEqual(total, add(a, b).sum, "%r + %r" % (a, b))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "client", TestClient)
