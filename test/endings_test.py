#!/usr/bin/python3
"""Every goal gets one ending, with a text, whatever the program of its server does; the programs: guest_servers.py."""
import os
import re
import signal
import statistics
import time

import rospy
import rostest
from actionlib_msgs.msg import GoalStatusArray
from std_msgs.msg import Empty

from raw_client import ABORTED, ACTIVE, PREEMPTED, PREEMPTING, RECALLED, SUCCEEDED, RawClient
from scenes import SLACK, NodeCase, Scene, concurrently
from guest_servers import WAYS
from processes import PACKAGE, bowls, eventually

GUEST = os.path.join(PACKAGE, "test", "guest_servers.py")
SHUTTING_DOWN = "the server is shutting down"


def busy(probe):
    """Give the server a goal without an end of its own. Returns its id."""
    goal_id = probe.send(5)
    probe.wait_bowls(goal_id, 1)
    return goal_id


# kind: the line by which a second goal is known to wait
WAIT = {"never_looks": "told to stop", "preempt_cb_blocks": "^blocks"}

# title: how a node is told to end, how many tracebacks of its own program are in order, and its servers
SHUTDOWNS = {
    "two servers by rosnode kill": ("rosnode_kill", 0, "sleeps", "never_looks"),
    "two servers by signal_shutdown": ("signal_shutdown", 0, "just_returns", "sleeps"),
    "25 servers": ("SIGTERM", 0, *("polite%d" % i for i in range(25))),
    "all kinds of servers in one node": (
        "SIGINT", 2, "polite", "sleeps", "never_looks", "just_returns", "preempt_cb_raises", "preempt_cb_blocks",
        "goal_cb_and_thread", "goal_cb_loops", "own_names", "is_interrupted", "is_stopped", "hook_raises"),
    "a server that sleeps when main has ended": ("SIGINT", 0, "sleeps_when_main_has_ended"),
    "a server whose hook blocks": ("SIGINT", 0, "hook_blocks"),  # alone, for rospy.is_shutdown() never comes
}


def a_test_for_each(table, check):
    """Class decorator: a test, check(self, scene, *row), for each row of table {title: row}."""
    def decorate(case):
        for title, row in table.items():
            def test(self, scene, row=row):
                check(self, scene, *row)
            test.__name__ = "test_" + title.replace(" ", "_")
            setattr(case, test.__name__, test)
        return case
    return decorate


def shut_down(test, scene, how, tracebacks, *kinds):
    """Each goal of each server ends within the second, the one that waits, too; the node within 2 s."""
    rospy.set_param(scene.namespace + "/actionlib_status_frequency", min(20, 100 // len(kinds)))
    server, due = scene.start(GUEST, *kinds), {}  # (probe, goal id): its ending
    order = []  # (probe, goal id, goal id that ends later)
    for kind in kinds:
        probe = (RawClient("%s/%s" % (scene.namespace, kind)) if kinds[1:] else scene).wait_connected(server)
        runs = busy(probe)
        due[probe, runs] = [(ABORTED, SHUTTING_DOWN)]
        if kind in WAIT:
            waits = probe.send(5)
            server.expect(WAIT[kind])
            due[probe, waits] = [(RECALLED, SHUTTING_DOWN)]
            if kind == "never_looks":
                order.append((probe, waits, runs))
    begun = time.monotonic()
    if how == "signal_shutdown":
        rospy.Publisher(scene.namespace + "/guest/end", Empty, queue_size=1, latch=True).publish()
    else:
        scene.end(server, how, "guest")
    eventually(lambda: all(probe.results.get(goal_id) and probe.ended(goal_id) for probe, goal_id in due),
               "an ending of each goal", scene, *(probe for probe, _ in due), timeout=1 + SLACK)
    test.assertEqual(0, server.wait(2 + SLACK - (time.monotonic() - begun)), server)
    for (probe, goal_id), endings in due.items():
        came = [(one.status.status, one.status.text) for one in probe.results[goal_id]]
        test.assertEqual(endings, came, "endings of %s by %s" % (probe.action, server))
        if "sleeps" in probe.action and len(kinds) <= 2:
            test.assertEqual(bowls(1), probe.results[goal_id][0].result.dishes_washed, "own result of %s" % server)
        if probe is not scene:
            probe.close()
    for probe, *goals in order:
        test.assertLess(*(probe.results[goal_id][0].header.stamp for goal_id in goals))
    test.assertLessEqual(server.stderr.count("Traceback"), tracebacks, server)


def end(test, scene, kind, _, state, text, log):
    """The goal ends so, once; the next ones have their own; the log tells the truth, and steers no terminal."""
    server = scene.server(GUEST, kind)
    goal_id = scene.send(5)
    ending = scene.wait_result(goal_id)
    test.assertEqual(state, ending.status.status, "%s\n%s" % (ending.status, server))
    test.assertRegex(ending.status.text, text, server)
    if state == SUCCEEDED and kind != "work_after_the_ending":
        scene.check_ending(goal_id, SUCCEEDED, ending.result.dishes_washed)
    for _ in range(2):
        scene.serves()
    if log:
        server.expect(log)
    server.signal(signal.SIGINT)
    server.wait()  # so that all is said
    test.assertEqual(1, len(scene.results[goal_id]), scene)
    said = server.stdout + server.stderr
    test.assertEqual(said.count("goal SUCCEEDED"), 2 + (state == SUCCEEDED), server)
    test.assertNotRegex(said, re.compile("\x1b|^fake", re.MULTILINE), server)
    test.assertEqual(kind == "ending_twice", "To transition" in said, "one ending too many of %s" % server)


@concurrently(Scene)
@a_test_for_each({"shutdown of " + title: row for title, row in SHUTDOWNS.items()}, shut_down)
@a_test_for_each({kind: (kind, *row) for kind, row in WAYS.items()}, end)
class Endings(NodeCase):

    def test_goal_that_comes_during_the_shutdown_is_recalled_and_work_on_an_ended_one_has_no_effect(self, scene):
        for kind in "goal_cb_and_nap", "goes_on":
            server = scene.server(GUEST, kind)
            runs = busy(scene)
            server.signal(signal.SIGINT)
            server.expect("told to stop")  # less than a second is left
            ending = scene.wait_result(scene.send(5))
            self.assertEqual((RECALLED, SHUTTING_DOWN), (ending.status.status, ending.status.text), server)
            self.assertLess(ending.header.stamp, scene.wait_result(runs).header.stamp)
            server.wait()
            self.assertEqual(([], bowls(1)), (scene.bowls_of(ending.status.goal_id.id), scene.bowls_of(runs)), server)
            self.assertIn("did not stop within 1 s", server.stderr, server)
            self.assertNotIn("ERROR", server.stderr, server)
            self.assertEqual(scene.shown[runs, ABORTED], scene.status.header.stamp, "the last status of %s" % server)
            self.assertLess(scene.wait_result(runs).header.stamp, scene.status.header.stamp)

    def test_result_comes_a_moment_after_the_feedback_and_its_status_next_without_a_heartbeat_or_a_word(self, scene):
        rospy.set_param(scene.namespace + "/actionlib_status_frequency", 0.1)
        # The complaints are the library's, that no goal waits.
        for kind, head_start, complaints in ("polite", 0.004, 0), ("goal_cb_accepts_twice", 0, 1):
            server = scene.server(GUEST, kind)
            server.expect("waits for goals", timeout=5)
            goal_id = scene.send(1)
            result = scene.check_ending(goal_id, SUCCEEDED, bowls(1)).header.stamp
            before = (result - scene.feedback[goal_id][0].header.stamp).to_sec()
            self.assertGreater(before, 0.019, "s between feedback and result of %s" % server)
            after = (scene.shown[goal_id, SUCCEEDED] - result).to_sec()
            self.assertTrue(head_start <= after < 1, "%.4f s after the result of %s" % (after, server))
            for line in "goal accepted: number_of_minutes 1", "goal SUCCEEDED: all done":
                server.expect(": %s: %s$" % (scene.action[:-1], line), timeout=5)
            server.signal(signal.SIGINT)
            self.assertEqual(0, server.wait(), server)
            self.assertRegex(server.stderr, r"^(.*a new goal is not available.*\n){%d}$" % complaints, server)
        for kind in "never_looks", "preempt_cb_raises":
            server = scene.server(GUEST, kind)
            goal_id = busy(scene)
            scene.cancel(goal_id)
            scene.wait(lambda: (goal_id, PREEMPTING) in scene.shown, "a status that it is to stop", timeout=5)
            server.stop()

    def test_cancel_wakes_a_sleep_though_the_callback_for_it_raises(self, scene):
        scene.server(GUEST, "preempt_cb_raises_and_sleeps")
        goal_id = busy(scene)
        scene.cancel(goal_id)
        scene.check_ending(goal_id, PREEMPTED, bowls(1))

    def test_newer_goal_wakes_the_thread_of_the_older_one_and_is_active_before_its_feedback(self, scene):
        server, goals = scene.server(GUEST, "goal_cb_and_nap"), []
        while len(goals) < 5:
            goals.append(busy(scene))
            # A rate is the goal's that runs when it is made.
            eventually(lambda: server.stderr.count("sleeps") == len(goals), "a thread that sleeps", server)
        scene.wait(lambda: all((one, ACTIVE) in scene.shown for one in goals), "a status of each that is ACTIVE")
        late = [one for one in goals if scene.shown[one, ACTIVE] > scene.feedback[one][0].header.stamp]
        self.assertEqual([], late, "goals that were ACTIVE only after their feedback")
        eventually(lambda: server.stderr.count("slept to the end: False") == 4, "four who woke up", server, timeout=10)

    def test_node_of_rospys_with_silent_peers_and_a_stopped_terminal_serves_and_hears_sigterm(self, scene):
        read, write = os.pipe()
        server = scene.start("bash", "-c", 'head -c 65536 /dev/zero; exec "$0" with_silent_peers', GUEST, stdout=write,
                             INIT="rospy")
        scene.wait_connected(server)
        client = scene.client(1)
        self.assertEqual(0, client.wait(), client)
        goal_id = busy(scene)
        server.signal(signal.SIGTERM)
        ending = scene.wait_result(goal_id)
        self.assertEqual((SHUTTING_DOWN, bowls(1)), (ending.status.text, ending.result.dishes_washed), server)
        server.wait(5 + SLACK)
        for one in read, write:
            os.close(one)

    def test_frequency_of_the_status_that_makes_sense_is_kept(self, scene):
        statuses = []
        subscriber = rospy.Subscriber(scene.action + "status", GoalStatusArray, statuses.append)
        self.addCleanup(subscriber.unregister)
        for frequency in 1, 20:
            rospy.set_param(scene.namespace + "/actionlib_status_frequency", frequency)
            server = scene.server(GUEST, "polite")
            del statuses[:]
            scene.wait(lambda: len(statuses) > 5 + frequency, "some of each status")
            stamps = [message.header.stamp.to_sec() for message in statuses]
            gaps = [after - before for before, after in zip(stamps, stamps[2:])]  # each sent twice would have one of 0
            self.assertAlmostEqual(2, statistics.median(gaps) * frequency, delta=0.9)
            server.stop()

    def test_second_server_of_an_action_names_the_node_of_the_first_its_own_too(self, scene):
        first = scene.server(GUEST, "polite", "__name:=first")
        for kinds, name, other in (["polite"], "second", "first"), (["polite", "polite"], "both", "both"):
            node = scene.start(GUEST, *kinds, "__name:=" + name)
            node.expect("wash_dishes_as has another server, in the node %s/%s: " % (scene.namespace, other))
        self.assertNotIn("another server", str(first))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "endings", Endings)
