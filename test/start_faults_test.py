#!/usr/bin/python3
"""What prevents the start of a node, or is wrong on its command line: one line that names it, and an exit status."""
import os
import re
import signal
import time
import unittest

import rostest

from scenes import check_quiet, concurrently
from processes import PACKAGE, Master, check_client, eventually

NODES = "action_server.py", "action_client.py", "add_two_numbers_server.py"

# Prints each wrong parameter, its value, and what the server or the client says of it.
PARAMETERS = """
import rospy
from actionlib.msg import TestAction
from actions_tutorial.robust import SimpleActionClient, SimpleActionServer, init_node

init_node("node")
for kind, name, values in (
        (SimpleActionServer, "/actionlib_status_frequency", (0, -1, float("nan"), float("inf"), 1e12, 1e6, "fast")),
        (SimpleActionServer, "work/status_frequency", [0]),
        (SimpleActionServer, "work/status_list_timeout", ["long", -1]),
        *((kind, "actionlib_%s_%s_queue_size" % (side, way), ["long"]) for way in ("pub", "sub")
          for side, kind in (("server", SimpleActionServer), ("client", SimpleActionClient)))):
    for value in values:
        rospy.set_param(name, value)
        try:
            kind("work", TestAction)
        except rospy.ROSInitException as error:
            print(name, repr(value), error)
        rospy.delete_param(name)
rospy.signal_shutdown("done")
"""

# Says when robust begins its imports; from there on Ctrl-C is no traceback.
SAY_IMPORTS = """
import sys
sys.addaudithook(lambda event, args: event == "import" and args[0] == "actionlib" and print("imports", flush=True))
"""


def node_after(master, code, name):
    """Start one of the package's nodes in a Python that has run code (str). -> Process"""
    path = os.path.join(PACKAGE, "scripts", name)
    return master.start("/usr/bin/python3", "-c", "%s\nimport runpy\nrunpy.run_path(%r, run_name='__main__')" % (
        code, path))


@concurrently(Master)
class StartFaults(unittest.TestCase):

    def refused(self, node, status, *words):
        """The node (Process) soon ends with this exit status, and one line on stderr that holds the words (str …)."""
        self.assertEqual(status, node.wait(), node)
        self.assertEqual("", node.stdout, node)
        self.assertEqual(1, len(node.stderr.splitlines()), "lines on stderr of %s" % node)
        for word in words:
            self.assertIn(word, node.stderr, node)

    def test_help_shows_parameters_defaults_and_exit_statuses_without_a_master(self, master):
        master.kill()
        client = master.node("action_client.py", "--help")
        self.assertEqual((0, ""), (client.wait(), client.stderr), client)
        for word in "~number_of_minutes", "7", "~server_timeout", "~heartbeat_timeout", "5", "Exit status":
            self.assertIn(word, client.stdout, client)

    def test_wrong_argument_or_parameter_of_the_client_is_named_and_no_goal_is_sent(self, master):
        server = master.node("action_server.py")
        server.expect("waits for goals")
        for argument, words in (
                ("3", "unknown argument '3'"), ("_number_of_minutes:=1:=2", "argument '_number_of_minutes:=1:=2'"),
                ("number_of_minutes:=3", "'number_of_minutes:=3' renames a topic, must be _number_of_minutes:=3"),
                ("_number_of_minuets:=3", "~number_of_minuets, must be one of ~number_of_minutes"),
                ("_number_of_minutes:=abc", "is 'abc', must be a whole number from -2147483648 to 2147483647"),
                ("_number_of_minutes:=2147483648", "~number_of_minutes is 2147483648"),
                ("_number_of_minutes:=-2147483649", "~number_of_minutes is -2147483649"),
                ("_number_of_minutes:='7'", "~number_of_minutes is '7'"),
                ("_server_timeout:=-1", "~server_timeout is -1, must be a number from 0"),
                ("_server_timeout:=2147483648", "~server_timeout is 2147483648, must be"),  # which no master takes
                ("_heartbeat_timeout:=0", "~heartbeat_timeout is 0, must be a number from 0.1"),
                ("_heartbeat_timeout:=.nan", "~heartbeat_timeout is nan")):
            self.refused(master.node("action_client.py", argument), 2, words)
        master.api.setParam("/action_client/heartbeat_timeout", "long")
        self.refused(master.node("action_client.py"), 2, "~heartbeat_timeout is 'long', must be a number from 0.1",
                     "from the parameter server; `rosparam delete /action_client`")
        check_client(master.node("action_client.py", "__name:=right", "_number_of_minutes:=1"), 0, 1)
        self.assertEqual(1, server.stdout.count("goal accepted"), server)

    def test_topic_may_be_renamed(self, master):
        master.node("action_server.py", "wash_dishes_as:=other")
        check_client(master.node("action_client.py", "wash_dishes_as:=other", "_number_of_minutes:=1"), 0, 1)

    def test_what_stops_a_node_whatever_its_parameters_is_named_in_one_line(self, master):
        for name in NODES:
            self.refused(master.node(name, ROS_MASTER_URI="localhost:11311"), 1,
                         "ROS_MASTER_URI is 'localhost:11311', must be like http://localhost:11311")
        self.refused(master.node("action_server.py", "_a:=b:=c"), 1, "'_a:=b:=c', must be NAME:=VALUE")
        for node, name, kind in (("action_server.py", "actionlib_status_frequency", "number from 0.1 to 100"),
                                 ("action_client.py", "actionlib_client_pub_queue_size", "whole number")):
            master.api.setParam("/" + name, "fast")
            self.refused(master.node(node), 1, "/wash_dishes_as cannot start: ", name + " is 'fast', must be a " + kind)

    def test_wrong_parameter_of_actionlib_is_named_with_its_value_and_what_is_allowed(self, master):
        node = master.start("/usr/bin/python3", "-c", PARAMETERS, ROS_NAMESPACE="/below")
        self.assertEqual(0, node.wait(), node)
        for line in node.stdout.splitlines():
            name, value, said = line.split(maxsplit=2)
            self.assertRegex(said, r"^the \S.* cannot start: \S*%s is %s, must be " % (
                name.rpartition("/")[2], re.escape(value)), node)
        self.assertEqual(14, len(node.stdout.splitlines()), node)

    def test_ctrl_c_while_a_node_starts_is_one_line_at_most(self, master):
        whole = master.node("action_server.py")
        whole.expect("waits for goals")
        whole = whole.lines[-1][0]
        for name in NODES[:2]:
            for part in range(6):
                node = node_after(master, SAY_IMPORTS, name)
                node.expect("imports")
                begun = time.monotonic()
                eventually(lambda: time.monotonic() - begun >= whole * part / 6, "a part of the start", pause=0.001)
                node.signal(signal.SIGINT)
                self.assertIn(node.wait(), (0, 1, -signal.SIGINT), node)
                check_quiet(node)
                said = [line for line in node.stderr.splitlines() if not line.endswith("s so far")]  # slow machine
                self.assertLessEqual(len(said), 1, "lines on stderr of %s" % node)

    def test_name_that_a_library_lacks_is_one_line_with_its_version(self, master):
        for name, lacking in (("action_server.py", "actionlib.SimpleActionServer.internal_preempt_callback"),
                              ("action_server.py", "rospy.rostime.get_rostime_cond"),
                              ("action_client.py", "rospy.core.add_shutdown_hook")):
            library, *_, attribute = lacking.split(".")
            node = node_after(master, "import actionlib, rospy.core\ndel " + lacking, name)
            self.assertEqual(1, node.wait(), node)
            self.assertRegex(node.stderr, r"^.*%s \d+\.\d+\.\d+ has no \S+%s, .*\n$" % (library, attribute), node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "start_faults", StartFaults)
