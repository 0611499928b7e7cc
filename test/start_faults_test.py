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
LATE = 20  # s; what does not end at once when it cannot start hangs for ever


# Prints each wrong parameter, its value, and what the server or the client says of it.
PARAMETERS = """
import rospy
from actionlib.msg import TestAction
from actions_tutorial import robust

robust.init_node("node")
frequencies = 0, -1, float("nan"), float("inf"), 1e12, 1e6, "fast"
for kind, name, values in (
        (robust.SimpleActionServer, "/actionlib_status_frequency", frequencies),
        (robust.SimpleActionServer, "work/status_frequency", frequencies[:1]),
        (robust.SimpleActionServer, "actionlib_server_pub_queue_size", ["long"]),
        (robust.SimpleActionServer, "actionlib_server_sub_queue_size", ["long"]),
        (robust.SimpleActionServer, "work/status_list_timeout", ["long", -1]),
        (robust.SimpleActionClient, "actionlib_client_pub_queue_size", ["long"]),
        (robust.SimpleActionClient, "actionlib_client_sub_queue_size", ["long"])):
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
        for argument in "--help", "-h":
            client = master.node("action_client.py", argument)
            self.assertEqual(0, client.wait(), client)
            for word in ("~number_of_minutes", "7", "~server_timeout", "~heartbeat_timeout", "5", "Exit status"):
                self.assertIn(word, client.stdout, client)
            self.assertEqual("", client.stderr, client)

    def test_argument_that_is_none_is_refused(self, master):
        for argument, words in (
                ("3", "unknown argument '3'"),
                ("_number_of_minutes:=1:=2", "unknown argument '_number_of_minutes:=1:=2'"),
                ("number_of_minutes:=3", "'number_of_minutes:=3' renames a topic, must be _number_of_minutes:=3")):
            self.refused(master.node("action_client.py", argument), 2, words)
        self.refused(master.node("action_server.py", "_a:=b:=c"), 1, "'_a:=b:=c', must be NAME:=VALUE")

    def test_topic_may_be_renamed(self, master):
        master.node("action_server.py", "wash_dishes_as:=other")
        check_client(master.node("action_client.py", "wash_dishes_as:=other", "_number_of_minutes:=1"), 0, 1)

    def test_wrong_parameter_of_an_earlier_run_is_named_as_such(self, master):
        master.api.setParam("/action_client/heartbeat_timeout", "long")
        self.refused(master.node("action_client.py"), 2, "~heartbeat_timeout is 'long', must be a number from 0.1",
                     "from the parameter server; `rosparam delete /action_client`")

    def test_master_uri_that_is_none_is_named(self, master):
        for name in NODES:
            self.refused(master.node(name, ROS_MASTER_URI="localhost:11311"), 1,
                         "ROS_MASTER_URI is 'localhost:11311', must be like http://localhost:11311")

    def test_wrong_parameter_of_actionlib_stops_the_server_and_the_client_in_one_line(self, master):
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

    def test_frozen_master_is_waited_for_no_longer_than_the_time_out(self, master):
        master.process.signal(signal.SIGSTOP)
        client = master.node("action_client.py", "_server_timeout:=3")
        self.refused(client, 1, "no master %s within 3 s (~server_timeout)" % master.uri)
        self.assertGreater(client.lines[-1][0], 3, client)

    def test_time_out_counts_for_the_master_and_again_for_the_server(self, master):
        master.process.signal(signal.SIGSTOP)
        client = master.node("action_client.py", "_server_timeout:=7")
        client.expect("waiting for the master .*, 5 s")
        master.process.signal(signal.SIGCONT)
        self.assertEqual(1, client.wait(), client)
        self.assertIn("no action /wash_dishes_as within 7 s", client.stderr, client)
        self.assertGreater(client.lines[-1][0], 5 + 7, client)

    def test_frozen_master_is_said_every_5_s_and_its_return_is_noticed(self, master):
        master.process.signal(signal.SIGSTOP)
        server = master.node("action_server.py")
        server.expect("waiting for the master %s, 5 s" % master.uri)
        self.assertLess(server.usage.num_threads(), 15, server)  # one that asks, not one each 0.2 s
        master.process.signal(signal.SIGCONT)
        server.expect("waits for goals")

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
                self.assertIn(node.wait(LATE), (0, 1, -signal.SIGINT), node)
                check_quiet(node)
                said = [line for line in node.stderr.splitlines() if not line.endswith("s so far")]  # slow machine
                self.assertLessEqual(len(said), 1, "lines on stderr of %s" % node)

    def test_name_that_a_library_lacks_is_one_line_with_its_version(self, master):
        for name, lacking in (("action_server.py", "actionlib.SimpleActionServer.executeLoop"),
                              ("action_server.py", "rospy.rostime.get_rostime_cond"),
                              ("action_client.py", "rospy.core.add_shutdown_hook")):
            library, _, attribute = lacking.partition(".")[0], *lacking.rpartition(".")[1:]
            node = node_after(master, "import actionlib, rospy.core\ndel " + lacking, name)
            self.assertEqual(1, node.wait(LATE), node)
            self.assertRegex(node.stderr, r"^.*%s \d+\.\d+\.\d+ has no \S+%s, .*\n$" % (library, attribute), node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "start_faults", StartFaults)
