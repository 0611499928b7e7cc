#!/usr/bin/python3
"""The client as its user sees it: stdout, stderr and exit status, for each parameter and each ending."""
import signal
import time
import unittest

import rostest

from harness import Master, eventually

RESULT = "The result is: dishes_washed: \n"


def feedback(count):
    return "".join('Feedback received: last_dish_washed: "bowl-%d"\n' % i for i in range(count))


def result(count):
    return RESULT + "".join("  - bowl-%d\n" % i for i in range(count))


class TestClient(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.master = Master()
        cls.server = cls.master.node("action_server.py")
        cls.server.expect("waits for goals")

    @classmethod
    def tearDownClass(cls):
        cls.master.stop()

    def setUp(self):
        # A command line's parameters stay on the master: without this they would be the next test's defaults.
        for name in self.master.api.getParamNames():
            if name.startswith("/action_client/"):
                self.master.api.deleteParam(name)

    def client(self, *arguments, **env):
        client = self.master.node("action_client.py", *arguments, **env)
        self.addCleanup(client.stop)
        return client

    def accepted(self):
        return self.server.stdout.count("goal accepted")

    def test_stdout_is_the_posts_lines_and_no_more(self):
        client = self.client("_number_of_minutes:=2")
        self.assertEqual(0, client.wait(), client)
        self.assertEqual(feedback(2) + result(2), client.stdout)
        self.assertEqual("", client.stderr)

    def test_seven_minutes_by_default_each_line_there_before_the_next_bowl(self):
        client = self.client()
        self.assertEqual(0, client.wait(60), client)
        self.assertEqual(feedback(7) + result(7), client.stdout)
        # Were stdout a buffer, all lines would come at the end. A second apart is what the server sends; half of it
        # tells the two from each other on a slow machine, too.
        times = [at for at, _, text in client.lines if text.startswith("Feedback")]
        gaps = [after - before for before, after in zip(times, times[1:])]
        self.assertGreater(sorted(gaps)[len(gaps) // 2], 0.5, "median of the seconds between lines, of %s" % client)
        self.assertGreater(times[-1] - times[0], 5, "seconds from first to last bowl, of %s" % client)

    def test_no_minutes_succeed_with_an_empty_result(self):
        client = self.client("_number_of_minutes:=0")
        self.assertEqual(0, client.wait(), client)
        self.assertEqual("The result is: dishes_washed: []\n", client.stdout)

    def test_bad_parameter_is_named_with_its_value_and_what_is_allowed(self):
        before = self.accepted()
        int32 = "whole number from -2147483648 to 2147483647"
        cases = [("number_of_minutes", value, shown, int32) for value, shown in (
            ("abc", "'abc'"), ("3.5", "3.5"), ("99999999999", "99999999999"), ("-2147483649", "-2147483649"),
            ("true", "True"), ("[1]", "[1]"), ("[", "'['"), ("'7'", "'7'"))]
        cases += [("server_timeout", value, shown, "from 0") for value, shown in (("-1", "-1"), ("soon", "'soon'"))]
        cases += [("heartbeat_timeout", value, shown, "from 0.001") for value, shown in (
            ("0", "0"), ("-5", "-5"), (".nan", "nan"), (".inf", "inf"), ("false", "False"))]
        clients = [self.client("_%s:=%s" % (name, value)) for name, value, _, _ in cases]
        for client, (name, value, shown, allowed) in zip(clients, cases):
            with self.subTest(name=name, value=value):
                self.assertEqual(2, client.wait(60), client)
                self.assertEqual("", client.stdout)
                line, = client.stderr.splitlines()
                for word in ("~" + name, " is " + shown, allowed):
                    self.assertIn(word, line)
        self.assertEqual(before, self.accepted(), "goals sent by clients with bad parameters: %s" % self.server)

    def test_bad_parameter_on_the_master_is_refused_too(self):
        self.master.api.setParam("/action_client/heartbeat_timeout", "long")
        client = self.client()
        self.assertEqual(2, client.wait(), client)
        self.assertIn("~heartbeat_timeout is 'long', allowed is a number", client.stderr)

    def test_misspelt_parameter_is_refused(self):
        client = self.client("_number_of_minuets:=3")
        self.assertEqual(2, client.wait(), client)
        self.assertIn("~number_of_minuets is no parameter, allowed are ~number_of_minutes", client.stderr)

    def test_preempted_prints_the_partial_result_and_exits_1(self):
        older = self.client("_number_of_minutes:=30", "__name:=older")
        older.expect("bowl-1")
        newer = self.client("_number_of_minutes:=1")
        self.assertEqual((1, 0), (older.wait(), newer.wait()), "%s\n%s" % (older, newer))
        count = older.stdout.count("Feedback")
        self.assertEqual(feedback(count) + result(count), older.stdout)
        self.assertRegex(older.stderr, r"PREEMPTED: .*newer goal")
        self.assertEqual(feedback(1) + result(1), newer.stdout)

    def test_aborted_says_why_and_exits_1(self):
        client = self.client("_number_of_minutes:=-3")
        self.assertEqual(1, client.wait(), client)
        self.assertRegex(client.stderr, "ABORTED: .*-3.*0 or more")

    def test_ctrl_c_and_its_kin_cancel_the_goal(self):
        for name, stop in (("sigint", lambda client: client.signal(signal.SIGINT)),
                           ("sigterm", lambda client: client.signal(signal.SIGTERM)),
                           ("rosnode kill", lambda client: self.master.process("rosnode", "kill", "/action_client"))):
            with self.subTest(name):
                ended = self.server.stdout.count("cancelled; bowls washed")
                client = self.client("_number_of_minutes:=30")
                client.expect("bowl-0")
                stop(client)
                self.assertEqual(1, client.wait(), client)
                eventually(lambda: self.server.stdout.count("cancelled; bowls washed") == ended + 1,
                           "the goal cancelled in %s" % self.server)
                self.assertNotIn("Traceback", client.stderr)

    def test_no_server_within_the_timeout_exits_1(self):
        client = self.client("_server_timeout:=1", "wash_dishes_as:=nobodys")
        self.assertEqual(1, client.wait(), client)
        self.assertEqual("", client.stdout)
        self.assertIn("no action /nobodys within 1 s", client.stderr)

    def test_waiting_says_for_what_every_5_s(self):
        begun = time.monotonic()
        client = self.client("wash_dishes_as:=nobodys")
        client.expect("waiting for the action /nobodys, 5 s", stream="stderr")
        client.expect("waiting for the action /nobodys, 10 s", stream="stderr")
        self.assertGreater(time.monotonic() - begun, 9)
        client.signal(signal.SIGINT)
        self.assertEqual(1, client.wait(), client)
        self.assertEqual("", client.stdout)

    def test_closed_stdout_cancels_the_goal_and_exits_1(self):
        ended = self.server.stdout.count("cancelled; bowls washed")
        shell = self.master.process("bash", "-c", "rosrun actions_tutorial action_client.py _number_of_minutes:=30 "
                                    "| head -1; echo ${PIPESTATUS[0]}")
        shell.expect("^1$", timeout=60)
        eventually(lambda: self.server.stdout.count("cancelled; bowls washed") == ended + 1, "the goal cancelled")
        self.assertNotIn("Traceback", shell.stderr)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "client", TestClient)
