#!/usr/bin/python3
"""What robust does without a node and without a master."""
import ast
import atexit
import contextlib
import functools
import inspect
import io
import logging
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
import warnings
import weakref
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import actionlib
import rospy
import rosunit
from actionlib.msg import TestActionFeedback, TestActionGoal, TestActionResult
from actionlib_msgs.msg import GoalID, GoalStatus
from rosgraph.network import encode_ros_handshake_header
from rosgraph.roslogging import RosStreamHandler
from rospy.impl import registration, tcpros_base

from actions_tutorial import robust
from actions_tutorial.robust import client, internals, log, node, parameters, peers, rate, server, shutdown, stdout
from processes import eventually

STANDS_FOR = {name: getattr(rospy if hasattr(rospy, name) else actionlib, name)
              for name in ("init_node", "get_param", "SimpleActionServer", "SimpleActionClient")}


def arguments(*values):
    """A command line with these arguments (str)."""
    return mock.patch.object(sys, "argv", ["node", *values])


@contextlib.contextmanager
def closer():
    """A Closer that hears signals, but does not run, and gives up."""
    one = shutdown.Closer()
    try:
        one.heed_signals()
        yield one
    finally:
        one.give_up()


def record(*line):
    """A logging.LogRecord of arguments of rospy.loginfo."""
    return logging.LogRecord("rosout", logging.INFO, "file", 1, line[0], line[1:], None)


def takes(function):
    """Returns name, kind and whether there is a default, of each parameter of function but those that are additions:
    keyword-only ones with a default."""
    parameters = inspect.signature(function).parameters.values()
    return [(each.name, each.kind, each.default is not each.empty) for each in parameters
            if each.kind != each.KEYWORD_ONLY or each.default is each.empty]


def written(name, function):
    """Returns the signature of function, called name, as doc/robust.md writes it."""
    signature = inspect.signature(function)
    parts = str(signature.replace(return_annotation=signature.empty, parameters=[
        each.replace(annotation=each.empty) for each in signature.parameters.values() if each.name != "self"]))
    return name + re.sub("<object[^>]*>", "…", parts).replace("rospy.Duration[0]", "rospy.Duration()")


class Units(unittest.TestCase):

    def test_parameter_of_the_command_line_has_the_type_of_its_default(self):
        for text, default, limits, value in (
                ("3", 7, {}, 3), ("3", 0.5, {}, 3.0), ("true", False, {}, True), ("a", "b", {}, "a"),
                ("[1]", [], {}, [1]), ("{a: 1}", {}, {}, {"a": 1}), ("3", 7, {"lowest": 3, "highest": 3}, 3),
                ("3", 7, {"lowest": 3}, 3), ("3", 7, {"highest": 3}, 3), ("3", None, {}, 3), ("[1]", (1, 2), {}, [1])):
            with arguments("_n:=" + text):
                got = robust.get_param("~n", default, **limits)
                self.assertEqual((type(value), value), (type(got), got), text)

    def test_default_counts_where_the_command_line_gives_another_or_none(self):
        for default in 7, 0.5, "text", True, [1], {"a": 1}, None, (1, 2):
            with arguments("_other:=3", "n:=4", "__n:=5", "an:=6"):
                self.assertEqual(default, robust.get_param("~n", default))

    def test_wrong_parameter_is_a_value_error_that_names_it_its_value_and_what_is_allowed(self):
        for text, default, limits, words in (
                ("a", 7, {}, "is 'a', must be a whole number"), ("1.5", 7, {}, "is 1.5, must be a whole number"),
                ("true", 7, {}, "is True, must be a whole number"), ("true", 0.5, {}, "is True, must be a number"),
                ("1", True, {}, "is 1, must be true or false"), ("1", "text", {}, "is 1, must be a string"),
                ("1", [], {}, "is 1, must be a list"), ("[1]", {}, {}, r"is \[1\], must be a dictionary"),
                ("[", 7, {}, r"is '\[', must be a whole number"), (".nan", 0.5, {"lowest": 0}, "is nan, must be "),
                ("[1]", 7, {}, r"is \[1\], must be a whole number"), (".inf", 0.5, {"lowest": 0}, "is inf, must be "),
                ("-.inf", 0.5, {"highest": 9}, "is -inf, must be "),
                ("soon", 0.5, {}, "is 'soon', must be a number"), ("false", 0.5, {}, "is False, must be a number"),
                ("-1", 7, {"lowest": 0}, "is -1, must be a whole number from 0$"),
                ("3", 0.5, {"highest": 1.5}, "is 3, must be a number to 1.5$"),
                ("10", 7, {"lowest": 0, "highest": 9}, "is 10, must be a whole number from 0 to 9$")):
            with arguments("_n:=" + text), self.assertRaisesRegex(ValueError, "^~n " + words):
                robust.get_param("~n", default, **limits)

    def test_wrong_argument_is_one_line_and_exit_status_2_and_help_is_0(self):
        for argument, status, words in (
                ("3", 2, "unknown argument '3'"), ("_n:=a", 2, "~n is 'a', must be a whole number from 0 to 9"),
                ("_m:=3", 2, "unknown parameter ~m, must be one of ~n"), ("_n:=10", 2, "~n is 10, must be"),
                ("n:=3", 2, "'n:=3' renames a topic, must be _n:=3"), ("--help", 0, "how to"), ("-h", 0, "how to"),
                ("~n:=3", 2, "'~n:=3' renames a topic, must be _n:=3"), ("--n=3", 2, "unknown argument '--n=3'"),
                ("_name:=x", 2, "unknown parameter ~name, must be one of ~n; __name:=VALUE names the node")):
            said = io.StringIO()
            with arguments(argument), mock.patch.object(sys, "excepthook", sys.excepthook), \
                    contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), \
                    self.assertRaises(SystemExit) as end:
                robust.init_node("node", usage="how to", parameters={"~n": (7, 0, 9)})
            self.assertEqual(status, end.exception.code, argument)
            self.assertIn(words, said.getvalue())
            self.assertEqual(1, said.getvalue().count("\n"), said.getvalue())

    def test_master_uri_that_is_none_is_named(self):
        for uri in "localhost:11311", "http://", "http://localhost", "http://localhost:port", "http://:1", \
                "https://localhost:1":
            with mock.patch.dict("os.environ", ROS_MASTER_URI=uri), arguments(), self.assertRaisesRegex(
                    rospy.ROSInitException, "^ROS_MASTER_URI is '%s', must be like http://localhost:11311$" % uri):
                robust.init_node("node")

    def test_robust_has_what_actionlib_has(self):
        self.assertEqual([], [name for name, value in vars(actionlib).items() if not (
            name.startswith("_") or inspect.ismodule(value) or hasattr(robust, name))])

    def test_signatures_are_those_of_rospy_and_actionlib_and_additions_are_keyword_only(self):
        for name, theirs in STANDS_FOR.items():
            ours = getattr(robust, name)
            pairs = {name: (theirs, ours)}
            if inspect.isclass(theirs):
                pairs = {"%s.%s" % (name, method): (getattr(theirs, method), getattr(ours, method))
                         for method in ["__init__"] + [each for each in vars(theirs) if each[0] != "_"]}
            for what, (their, our) in pairs.items():
                self.assertEqual(takes(their), takes(our), what)

    def test_reference_has_the_signature_of_each_public_name_and_the_package_the_version(self):
        root = pathlib.Path(__file__).resolve().parent.parent
        page = (root / "doc" / "robust.md").read_text()
        for name in STANDS_FOR:
            ours = getattr(robust, name)
            public = {name: ours}
            if inspect.isclass(ours):
                public.update((method, function) for method, function in vars(ours).items()
                              if not method.startswith(("_", "internal_", "executeLoop")) and callable(function))
            for called, function in public.items():
                self.assertIn("`%s`" % written(called, function), page)
                self.assertTrue(inspect.getdoc(function), called)
        self.assertIn("<version>%s</version>" % robust.__version__, (root / "package.xml").read_text())

    def test_what_the_libraries_do_not_document_is_looked_for_at_the_start_and_what_is_looked_for_is_used(self):
        needed, private, ours, used = set(), {"_connection_header", "_exit"}, set(), set()  # these are documented
        for file in pathlib.Path(robust.__file__).parent.glob("*.py"):
            for part in ast.walk(ast.parse(file.read_text())):
                if isinstance(part, ast.Call) and getattr(part.func, "id", "") == "need":
                    needed.update(*(ast.literal_eval(name).split(".") for name in part.args[2:]))
                elif isinstance(part, ast.Attribute):
                    (ours if isinstance(part.ctx, ast.Store) else used).add(part.attr)
                elif isinstance(part, (ast.FunctionDef, ast.ClassDef)):
                    ours.add(part.name)
        self.assertEqual(set(), {name for name in used if re.match("_[^_]", name)} - ours - needed - private)
        self.assertEqual(set(), needed - used - ours)
        with self.assertRaisesRegex(rospy.ROSInitException, "^rospy .* has no rospy.core.nothing, which robust needs"):
            internals.need("rospy", rospy, "core.is_initialized", "core.nothing")

    def test_get_param_in_rospys_place_takes_any_number(self):
        with mock.patch.object(rospy, "get_param", robust.get_param), arguments("_n:=0.5"):
            self.assertEqual(0.5, rospy.get_param("~n", 7))
            with self.assertRaisesRegex(ValueError, "must be true or false"):
                rospy.get_param("~n", True)

    def test_import_touches_no_signal_where_ctrl_c_is_not_pythons_own_or_others_may_be_using_it(self):
        for before, how in (("signal.signal(signal.SIGINT, print)", "load()"), ("sys.ps1 = ''", "load()"),
                            ("import rospy", "load()"), ("", "threading.Thread(target=load).start()")):
            code = ("import signal, sys, threading\n%s\nfailures, signal.signal = [1], lambda *_: failures.append(2)\n"
                    "def load():\n    from actions_tutorial import robust\n    failures.remove(1)\n%s\n"
                    "[one.join() for one in threading.enumerate() if one is not threading.main_thread()]\n"
                    "sys.exit(bool(failures))" % (before, how))
            self.assertEqual(0, subprocess.call(["/usr/bin/python3", "-c", code]), code)

    def test_start_that_fails_leaves_no_thread_signal_or_hook_behind(self):
        def process():
            return signal.set_wakeup_fd(-1), rospy.core.signal_shutdown, [
                signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]

        before = process()
        with mock.patch.object(atexit, "register") as added, mock.patch.object(atexit, "unregister") as removed, \
                mock.patch.dict("os.environ", ROS_MASTER_URI="http://localhost:1"), \
                self.assertRaisesRegex(rospy.ROSInitException, "no master"), arguments("_server_timeout:=0.01"):
            robust.init_node("node", parameters={"~server_timeout": (0.0, 0, 1)})
        with warnings.catch_warnings(record=True) as said, self.assertRaisesRegex(ValueError, "namespaces"):
            warnings.simplefilter("always")
            robust.init_node("a/b")
        with self.assertRaises(TypeError):  # as rospy's
            robust.init_node(5)
        self.assertEqual([], said)  # of files that stay open
        with arguments("--help"), contextlib.redirect_stdout(io.StringIO()), self.assertRaises(SystemExit):
            robust.init_node("node", usage="how to")
        self.assertEqual((before, added.mock_calls, 0), (process(), removed.mock_calls, len(shutdown.unfinished)))
        eventually(lambda: not any(isinstance(one, shutdown.Closer) for one in threading.enumerate()), "its end")

    def test_signals_that_nobody_gets_round_to_are_no_error(self):
        with closer() as one, mock.patch.object(sys, "unraisablehook") as complaint:
            for _ in range(2000):
                one.close()
            signal.raise_signal(signal.SIGTERM)
        complaint.assert_not_called()

    def test_node_is_not_killed_any_more_when_its_end_has_come_in_time(self):
        with mock.patch.object(os, "_exit") as killed, closer() as one:
            one._deadline = time.monotonic() + 2
            one.start()
            eventually(one._ears.gettimeout, "a time-out", pause=0.001)
            one._deadline = None
            eventually(lambda: not one._ears.gettimeout(), "no time-out any more")
        killed.assert_not_called()

    def test_signal_whose_handler_was_none_of_pythons_gets_the_systems_and_one_that_was_not_heeded_keeps_its_own(self):
        with closer() as one:
            one._before[signal.SIGTERM] = None
        shutdown.Closer().give_up()
        with socket.socket() as program_s:
            program_s.setblocking(False)
            signal.set_wakeup_fd(program_s.fileno())
            one._give_back()  # as in a child of a program whose start has failed
            self.assertEqual(program_s.fileno(), signal.set_wakeup_fd(-1))
        self.assertEqual(signal.SIG_DFL, signal.getsignal(signal.SIGTERM))

    def test_goals_end_also_where_no_thread_can_be_had_and_those_of_forgotten_servers_are_forgotten(self):
        class Server:
            def end(self, deadline):
                ended.append(self)

        ended, server = [], Server()
        with mock.patch.object(shutdown, "_endings", []), \
                mock.patch.object(threading.Thread, "start", side_effect=RuntimeError):
            for _ in range(3):
                shutdown.at_end(Server().end)
            shutdown.at_end(server.end)
            self.assertEqual(1, len(shutdown._endings))
            shutdown._endings.append(weakref.WeakMethod(Server().end))  # forgotten since
            shutdown._end_all_goals()
        self.assertEqual([server], ended)

    def test_exception_of_a_start_in_another_thread_ends_it_with_a_traceback(self):
        with ThreadPoolExecutor(1) as thread:
            self.assertNotIsInstance(thread.submit(internals.cannot_start, "").result(), SystemExit)

    def test_master_that_nobody_reaches_is_an_error_that_rospy_expects(self):
        with self.assertRaises(xmlrpc.client.ProtocolError):
            internals.impatient_proxy("http://localhost:1").getPid("/node")

    def test_whoever_answers_in_another_protocol_gives_no_answer(self):
        def answer(said):
            peer, _ = other.accept()
            with peer:
                asked = b""
                while b"</methodCall>" not in asked:
                    asked += peer.recv(1000)
                peer.sendall(said)

        with socket.create_server(("localhost", 0)) as other, ThreadPoolExecutor(1) as thread:
            for said in b"?\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 17\r\n\r\n<html><br></html>":
                thread.submit(answer, said)
                with self.assertRaises(internals.NO_ANSWER):
                    internals.ask("http://localhost:%d" % other.getsockname()[1], "getPid", timeout=30)

    def logged(self):
        """Returns a list to which each line of rospy's log is added."""
        said, handler = [], logging.Handler()
        handler.emit = functools.partial(log._write_at_once, mock.Mock(_stdout=io.StringIO()),
                                         lambda line: said.append(line.getMessage()))
        logger, level = logging.getLogger("rosout"), logging.getLogger("rosout").level
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        self.addCleanup(lambda: (logger.removeHandler(handler), logger.setLevel(level)))
        return said

    def test_lines_on_goals_stand_before_later_ones_and_each_line_says_what_was_so_when_it_was_logged(self):
        said, words, caller = self.logged(), ["then"], mock.Mock()
        log._soon.extend(functools.partial(str, number) for number in range(1000))
        rospy.loginfo("later,\nin two lines")
        log._write_later(caller, lambda line: said.append(line.getMessage()), record("%s", words))
        words[:] = ["now"]
        caller.call.call_args[0][0]()
        self.assertEqual([*map(str, range(1000)), "later,\nin two lines", "['then']"], said)

    def test_line_on_a_goal_is_shown_at_once_as_the_library_would_and_logged_later(self):
        said, (ours, theirs) = self.logged(), (io.StringIO(), io.StringIO())
        terminal = RosStreamHandler(stdout=ours)
        with mock.patch.object(log, "_taken", [terminal]):
            for line in "a bowl", "a cup":
                log.soon(functools.partial(str, line))
            for _ in range(2):
                log.show()
            self.assertEqual(([], ["a bowl", "a cup"]), (said, [line() for line in log._soon]))
            log.catch_up()
            log.soon(lambda: "x" * 5000)  # for which a pipe may have no room
            log.show()
            log.catch_up()
            eventually(lambda: said and not log._terminal, "the long line")
            for number, other in enumerate((
                    mock.patch.dict("os.environ", ROSCONSOLE_FORMAT="mine"), mock.patch.object(terminal, "level", 30),
                    mock.patch.object(rospy.rostime, "is_wallclock", return_value=False),
                    mock.patch.object(log, "_terminal", mock.Mock(call=lambda write: write())))):
                with other:
                    log.soon(lambda: "a plate")
                    log.show()
                self.assertEqual(number + 2, len(said), [one[:9] for one in said])
            logging.getLogger("rosout").setLevel(logging.WARNING)
            log.soon(lambda: "a spoon")
            log.show()
        for line in "a bowl", "a cup":
            RosStreamHandler(stdout=theirs).emit(record(line))
        self.assertEqual(*(re.sub(r"\d+", "0", stream.getvalue()) for stream in (ours, theirs)))
        self.assertEqual(["x" * 5000] + ["a plate"] * 4, said)

    def test_line_waits_for_the_stream_that_it_goes_to_and_where_none_can_be_asked_for_none(self):
        handler, write = mock.Mock(_stdout="takes a line", _stderr="is stopped"), mock.Mock()
        with mock.patch.object(log, "_takes_a_line", handler._stdout.__eq__), \
                mock.patch.object(log, "_write_later") as later:
            for level, calls in (logging.INFO, (1, 0)), (logging.WARNING, (1, 1)):
                line = record("a bowl")
                line.levelno = level
                log._write_at_once(handler, write, line)
                self.assertEqual(calls, (write.call_count, later.call_count))
        for error in AttributeError, OSError, ValueError:
            self.assertTrue(log._takes_a_line(mock.Mock(fileno=mock.Mock(side_effect=error))))

    def test_complaint_of_the_log_that_nobody_can_be_told_is_no_error(self):
        for stderr in None, mock.Mock(write=mock.Mock(side_effect=OSError)):
            with mock.patch.object(sys, "stderr", stderr):
                log._say_once(mock.Mock(), [], None)

    def test_log_s_own_stream_has_the_encoding_of_stdout_and_leaves_it_open(self):
        with mock.patch.object(sys, "__stdout__", io.TextIOWrapper(io.BytesIO(), "latin-1")):
            own = log._own(sys.__stdout__)
        self.assertEqual(("latin-1", "backslashreplace", True), (own.encoding, own.errors, own.line_buffering))
        own.close()
        os.fstat(1)

    def test_fork_waits_for_a_disk_that_hangs_for_a_moment_only_and_the_log_goes_on(self):
        begun, hangs, goes_on = threading.Event(), threading.Event(), threading.Event()
        log._others.call(lambda: begun.set() or hangs.wait(30))
        self.assertTrue(begun.wait(30))
        before = time.monotonic()
        log.pause()
        log.go_on()
        self.assertLess(time.monotonic() - before, 20)
        hangs.set()
        log._others.call(goes_on.set)
        self.assertTrue(goes_on.wait(30))

    def test_line_that_a_signal_handler_logs_in_whatever_step_of_another_waits_for_nothing(self):
        caller, said, steps = log._Caller(0), [], range(50)

        def log_and_be_interrupted():
            for step in steps:
                left = iter(range(step))

                def trace(*_):
                    if next(left, None) is None:
                        sys.settrace(None)
                        caller.call(lambda: said.append("the handler's"))
                    return trace

                sys.settrace(trace)
                caller.call(lambda: said.append("the program's"))
                sys.settrace(None)

        threading.Thread(target=log_and_be_interrupted, daemon=True).start()
        eventually(lambda: said.count("the program's") == len(steps), "a line for each step")

    def test_flush_waits_for_the_lines_so_far_and_the_end_of_a_node_flushes(self):
        said = self.logged()
        with closer() as one, mock.patch.object(shutdown, "CLOSED_WITHIN", 0):
            log._soon.append(lambda: "first")
            log._others.call(lambda: eventually(lambda: said, "the first") and said.append("second"))
            rospy.core.signal_shutdown = one._signal_shutdown  # as begin() does
            one._begun = time.monotonic()
            one._finish()
            self.assertIs(rospy.signal_shutdown, rospy.core.signal_shutdown, "who would end the node once more")
        self.assertEqual(["first", "second"], said)

    def test_line_on_a_goal_that_another_thread_has_just_taken_is_no_error(self):
        with mock.patch.object(log, "_soon", mock.MagicMock(popleft=mock.Mock(side_effect=IndexError))):
            log.catch_up()

    def test_stdout_of_python_stays_and_a_child_gets_it_back(self):
        for errors, ours in ("strict", "backslashreplace"), ("surrogateescape", "surrogateescape"):
            stream = io.TextIOWrapper(io.BytesIO(), "ascii", errors)
            stream.buffer.name = "<stdout>"
            with mock.patch.multiple(sys, stdout=stream, __stdout__=stream):
                stdout.take_over(print)
                self.assertIs(stream, sys.stdout)
                self.assertEqual((ours, ["write"]), (stream.errors, list(vars(stream))))
                for text, shown in ("two\nlines", b""), ("\n", b"two\nlines\n"):  # as print does
                    stream.write(text)
                    self.assertEqual(shown, stream.buffer.getvalue())
                stdout.give_back()
            self.assertEqual([], list(vars(stream)))

    def test_full_pipe_that_does_not_block_is_the_program_s_own_affair(self):
        close_node = mock.Mock()
        with self.assertRaises(BlockingIOError):
            stdout._write(mock.Mock(), mock.Mock(side_effect=BlockingIOError), close_node, "a bowl")
        close_node.assert_not_called()

    def test_stdout_that_is_none_of_pythons_stays(self):
        for other in None, io.StringIO(), io.TextIOWrapper(io.BytesIO()):
            with mock.patch.multiple(sys, stdout=other, __stdout__=other):
                stdout.take_over(print)
                self.assertIs(other, sys.stdout)

    def test_heartbeat_timeout_that_is_no_number_above_0_is_a_value_error(self):
        for wrong in 0, -1, float("nan"), True, "5":
            with self.assertRaisesRegex(ValueError, "^heartbeat_timeout is .*above 0$", msg=wrong):
                robust.SimpleActionClient("work", None, heartbeat_timeout=wrong)

    def test_clock_that_is_set_back_adds_no_patience_with_a_lost_server(self):
        goal = mock.Mock(silence=1.0)
        watched = mock.MagicMock(_SimpleActionClient__goal=mock.Mock(side_effect=[goal, None]),
                                 _SimpleActionClient__heartbeat_timeout=5)
        with mock.patch.object(rospy, "get_time", side_effect=[1000, 10, 11]):
            robust.SimpleActionClient._SimpleActionClient__watch(watched)
        goal.look.assert_called_once_with(0)

    def test_goal_that_is_sent_in_the_moment_in_which_the_older_is_lost_is_looked_after(self):
        older, newer = mock.Mock(silence=100.0, ignored=100.0), mock.Mock(silence=0.0)
        watched = mock.MagicMock(_SimpleActionClient__goal=mock.Mock(side_effect=[older, newer, newer, None]),
                                 _SimpleActionClient__heartbeat_timeout=5)
        with mock.patch.object(rospy, "get_time", return_value=1):
            robust.SimpleActionClient._SimpleActionClient__watch(watched)
        newer.look.assert_called_once_with(0)

    def test_goal_that_waited_for_a_busy_server_is_not_lost_when_that_speaks_of_others_at_last(self):
        goal, _ = self.goal_and_result(None)
        for passed_over, silence, ignored in (False, 5, 0), (True, 10, 5), (True, 15, 10):
            goal.passed_over, goal.mentioned = passed_over, False
            self.assertEqual(passed_over, goal.look(5))
            self.assertEqual((silence, ignored), (goal.silence, goal.ignored))
        goal.mentioned = True
        self.assertFalse(goal.look(5))
        self.assertEqual((0, 0), (goal.silence, goal.ignored))
        other, ignored = self.goal_and_result(None)[0], []
        for other.topic in "elsewhere", goal.topic:  # where the result waits behind the callback
            goal.passed_over, goal.mentioned = True, False
            other.call(lambda: ignored.append(goal.look(5) and goal.ignored))
        self.assertEqual([5, 5], ignored)
        busy, lives = mock.Mock(silence=9, ignored=1), mock.Mock(return_value=True)
        watched = mock.MagicMock(_SimpleActionClient__goal=mock.Mock(side_effect=[busy, busy, None]),
                                 _SimpleActionClient__heartbeat_timeout=5, _SimpleActionClient__server_lives=lives)
        busy.look.side_effect = [True, False]
        with mock.patch.object(rospy, "get_time", return_value=1):
            robust.SimpleActionClient._SimpleActionClient__watch(watched)
        self.assertEqual(([], 1), (busy.lose.mock_calls, lives.call_count))

    def test_feedback_of_the_goal_is_a_word_about_it_and_that_of_another_is_none(self):
        goal, _ = self.goal_and_result(None)
        goal.feedback_cb, feedback = mock.Mock(), TestActionFeedback()
        for goal_id, silence in ("other", 5), ("id", 0):
            goal.mentioned, feedback.status.goal_id.id = False, goal_id
            goal.update_feedback(feedback)
            goal.look(5)
            self.assertEqual(silence, goal.silence, goal_id)

    def test_server_is_not_silent_while_a_callback_of_the_program_holds_its_statuses_up(self):
        goal, _ = self.goal_and_result(None)
        goal.mentioned = False
        with ThreadPoolExecutor(1) as thread:
            with goal.mutex:  # as active_cb is called
                self.assertFalse(thread.submit(goal.look, 5).result())
            self.assertEqual(0, goal.silence)
            thread.submit(goal.look, 5).result()
        self.assertEqual(5, goal.silence)

    def test_second_try_after_a_time_out_asks_the_server_of_the_first_and_nobody_if_there_was_none(self):
        for name in "/server", "":
            watched = mock.MagicMock(_SimpleActionClient__server=name)
            watched.action_client.last_status_msg = None
            with mock.patch.object(client, "ask_node", return_value=1) as asked:
                lives = robust.SimpleActionClient._SimpleActionClient__server_lives(watched)
            self.assertEqual((bool(name), bool(name)), (lives, asked.called))

    def test_feedback_that_nobody_wants_is_no_error(self):
        robust.SimpleActionClient._handle_feedback(mock.MagicMock(feedback_cb=None), mock.Mock(), None)

    def test_state_that_is_none_has_its_number_for_a_name(self):
        self.assertEqual(["LOST", "42"], list(map(internals.name_of, (GoalStatus.LOST, 42))))

    def test_parameter_that_is_not_the_nodes_own_is_asked_for_before_its_start_too(self):
        with mock.patch.object(parameters, "_rospy_get_param", return_value=3) as asked:
            self.assertEqual((3, 1), (robust.get_param("/plates", 1), robust.get_param("~plates", 1)))
        asked.assert_called_once_with("/plates", 1)

    def test_client_whose_topics_are_closed_while_it_starts_says_that_it_was_interrupted(self):
        closed = rospy.ROSException("subscriber has been closed")
        with mock.patch.object(actionlib.SimpleActionClient, "__init__", side_effect=closed):
            for shutting_down, words in (False, "subscriber has been closed"), (True, "interrupted"):
                with mock.patch.object(rospy.core, "_in_shutdown", shutting_down), self.assertRaisesRegex(
                        rospy.ROSInitException, "^the client of /work cannot start: %s$" % words):
                    robust.SimpleActionClient("work", None)

    def test_server_is_told_of_its_client_once_more_after_3_s_also_where_no_master_answers(self):
        asked, topic = mock.Mock(_SimpleActionClient__registered=0), mock.Mock(resolved_name="/topic", type="type")
        with mock.patch.dict("os.environ", ROS_MASTER_URI="http://localhost:1"), \
                mock.patch.object(rospy, "get_node_uri", return_value="uri"), \
                mock.patch.object(client, "ask", wraps=client.ask) as ask:
            for _ in range(2):
                robust.SimpleActionClient._SimpleActionClient__register_again(asked, [topic, topic])
        self.assertEqual(2, ask.call_count)

    def test_server_is_there_when_it_sends_its_results_and_feedback_here_not_elsewhere(self):
        asked = mock.MagicMock()
        asked.action_client.result_sub.resolved_name = "/result"
        asked.action_client.feedback_sub.resolved_name = "/feedback"
        for peer in "elsewhere", rospy.get_name():
            connections = [(1, rospy.get_name(), "o", "TCPROS", "/result"), (2, peer, "o", "TCPROS", "/feedback")]
            with mock.patch.object(client, "ask_node", return_value=connections):
                self.assertEqual(peer != "elsewhere", robust.SimpleActionClient._SimpleActionClient__ask_server(asked))
        for registered, connects in (time.monotonic(), False), (0, True):  # when nothing is heard of its connections
            asked._SimpleActionClient__registered = registered
            with mock.patch.object(client, "ask_node", return_value=[]):
                self.assertEqual(connects, robust.SimpleActionClient._SimpleActionClient__ask_server(asked))
        asked.action_client.last_status_msg = None  # since the watcher gave the server up
        self.assertFalse(robust.SimpleActionClient._SimpleActionClient__ask_server(asked))
        with mock.patch.object(rospy, "get_rostime"):
            robust.SimpleActionClient.wait_for_server(asked, -1)
        asked._SimpleActionClient__is_connected.assert_not_called()  # a question costs a thread

    def test_server_lives_if_its_node_answers_where_our_connection_goes_without_the_master_or_where_that_says(self):
        asked, header = mock.MagicMock(), {"callerid": "/server"}
        asked.action_client.last_status_msg._connection_header = header
        others, ours = mock.Mock(callerid_pub="/other"), mock.Mock(callerid_pub="/server", endpoint_id="uri")
        lives = robust.SimpleActionClient._SimpleActionClient__server_lives
        with mock.patch.object(client, "ask", return_value=1) as ask, \
                mock.patch.object(client, "ask_node", side_effect=[1, OSError, OSError]) as ask_node:
            for connections, answer in ([others, ours], True), ([others], True), ([], False), (None, False):
                asked.action_client.status_sub.impl.connections = connections
                self.assertEqual(answer, lives(asked), connections)
        ask.assert_called_once_with("uri", "getPid")
        self.assertEqual(3, ask_node.call_count)

    def test_wait_for_a_server_before_init_node_does_not_begin(self):
        with self.assertRaisesRegex(rospy.ROSInitException, "init_node"):
            robust.SimpleActionClient.wait_for_server(mock.MagicMock(), 0.1)

    def goal_and_result(self, told, send_cancel=None):
        """Returns a goal that calls these functions with its handle and with a cancel, and its result, SUCCEEDED."""
        sent, result = TestActionGoal(), TestActionResult()
        sent.goal_id.id = result.status.goal_id.id = "id"
        result.status.status = GoalStatus.SUCCEEDED
        goal = client._Goal(sent, told, None, None, send_cancel)
        goal.begin("/result")
        return goal, result

    def test_goal_that_is_lost_while_its_result_comes_has_one_ending(self):
        def send_cancel(_):  # which lose() does
            threads.append(thread.submit(goal.update_result, result))
            threading.Event().wait(0.1)

        threads, ends = [], []
        goal, result = self.goal_and_result(lambda gh: ends.append(gh.get_goal_status()), send_cancel)
        with ThreadPoolExecutor(1) as thread:
            goal.lose("why")
            threads[0].result()
        self.assertEqual(([GoalStatus.LOST], GoalStatus.LOST), (ends[-1:], goal.latest_goal_status.status))

    def test_goal_whose_result_is_here_is_not_lost_while_a_callback_takes_its_time(self):
        def told(_):
            threads.append(thread.submit(goal.lose, "why"))
            threading.Event().wait(0.1)

        threads = []
        goal, result = self.goal_and_result(told)
        with ThreadPoolExecutor(1) as thread:
            goal.update_result(result)
            threads[0].result()
        self.assertEqual((GoalStatus.SUCCEEDED, ""), (goal.latest_goal_status.status, goal.why))

    def test_answer_of_more_than_a_second_ago_is_asked_for_again(self):
        now, go_on, before = [0], threading.Event(), threading.active_count()
        is_there = node.asking(lambda: go_on.wait(30))
        with mock.patch.object(node, "time", mock.Mock(monotonic=lambda: now[0])):
            self.assertFalse(is_there())
            go_on.set()
            eventually(lambda: threading.active_count() == before, "an answer")
            now[0] = 1.5
            self.assertFalse(is_there())
            eventually(is_there, "a new answer")

    def test_question_that_two_threads_ask_at_once_is_answered_for_both(self):
        class Late(threading.Thread):
            def start(self):
                if not others:
                    others.append(self)
                    thread.submit(eventually, is_there, "an answer").result()
                super().start()

        others, is_there = [], node.asking(lambda: True)
        with ThreadPoolExecutor(1) as thread, mock.patch.object(node, "threading", mock.Mock(Thread=Late)):
            eventually(is_there, "an answer")

    def test_question_that_raised_is_asked_again(self):
        answers = []
        is_there = node.asking(lambda: answers.pop())
        with self.assertRaises(IndexError):
            eventually(is_there, "an error")
        answers.append(True)
        eventually(is_there, "an answer")

    def peers_server(self, connection_handler=None):
        """Returns rospy's server for peers, a new one, mended; and a function that connects to it and sends bytes."""
        def connect(data=b"\0\0\0\0"):
            peer = socket.create_connection(("localhost", server.port))
            self.addCleanup(peer.close)
            peer.sendall(data)
            return peer

        new = mock.patch.object(tcpros_base, "_tcpros_server", None)
        new.start()
        self.addCleanup(new.stop)
        tcpros_base.start_tcpros_server()
        tcpros_base.init_tcpros_server().topic_connection_handler = connection_handler
        self.addCleanup(socket.setdefaulttimeout, socket.getdefaulttimeout())
        socket.setdefaulttimeout(60)  # as rospy does when it connects
        peers.serve_all_peers()
        server = tcpros_base.init_tcpros_server().tcp_ros_server
        self.addCleanup(server.shutdown)
        return server, connect

    def test_socket_that_accepts_peers_waits_for_them_whatever_the_default_time_out(self):
        self.assertTrue(os.get_blocking(self.peers_server()[0].server_sock.fileno()))

    def test_thread_that_stands_in_for_rospys_ends_with_the_socket_and_when_that_one_accepts(self):
        for end in (lambda one, _: one.shutdown()), (lambda _, connect: connect().close()):
            before = set(threading.enumerate())
            with mock.patch.object(threading, "excepthook") as complaint:
                end(*self.peers_server())
                eventually(lambda: len(set(threading.enumerate()) - before) == 1, "no thread but rospy's own")
            complaint.assert_not_called()

    def test_peers_are_accepted_in_their_order(self):
        server, connect = self.peers_server()
        came, handle = [], server.inbound_handler
        server.inbound_handler = lambda peer, address: came.append(address[1]) or handle(peer, address)
        for _ in range(100):
            ports = [peer.getsockname()[1] for peer in (connect(), connect(), connect())]
            eventually(lambda: len(came) == 3, "three peers", pause=0.001)
            self.assertEqual(ports, came)
            del came[:]

    def alone(self, run):
        """Have run(function) call function 20 times, in as many threads. No two of these may be in it at once."""
        inside, most = [], []

        def function(*_):
            inside.append(1)
            most.append(len(inside))
            threading.Event().wait(0.01)
            inside.pop()
            return threading.Lock()

        run(function)
        eventually(lambda: len(most) == 20, "20 calls")
        self.assertEqual([1] * 20, most)

    def test_peers_are_connected_one_after_the_other(self):
        def run(connection_handler):
            _, connect = self.peers_server(connection_handler)
            for _ in range(20):
                connect(encode_ros_handshake_header({"topic": "topic"}))

        self.alone(run)

    def test_locks_of_peers_are_looked_up_one_after_the_other(self):
        def run(setdefault):
            connect = peers._OneAtATime(lambda *_: None)
            connect._locks = mock.Mock(setdefault=setdefault)
            with ThreadPoolExecutor(20) as threads:
                threads.map(connect, range(20), range(20))

        self.alone(run)

    def test_node_that_ends_before_its_thread_for_peers_has_begun_ends_without_a_traceback(self):
        server = self.peers_server()[0]
        server.shutdown()
        server.run()

    def test_publishers_of_a_topic_are_those_of_all_lists_that_have_come(self):
        listener = registration.RegManager(mock.Mock())
        registration.get_registration_listeners().add_listener(listener)
        self.addCleanup(registration.get_registration_listeners().listeners.remove, listener)
        peers.serve_all_peers()
        listener.publisher_update("another", ["uri"])
        for uris in ["uri", "other"], ["uri"], []:
            listener.publisher_update("topic", uris)
        self.assertEqual([("another", ["uri"]), ("topic", ["uri", "other"])], listener.updates)

    def test_peer_that_waits_for_another_in_vain_leaves_the_lock_to_that(self):
        once = iter([lambda: connect("topic", "uri")])
        connect = peers._OneAtATime(lambda *_: next(once, lambda: None)())
        with mock.patch.object(peers, "ANSWERS_WITHIN", 0):
            connect("topic", "uri")

    def sleep(self, begin, *seconds):
        """Sleep for a second, on a simulated clock that is at begin, and then at each of seconds, until the sleep has
        ended with the last one. Returns when the next second begins."""
        self.addCleanup(rospy.rostime.switch_to_wallclock)
        self.addCleanup(rospy.rostime.set_rostime_initialized, False)
        rospy.rostime.set_rostime_initialized(True)
        rospy.rostime._set_rostime(rospy.Time(begin))
        asked, a_rate = [], rate.Rate(1, lambda: asked.append(1))
        with ThreadPoolExecutor(1) as thread:
            slept = thread.submit(a_rate.sleep)
            for number, second in enumerate(seconds):
                eventually(lambda: len(asked) > number, "a look at the clock")
                self.assertFalse(slept.done(), "ended at %s" % second)
                rospy.rostime._set_rostime(rospy.Time(second))
            self.assertTrue(slept.result(10))
        return a_rate.last_time.to_sec()

    def test_period_begins_with_a_simulated_clock_that_begins_during_a_sleep(self):
        self.assertEqual(101, self.sleep(0, 0, 100, 100.5, 101))

    def test_period_after_a_clock_was_set_back_during_a_sleep_begins_when_that_ends(self):
        self.assertEqual(11, self.sleep(100, 10, 10.5, 11))

    def test_loop_of_a_server_that_needs_to_terminate_does_not_wait(self):
        asked = mock.MagicMock(is_new_goal_available=lambda: False)
        type(asked).need_to_terminate = mock.PropertyMock(side_effect=[False, True, True])
        asked.execute_condition.wait_for = lambda has_to_go_on, _: self.assertTrue(has_to_go_on())
        robust.SimpleActionServer.executeLoop(asked)

    def test_cancel_of_goals_up_to_a_time_on_a_clock_that_was_set_back_counts_at_once(self):
        one = server._ActionServer.__new__(server._ActionServer)
        one.lock, one.started, one.status_list, one._unshown, one._later = threading.RLock(), True, [], [], False
        one.last_cancel = one._latest = rospy.Time(1000)
        with mock.patch.object(rospy.Time, "now", return_value=rospy.Time(10)):
            one.internal_cancel_callback(GoalID(stamp=rospy.Time(5)))
        self.assertEqual(rospy.Time(5), one.last_cancel)

    def test_goal_that_is_recalled_while_the_loop_takes_it_up_is_not_executed(self):
        asked = mock.Mock(is_active=lambda: False)
        robust.SimpleActionServer._SimpleActionServer__execute(asked, None)
        self.assertEqual([], asked.mock_calls)

    def test_first_server_in_the_node_is_named_unless_it_was_stopped_also_where_no_master_answers(self):
        for started in True, False:
            asked, first = mock.Mock(_SimpleActionServer__name="/action"), mock.Mock()
            first.action_server.started, server._servers["/action"] = started, first
            with mock.patch.dict("os.environ", ROS_MASTER_URI="http://localhost:1"), \
                    mock.patch.object(rospy, "logwarn") as warned:
                robust.SimpleActionServer._SimpleActionServer__look_for_twins(asked)
            self.assertEqual(started, warned.called)

    def test_rate_that_serves_several_goals_ends_one_sleep_for_each_that_is_taken_over(self):
        asked = mock.Mock(_SimpleActionServer__taken_over=0, is_preempt_requested=lambda: False)
        with mock.patch.object(rate, "Rate", lambda hz, stop_requested: stop_requested):
            stop_requested = robust.SimpleActionServer.rate(asked, 1)
        before = stop_requested()
        asked._SimpleActionServer__taken_over = 1
        self.assertEqual([False, True, False], [before, stop_requested(), stop_requested()])


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units", Units)
