#!/usr/bin/python3
"""A stdout, stderr or log that takes no more: the server serves on, and a client that nobody reads cancels its goal."""
import os
import pty
import signal
import tempfile
import termios
import time

import rostest

from raw_client import ABORTED, PREEMPTED
from scenes import SLACK, NodeCase, Scene, check_quiet, concurrently
from processes import PACKAGE, bowls, check_client


@concurrently(Scene)
class OutputFaults(NodeCase):

    def serves_on(self, scene, around, words=""):
        """A server in a shell command ("$@" in around) serves, and says one line at most on stderr. If that is due to
        have these words (str), a client in such a command does its work, too, and says them as well."""
        def start(name, *arguments):
            return scene.start("bash", "-c", around, "bash", os.path.join(PACKAGE, "scripts", name), *arguments,
                               ROS_LOG_DIR=logs)

        with tempfile.TemporaryDirectory() as logs:
            server = start("action_server.py")
            scene.wait_connected(server)
            for _ in range(3):
                scene.serves()
            check_quiet(server)
            self.assertLessEqual(server.stderr.count("\n"), 1, "lines on stderr of %s" % server)
            if words:
                client = start("action_client.py", "_number_of_minutes:=2", "_heartbeat_timeout:=20")
                check_client(client, 0, 2)
                check_quiet(client)
                self.assertIn("goal accepted", server.stdout, server)
                for node in client, server:
                    self.assertEqual(1, node.stderr.count(words), "lines with '%s' of %s" % (words, node))

    def test_stdout_stderr_or_log_that_is_full_or_closed_or_cannot_be_written_or_that_nobody_reads(self, scene):
        for number, (around, *words) in enumerate((
                ('"$@" > /dev/full',), ('"$@" >&-',), ('"$@" 2>&-',), ('"$@" | head -n 1',),
                ('ln -sf /dev/full "$ROS_LOG_DIR/full"; "$@" __log:="$ROS_LOG_DIR/full"', "cannot log to"),
                # not even by root
                ('ROS_HOME=/dev/null ROS_LOG_DIR=/dev/null/log "$@"', "cannot create log directory"),
                ('ROS_LOG_DIR=/dev/full "$@"', "cannot set up the log"))):
            with Scene("%s_%d" % (scene.namespace, number)) as own:
                self.serves_on(own, around, *words)

    def test_exit_status_is_the_client_s_where_stderr_takes_nothing(self, scene):
        scene.server()
        for minutes, status in ("-1", 1), ("many", 2):
            client = scene.start("bash", "-c", "exec rosrun actions_tutorial action_client.py _number_of_minutes:=%s "
                                 "2> /dev/full" % minutes)
            self.assertEqual(status, client.wait(), client)

    def test_stdout_that_is_stopped_holds_up_no_goal_and_not_the_end(self, scene):
        reader, terminal = pty.openpty()
        termios.tcflow(terminal, termios.TCOOFF)  # as Ctrl-S does
        server = scene.server(stdout=terminal)
        scene.serves()
        goal_id = scene.send(60)
        scene.wait_bowls(goal_id, 1)
        begun = time.monotonic()
        server.signal(signal.SIGINT)
        self.assertEqual(0, server.wait(), server)
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "s until the end of %s" % server)
        self.assertEqual(ABORTED, scene.wait_result(goal_id).status.status)
        check_quiet(server)
        for end in reader, terminal:
            os.close(end)

    def test_terminal_that_nobody_reads_holds_up_no_line_of_log(self, scene):
        reader, terminal = pty.openpty()  # as of ssh without a network; it is full after some 20 000 letters
        logs = scene.start("/usr/bin/python3", "-c", """
from actions_tutorial import robust
import rospy
robust.init_node("logs")
for number in range(2000):
    rospy.loginfo("%99d", number)""", stdout=terminal)
        self.assertEqual(0, logs.wait(), logs)
        check_quiet(logs)
        for end in reader, terminal:
            os.close(end)

    def test_client_that_nobody_reads_any_more_cancels_its_goal_however_large(self, scene):
        scene.server()
        shell = scene.start("bash", "-c", "rosrun actions_tutorial action_client.py _number_of_minutes:=2147483647 "
                            "| head -n 3; echo ${PIPESTATUS[0]}")
        self.assertEqual(0, shell.wait(60), shell)
        self.assertRegex(shell.stdout, "(?m)^1$", shell)
        self.assertIn("cannot write to stdout", shell.stderr, shell)
        check_quiet(shell)
        washed = scene.wait_result().result.dishes_washed
        self.assertGreaterEqual(len(washed), 3)
        scene.check_ending(next(iter(scene.results)), PREEMPTED, bowls(len(washed)))
        scene.serves()


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "output_faults", OutputFaults)
