#!/usr/bin/python3
"""What the launch file starts; what prevents the start of a node, or is wrong on its command line: one line that names
it, and an exit status."""
import os
import signal
import unittest

import rostest

from scenes import check_quiet, concurrently
from processes import PACKAGE, Master, check_client, eventually, run

LAUNCH = "actions_tutorial", "wash_the_dishes.launch"

# Runs a node, a file (str), that is held up for a second: at the first, second, … (int) of Python's audit events of a
# name (str), counted from when robust begins its imports.
HELD_UP = """
import os, runpy, sys, time
seen = 0
def hold(event, args):
    global seen
    if event == %r and "actionlib" in sys.modules:
        seen += 1
        if seen == %d:
            os.write(1, b"here\\n")  # print has a lock, which a thread may hold as Python ends
            time.sleep(1)
sys.addaudithook(hold)
runpy.run_path(%r, run_name="__main__")
"""


def launch(master, *arguments):
    return master.start("roslaunch", *LAUNCH, *arguments)


def nodes(master):
    """Those that the master knows to publish, subscribe or serve, but for rosout."""
    kinds = master.api.getSystemState()
    return sorted({node for kind in kinds for _, nodes in kind for node in nodes} - {"/rosout"})


@concurrently(Master)
class StartFaults(unittest.TestCase):

    def refused(self, node, status, *words):
        """The node (Process) soon ends with this exit status, and one line on stderr that holds the words (str …)."""
        self.assertEqual(status, node.wait(), node)
        self.assertEqual("", node.stdout, node)
        self.assertEqual(1, len(node.stderr.splitlines()), "lines on stderr of %s" % node)
        for word in words:
            self.assertIn(word, node.stderr, node)

    def test_wrong_argument_or_parameter_of_the_client_is_named_and_no_goal_is_sent_on_a_renamed_topic(self, master):
        server = master.node("action_server.py", "wash_dishes_as:=other")
        server.expect("waits for goals")
        for argument, words in (
                ("_number_of_minutes:=1:=2", "argument '_number_of_minutes:=1:=2'"),
                ("_number_of_minutes:=2147483648", "is 2147483648, must be a whole number from -2147483648 to 2147"),
                ("_number_of_minutes:=-2147483649", "~number_of_minutes is -2147483649"),
                ("_server_timeout:=-1", "~server_timeout is -1, must be a number from 0"),
                ("_server_timeout:=2147483648", "~server_timeout is 2147483648, must be"),  # which no master takes
                ("_heartbeat_timeout:=0", "~heartbeat_timeout is 0, must be a number from 0.1")):
            self.refused(master.node("action_client.py", "wash_dishes_as:=other", argument), 2, words)
        with_default = master.start("/usr/bin/python3", "-c", "from actions_tutorial import robust; "
                                    "robust.init_node('node'); robust.get_param('n', 10, highest=9)")
        self.assertEqual(1, with_default.wait(), with_default)
        self.assertRegex(with_default.stderr, "ValueError: n is 10, must be a whole number to 9\n", with_default)
        master.api.setParam("/action_client/heartbeat_timeout", "long")
        self.refused(master.node("action_client.py"), 2, "~heartbeat_timeout is 'long', must be a number from 0.1",
                     "from the parameter server; `rosparam delete /action_client`")
        check_client(master.node("action_client.py", "wash_dishes_as:=other", "__name:=right", "_number_of_minutes:=1"),
                     0, 1)
        self.assertEqual(1, server.stdout.count("goal accepted"), server)
        master.api.setParam("/other/status_frequency", "fast")
        self.refused(master.node("action_server.py", "wash_dishes_as:=other"), 1, "/other/status_frequency is 'fast'")

    def test_what_stops_a_node_whatever_its_parameters_is_named_in_one_line_and_help_is_given_even_so(self, master):
        nowhere = dict(ROS_MASTER_URI="localhost:11311")
        self.refused(master.node("action_client.py", **nowhere), 1,
                     "ROS_MASTER_URI is 'localhost:11311', must be like http://localhost:11311")
        client = master.node("action_client.py", "--help", **nowhere)
        self.assertEqual((0, ""), (client.wait(), client.stderr), client)
        for word in "~number_of_minutes", "7", "~server_timeout", "~heartbeat_timeout", "5", "Exit status":
            self.assertIn(word, client.stdout, client)
        self.refused(master.node("action_server.py", "_a:=b:=c"), 1, "'_a:=b:=c', must be NAME:=VALUE")

    def test_launch_hands_the_goal_to_the_client_and_ends_with_it_and_a_wrong_one_is_not_an_earlier_runs(self, master):
        check_client(launch(master, "number_of_minutes:=2"), 0, 2)
        eventually(lambda: not nodes(master), "no node left")
        self.assertFalse(master.api.hasParam("/action_client"), "a parameter for the client's next run")
        wrong = launch(master, "number_of_minutes:=x")
        self.assertIn("number_of_minutes is 'x', must be a whole number", wrong.expect("must be").string)
        self.assertIn("this one is from the launch", wrong.stderr)
        wrong.wait()

    def test_launch_has_seven_minutes_unless_told_otherwise_and_without_client_the_server_stays(self, master):
        self.assertIn("/launched_client/number_of_minutes: 7\n", run("roslaunch", "--dump-params", *LAUNCH))
        server = launch(master, "client:=false")
        eventually(lambda: nodes(master) == ["/action_server"], "the server alone", server)
        check_client(master.node("action_client.py", "_number_of_minutes:=1"), 0, 1)
        self.assertTrue(server.running(), server)
        server.signal(signal.SIGINT)
        self.assertEqual(0, server.wait(), server)

    def test_ctrl_c_while_a_node_starts_is_one_line_at_most(self, master):
        # Where they import, and where they talk to the master; in between, Python's own handler is back for a moment.
        for name in "action_server.py", "action_client.py":
            for held in (("import", 1), ("import", 100), ("import", 300), ("socket.connect", 1), ("socket.connect", 2),
                         ("socket.bind", 1), ("socket.bind", 2)):
                path = os.path.join(PACKAGE, "scripts", name)
                node = master.start("/usr/bin/python3", "-c", HELD_UP % (*held, path))
                node.expect("here")
                node.signal(signal.SIGINT)
                self.assertIn(node.wait(), (0, 1, -signal.SIGINT), node)
                check_quiet(node)
                said = [line for line in node.stderr.splitlines() if not line.endswith("s so far")]  # slow machine
                self.assertLessEqual(len(said), 1, "lines on stderr of %s" % node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "start_faults", StartFaults)
