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
import struct
import subprocess
import sys
import threading
import time
import unittest
import warnings
import weakref
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor, TimeoutError
from unittest import mock

import actionlib
import rosgraph.xmlrpc
import rospy
import rosunit
from actionlib.msg import TestAction, TestActionFeedback, TestActionGoal, TestActionResult, TestFeedback
from actionlib import CommState
from actionlib.simple_action_client import SimpleGoalState
from actionlib.status_tracker import StatusTracker
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from rosgraph.network import encode_ros_handshake_header
from rosgraph.roslogging import LoggingException, RosStreamHandler
from rospy.impl import registration, tcpros_base

from actions_tutorial import robust
from actions_tutorial.robust import client, internals, log, node, peers, rate, server, shutdown, stdout
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


def is_free(lock):
    """Returns whether another thread gets lock at once."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(lambda: lock.acquire(blocking=False) and lock.release() is None).result()


def record(*line):
    """A logging.LogRecord of arguments of rospy.loginfo."""
    return logging.LogRecord("rosout", logging.INFO, "file", 1, line[0], line[1:], None)


def take_up(one, goal_id="", stamp=0):
    """Has a goal with that id and stamp (s) come to one (SimpleActionServer), which accepts it."""
    one.action_server.internal_goal_callback(TestActionGoal(goal_id=GoalID(id=goal_id, stamp=rospy.Time(stamp))))
    one.accept_new_goal()


def written(name, function):
    """Returns the signature of function, called name, as doc/robust.md writes it."""
    signature = inspect.signature(function)
    parts = str(signature.replace(return_annotation=signature.empty, parameters=[
        each.replace(annotation=each.empty) for each in signature.parameters.values() if each.name != "self"]))
    return name + re.sub("<[^>]*object[^>]*>", "…", parts).replace("rospy.Duration[0]", "rospy.Duration()")


class Units(unittest.TestCase):

    def setUp(self):
        """No master, the real clock until a test sets another, and no hook that waits for the end of a node."""
        self.addCleanup(rospy.rostime.switch_to_wallclock)
        rospy.rostime.set_rostime_initialized(True)
        for state in (mock.patch.multiple(rospy.core, _client_ready=False, _in_shutdown=False, _shutdown_flag=False,
                                          _client_shutdown_hooks=[], _preshutdown_hooks=[], _shutdown_hooks=[]),
                      mock.patch.dict("os.environ", ROS_MASTER_URI="http://localhost:1"),
                      mock.patch.dict(rospy.core._xmlrpc_cache), mock.patch.object(rospy.client, "_param_server", None),
                      mock.patch.multiple(shutdown, _endings={}, hooks_thread=None, servers=weakref.WeakSet())):
            state.start()
            self.addCleanup(state.stop)

    def test_parameter_of_the_command_line_has_the_type_of_its_default_which_counts_where_none_is_given(self):
        for text, default, limits, value in (
                ("3", 7, {}, 3), ("3", 0.5, {}, 3.0), ("true", False, {}, True), ("a", "b", {}, "a"),
                ("[1]", [], {}, [1]), ("{a: 1}", {}, {}, {"a": 1}), ("3", 7, {"lowest": 3, "highest": 3}, 3),
                ("3", 7, {"lowest": 3}, 3), ("3", 7, {"highest": 3}, 3), ("3", None, {}, 3), ("[1]", (1, 2), {}, [1])):
            with arguments("_n:=" + text):
                self.assertIsNotNone(robust.get_param("~n"))
                got = robust.get_param("~n", default, **limits)
            self.assertEqual((type(value), value), (type(got), got), text)
            with arguments("_other:=3", "n:=4", "__n:=5", "an:=6"):
                self.assertEqual(default, robust.get_param("~n", default))

    def test_wrong_parameter_is_a_value_error_that_names_it_its_value_and_what_is_allowed(self):
        for text, default, limits, words in (
                ("[", 7, {}, r"is '\[', must be a whole number"), ("2024-13-45", 7, {}, "is '2024-13-45', must be a"),
                ("1.5", 7, {}, "is 1.5, must be a whole number"), ("true", 7, {}, "is True, must be a whole number"),
                ("true", 0.5, {}, "is True, must be a number"), ("9" * 400, 0.5, {}, "is 9*, must be a number"),
                ("1", "text", {}, "is 1, must be a string"),
                ("1", True, {}, "is 1, must be true or false"), ("1", [], {}, "is 1, must be a list"),
                ("[1]", {}, {}, r"is \[1\], must be a dictionary"),
                (".nan", 0.5, {"lowest": 0}, "is nan, must be "), (".inf", 0.5, {"lowest": 0}, "is inf, must be "),
                ("-.inf", 0.5, {"highest": 9}, "is -inf, must be "), ("soon", 0.5, {}, "is 'soon', must be a number"),
                ("-1", 7, {"lowest": 2147483647}, "is -1, must be a whole number from 2147483647$"),
                ("3", 0.5, {"highest": 1.5}, "is 3, must be a number to 1.5$"),
                ("10", 7, {"lowest": 0, "highest": 9}, "is 10, must be a whole number from 0 to 9$")):
            with arguments("_n:=" + text), self.assertRaisesRegex(ValueError, "^~n " + words):
                robust.get_param("~n", default, **limits)
        with arguments(), self.assertRaisesRegex(ValueError, "^~n is 10, must be a whole number to 9$"):
            robust.get_param("~n", 10, highest=9)  # a default that is wrong is from nowhere

    def test_wrong_argument_is_one_line_and_exit_status_2_and_help_is_0(self):
        for argument, status, words in (  # start_faults_test.py has more of them
                ("_n:=10", 2, "~n is 10, must be a whole number from 0 to 9"), ("-h", 0, "how to"),
                ("_m:=3", 2, "unknown parameter ~m, must be one of ~n\n"),
                ("__n:=3", 2, "unknown parameter ~_n, must be one of ~n"),
                *((wrong, 2, "unknown argument %r" % wrong) for wrong in ("--n=3", "--n:=3", "n-1:=3", "m:=")),
                ("/n:=3", 2, "'/n:=3' renames a topic, must be _n:=3"), (":=3", 2, "unknown argument ':=3'"),
                ("~n:=3", 2, "'~n:=3' renames a topic, must be _n:=3"),
                ("_name:=x", 2, "unknown parameter ~name, must be one of ~n; __name:=VALUE names the node")):
            said = io.StringIO()
            with arguments(argument), contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), \
                    mock.patch.object(node, "_wait_for_master", side_effect=AssertionError(argument)), \
                    self.assertRaises(SystemExit) as end:
                robust.init_node("node", usage="how to", parameters={"~n": (7, 0, 9)})
            self.assertEqual((status, 1), (end.exception.code, said.getvalue().count("\n")), said.getvalue())
            self.assertIn(words, said.getvalue())
        with arguments("--help"), contextlib.redirect_stderr(io.StringIO()), self.assertRaises(SystemExit) as end:
            robust.init_node("node", ["node", "3"], usage="how to")
        self.assertEqual(2, end.exception.code, "arguments that the program gives count, not those of sys.argv")

    def test_master_uri_that_is_none_is_named(self):
        for uri in "localhost:11311", "http://", "http://localhost", "http://localhost:port", "http://:1", \
                "http://local host:1", "https://localhost:1":
            with mock.patch.dict("os.environ", ROS_MASTER_URI=uri), arguments("-e=a:=1;b:=2"), self.assertRaisesRegex(
                    rospy.ROSInitException, "^ROS_MASTER_URI is '%s', must be like http://localhost:11311$" % uri):
                robust.init_node("node")

    def test_robust_has_what_actionlib_has(self):
        self.assertEqual([], [name for name, value in vars(actionlib).items() if not (
            name.startswith("_") or inspect.ismodule(value) or hasattr(robust, name))])

    def test_each_public_name_takes_what_its_model_does_and_more_by_keyword_only_as_the_reference_says(self):
        root = pathlib.Path(__file__).resolve().parent.parent
        page = (root / "doc" / "robust.md").read_text()
        for name, theirs in STANDS_FOR.items():
            ours = getattr(robust, name)
            pairs = {name: (theirs, ours)}
            if inspect.isclass(ours):
                pairs.update((method, (getattr(theirs, method, our), our)) for method, our in vars(ours).items()
                             if not method.startswith("_") and callable(our))
            for called, (their, our) in pairs.items():
                self.assertRegex(written(called, our), "^%s(, [*], .*)?[)]$" % re.escape(written(called, their)[:-1]))
                if not called.startswith(("internal_", "executeLoop")):  # which the library calls
                    self.assertIn("`%s`" % written(called, our), page)
                    self.assertTrue(inspect.getdoc(our), called)
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
        undocumented = {name for name in used if re.match("_[^_]|internal_|add_shutdown_hook", name)}
        self.assertEqual(set(), undocumented - ours - needed - private)
        self.assertEqual(set(), needed - used - ours)
        lacking = r"^rospy \d+\.\d+\.\d+ has no rospy.rostime.get_rostime_cond, which robust needs; it was "
        with mock.patch.object(rospy.rostime, "get_rostime_cond"), \
                self.assertRaisesRegex(rospy.ROSInitException, lacking):
            del rospy.rostime.get_rostime_cond
            server._ActionServer.initialize(mock.Mock())  # not in the midst of a goal

    def test_get_param_in_rospys_place_checks_only_where_there_is_a_limit(self):
        with mock.patch.object(rospy, "get_param", robust.get_param), arguments("_n:=115200"):
            self.assertEqual(115200, rospy.get_param("~n", "9600"))  # which the program makes an int of
            with self.assertRaisesRegex(ValueError, "must be a whole number to 9"):
                robust.get_param("~n", 7, highest=9)

    def test_import_touches_no_signal_where_ctrl_c_is_not_pythons_own_or_others_may_be_using_it(self):
        for before, how in (("signal.signal(signal.SIGINT, print)", "load()"), ("sys.ps1 = ''", "load()"),
                            ("import rospy", "load()"), ("", "threading.Thread(target=load).start()")):
            code = ("import signal, sys, threading\n%s\nfailures, signal.signal = [1], lambda *_: failures.append(2)\n"
                    "def load():\n    from actions_tutorial import robust\n"
                    "    failures.remove('actions_tutorial.msg' in sys.modules)\n%s\n"  # True, which is 1
                    "[one.join() for one in threading.enumerate() if one is not threading.main_thread()]\n"
                    "sys.exit(bool(failures))" % (before, how))
            self.assertEqual(0, subprocess.call(["/usr/bin/python3", "-c", code]), code)

    def test_copy_of_robust_beside_a_node_needs_no_package_around_it(self):
        folder = os.path.dirname(os.path.dirname(robust.__file__))
        self.assertEqual(0, subprocess.call(["/usr/bin/python3", "-c", "import robust"], cwd=folder))

    def test_start_that_fails_leaves_no_thread_signal_or_hook_behind(self):
        def process():
            return signal.set_wakeup_fd(-1), rospy.core.signal_shutdown, [
                signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]

        before = process()
        with mock.patch.object(atexit, "register") as added, mock.patch.object(atexit, "unregister") as removed, \
                arguments("_server_timeout:=0.01"):
            with self.assertRaisesRegex(rospy.ROSInitException, "no master"):
                robust.init_node("node", parameters={"~server_timeout": (0.0, 0, 1)})
            with mock.patch.object(node, "_wait_for_master", side_effect=KeyboardInterrupt), \
                    arguments("--help"), self.assertRaises(KeyboardInterrupt):  # without usage, --help is not ours
                robust.init_node("node", disable_signals=True)
        with warnings.catch_warnings(record=True) as said, mock.patch.object(node, "_wait_for_master") as waited:
            warnings.simplefilter("always")
            for name, words in ("a/b", "namespaces are not"), ("", "must not be empty"), (None, "must not be empty"):
                for library in rospy, robust:
                    with self.assertRaisesRegex(ValueError, words):
                        library.init_node(name)
            with self.assertRaises(TypeError):  # as rospy's
                robust.init_node(5)
        waited.assert_not_called()
        self.assertEqual([], said)  # of files that stay open
        with arguments("--help"), contextlib.redirect_stdout(io.StringIO()), self.assertRaises(SystemExit):
            robust.init_node("node", usage="how to")
        self.assertEqual((before, added.mock_calls), (process(), removed.mock_calls))
        eventually(lambda: not any(isinstance(one, shutdown.Closer) for one in threading.enumerate()), "its end")

    def test_signals_that_nobody_gets_round_to_are_no_error(self):
        with closer() as one, mock.patch.object(sys, "unraisablehook") as complaint:
            for _ in range(2000):
                one.close()
            signal.raise_signal(signal.SIGTERM)
            self.assertFalse(one._hooks.locked(), "hooks run before there is a node")
        complaint.assert_not_called()

    def test_signal_that_comes_while_the_main_thread_has_a_server_s_lock_lets_it_go_on_and_comes_again(self):
        a_server = self.serving().action_server
        with closer() as one, mock.patch.object(shutdown.Closer, "ident", 1), \
                mock.patch.object(one, "_run_hooks") as ran:
            with a_server.lock:
                signal.raise_signal(signal.SIGTERM)
            self.assertEqual((signal.SIGTERM, 0), (one._heard, ran.call_count))
            one._hooks_ran.set()
            one._is_down(None)
            self.assertEqual(1, ran.call_count)

    def test_node_is_not_killed_any_more_when_its_end_has_come_in_time(self):
        with mock.patch.object(os, "_exit") as killed, closer() as one:
            one._deadline = time.monotonic() + 2
            one.start()
            eventually(one._ears.gettimeout, "a time-out", pause=0.001)
            one._deadline = None
            eventually(lambda: not one._ears.gettimeout(), "no time-out any more")
        killed.assert_not_called()
        with mock.patch.object(os, "_exit", side_effect=SystemExit), closer() as one, self.assertRaises(SystemExit):
            one._deadline = time.monotonic() - 1  # it came while a signal was obeyed
            one.run()

    def test_signal_whose_handler_was_none_of_pythons_gets_the_systems_and_one_that_was_not_heeded_keeps_its_own(self):
        self.addCleanup(signal.signal, signal.SIGHUP, signal.signal(signal.SIGHUP, signal.SIG_IGN))  # as nohup does
        with closer() as one:
            self.assertEqual(signal.SIG_IGN, signal.getsignal(signal.SIGHUP))
            one._before[signal.SIGTERM], one._heard = None, signal.SIGTERM
            program_s = signal.signal(signal.SIGTERM, self.fail)
            one._is_down(None)  # the handler is another's by now
            signal.signal(signal.SIGTERM, program_s)
        shutdown.Closer().give_up()
        with socket.socket() as program_s:
            program_s.setblocking(False)
            signal.set_wakeup_fd(program_s.fileno())
            one._give_back()  # as in a child of a program whose start has failed
            self.assertEqual(program_s.fileno(), signal.set_wakeup_fd(program_s.fileno()))
            for waits, given_back in (False, program_s.fileno()), (True, -1):
                one = shutdown.Closer()
                one.heed_signals()
                program_s.setblocking(waits)
                one.give_up()
                self.assertEqual(given_back, signal.set_wakeup_fd(-1))
                program_s.setblocking(False)
                signal.set_wakeup_fd(program_s.fileno())
            one = shutdown.Closer()
            one.heed_signals()
        one.give_up()  # the program has closed it meanwhile
        self.assertEqual(-1, signal.set_wakeup_fd(-1))
        self.assertEqual(signal.SIG_DFL, signal.getsignal(signal.SIGTERM))

    def test_goals_end_also_where_no_thread_can_be_had_and_those_of_forgotten_servers_are_forgotten(self):
        class Server:
            __hash__ = None  # as of a dataclass

            def end(self, deadline):
                ended.append(self)

        def in_between(*args, method=weakref.WeakMethod):
            with mock.patch.object(weakref, "WeakMethod", method):
                shutdown.at_end(other.end)  # as another thread may
            return method(*args)

        ended, server, other, forgotten = [], Server(), Server(), Server()
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError):
            for _ in range(3):
                shutdown.at_end(Server().end)
            with mock.patch.object(weakref, "WeakMethod", in_between):
                shutdown.at_end(server.end)
            self.assertEqual(2, len(shutdown._endings))
            shutdown.at_end(forgotten.end)
            del forgotten  # since
            shutdown._end_all_goals()
            with mock.patch.object(time, "sleep") as sleep:
                rospy.core._client_shutdown_hooks[-1]()  # which waits for them
            sleep.assert_called_once_with(shutdown.SENT_WITHIN)
            caller, called = log._Caller(0), threading.Event()
            caller.call(print)  # nor does the log fail
        caller.call(called.set)
        self.assertTrue(called.wait(30), "no word of the log since a thread was missing")
        self.assertCountEqual([server, other], ended)
        self.assertTrue(shutdown.aside(print).daemon)  # one that never ends does not hold up the program's end

    def test_where_no_thread_can_be_had_a_line_is_written_lines_are_bounded_goals_end_and_a_peer_is_let_go(self):
        peer, write, asked, accepting = mock.Mock(), mock.Mock(), mock.MagicMock(), self.peers_server()[0]
        said = self.logged()
        asked.action_server.unended.return_value = []
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError), \
                mock.patch.object(log, "_terminal", log._Caller(0)) as caller, mock.patch.object(log, "_is_terminal"):
            robust.SimpleActionServer._SimpleActionServer__shut_down(asked, 0)
            log._write_at_once(io.StringIO(), 1, write)
            self.assertEqual((1, 0), (write.call_count, len(caller)))
            for _ in range(2 * log.WAITING):
                caller.call(print)
            accepting.inbound_handler(peer, None)
        self.assertEqual(log.WAITING, len(caller))
        peer.close.assert_called_once()
        asked.action_server.close.assert_called_once()
        self.assertNotIn("did not stop", str(said))
        asked._SimpleActionServer__ask_to_stop.assert_not_called()  # a callback could hold up whoever calls it

    def test_exception_of_a_start_in_another_thread_ends_it_with_a_traceback(self):
        with ThreadPoolExecutor(1) as thread:
            self.assertNotIsInstance(thread.submit(internals.cannot_start, "").result(), SystemExit)

    def test_master_that_nobody_reaches_is_an_error_that_rospy_expects_and_another_protocol_is_no_answer(self):
        with self.assertRaises(xmlrpc.client.ProtocolError):
            internals.impatient_proxy("http://localhost:1").getPid("/node")
        with self.assertRaises(internals.NO_ANSWER):
            internals.ask("", "getPid")

        def answer(said):
            peer, _ = other.accept()
            with peer:
                asked = b""
                while b"</methodCall>" not in asked:
                    asked += peer.recv(1000)
                peer.sendall(said)

        with socket.create_server(("localhost", 0)) as other, ThreadPoolExecutor(1) as thread:
            words = xmlrpc.client.dumps(("",), methodresponse=True)
            for said in b"?\r\n", b"HTTP/1.1 200 OK\r\nContent-Length: 17\r\n\r\n<html><br></html>", (
                    "HTTP/1.1 200 OK\r\nContent-Length: %d\r\n\r\n%s" % (len(words), words)).encode():
                thread.submit(answer, said)
                with self.assertRaises(internals.NO_ANSWER):
                    internals.ask("http://localhost:%d" % other.getsockname()[1], "getPid", timeout=30)

    def test_two_threads_ask_the_master_at_once_and_a_server_whose_socket_was_closed_does_not_ask_it_on_and_on(self):
        def answer():
            asked.wait(10)
            return 1, "", "yes"

        peers.end_quietly()
        asked = threading.Barrier(2)
        with ThreadPoolExecutor(3) as threads, rosgraph.xmlrpc.ThreadingXMLRPCServer(("localhost", 0), 0) as other:
            other.register_function(answer)
            served = threads.submit(other.serve_forever)
            proxy = internals.impatient_proxy("http://localhost:%d" % other.server_address[1], 10)
            answers = [threads.submit(proxy.answer) for _ in range(2)]
            self.assertEqual(["yes", "yes"], [one.result()[2] for one in answers])
            other.server_close()
            try:
                self.assertEqual("closed", str(served.exception(10)))
            finally:
                other.shutdown()

    def logged(self, note=logging.LogRecord.getMessage):
        """Returns a list to which note(line) is added for each line (logging.LogRecord) of rospy's log."""
        said, handler = [], logging.Handler()
        terminal = RosStreamHandler(stdout=io.StringIO(), stderr=io.StringIO())
        handler.emit = functools.partial(log._write_to_terminal, terminal, lambda line: said.append(note(line)))
        logger, level = logging.getLogger("rosout"), logging.getLogger("rosout").level
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        self.addCleanup(lambda: (logger.removeHandler(handler), logger.setLevel(level)))
        return said

    def test_lines_on_goals_stand_before_later_ones_and_each_line_says_what_was_so_when_it_was_logged(self):
        said, words = self.logged(), ["then"]
        line = record("%s", words)
        log._soon.extend(functools.partial(str, number) for number in range(1000))
        rospy.loginfo("later,\nin two lines")
        with mock.patch.object(log, "_others") as caller:
            log._write_later(lambda line: said.append(line.getMessage()), line)
        self.assertEqual(("%s", (words,)), (line.msg, line.args), "which the program's own handlers have, too")
        words[:] = ["now"]
        caller.call.call_args[0][0]()
        self.assertEqual([*map(str, range(1000)), "later,\nin two lines", "['then']"], said)

    def test_line_on_a_goal_is_shown_at_once_as_the_library_would_and_logged_later(self):
        said, (ours, theirs) = self.logged(), (io.StringIO(), io.StringIO())
        terminal = RosStreamHandler(stdout=ours)
        with mock.patch.object(log, "_taken", []):
            log.hold_nobody_up([terminal])
            for line in "a bowl", "a cup":
                log.soon(functools.partial(str, line))
            for _ in range(2):
                log.show()
            self.assertEqual(([], ["a bowl", "a cup"]), (said, [line() for line in log._soon]))
            log.catch_up()
            for number, other in enumerate((
                    mock.patch.dict("os.environ", ROSCONSOLE_FORMAT="mine"), mock.patch.object(terminal, "level", 30),
                    mock.patch.object(log, "_taken", [logging.NullHandler()]),
                    mock.patch.object(rospy.rostime, "_rostime_current", rospy.Time(1)))):
                with other:
                    log.soon(lambda: "a plate")
                    log.show()
                self.assertEqual(["a plate"] * (number + 1), said)
            logging.getLogger("rosout").setLevel(logging.WARNING)
            log.soon(lambda: "a spoon")
            log.show()
        for line in "a bowl", "a cup":
            RosStreamHandler(stdout=theirs).emit(record(line))
        self.assertEqual(*(re.sub(r"\d+", "0", stream.getvalue()) for stream in (ours, theirs)))
        self.assertEqual(["a plate"] * 4, said)

    def test_line_waits_for_the_stream_that_it_goes_to_and_where_none_can_be_asked_for_none(self):
        stopped, write = mock.Mock(), mock.Mock()
        handler = RosStreamHandler(stdout=io.StringIO(), stderr=stopped)
        with mock.patch.object(log, "_takes_a_line", lambda stream: stream is not stopped), \
                mock.patch.object(log, "_terminal", mock.MagicMock(__bool__=lambda caller: False)) as later:
            for level, calls in (logging.INFO, (1, 0)), (logging.WARNING, (1, 1)):
                line = record("a bowl")
                line.levelno, line.args = level, None  # as logging.handlers.QueueHandler makes it
                log._write_to_terminal(handler, write, line)
                self.assertEqual(calls, (write.call_count, later.call.call_count))
            log._write_at_once(handler._stdout, log.AT_ONCE, write)  # which a pipe may not take
            self.assertEqual((1, 2), (write.call_count, later.call.call_count))
        for error in AttributeError, OSError, ValueError:
            other = mock.Mock(fileno=mock.Mock(side_effect=error))
            self.assertTrue(log._takes_a_line(other))
            log._write_at_once(mock.Mock(spec=["write"], fileno=other.fileno), 1, write)  # without isatty
        self.assertEqual(4, write.call_count)
        read, full = os.pipe2(os.O_NONBLOCK)
        with open(read, "rb"), open(full, "wb", 0) as pipe:
            self.assertTrue(log._takes_a_line(pipe))
            pipe.write(bytes(1 << 20))
            self.assertFalse(log._takes_a_line(pipe))

    def test_line_stands_on_a_terminal_that_takes_it_when_the_call_returns(self):
        said = []
        with mock.patch.multiple(log, _terminal=log._Caller(0), _is_terminal=mock.Mock(), READ_WITHIN=30):
            log._write_at_once(io.StringIO(), 1, lambda: said.append(time.sleep(0.05)))
        self.assertEqual([None], said)

    def test_complaint_of_the_log_names_what_it_cannot_log_to_and_where_nobody_can_be_told_is_no_error(self):
        for stderr in None, *(mock.Mock(**{"write.side_effect": error}) for error in (OSError, ValueError)):
            with mock.patch.object(sys, "stderr", stderr):
                log._say_once(mock.Mock(), [], None)
        with contextlib.redirect_stderr(io.StringIO()) as said:
            for handler in mock.Mock(spec=[]), RosStreamHandler(), mock.Mock(baseFilename="/file"):
                log._say_once(handler, [], None)
        self.assertEqual(["/rosout", "the terminal", "/file"], re.findall("cannot log to (.+?): ", said.getvalue()))

    def test_log_complains_of_nothing_until_its_handlers_say_so_once_and_leaves_the_program_s_own_alone(self):
        class Own(logging.Handler):
            pass

        def init_node(*_, **__):
            said.append(logging.raiseExceptions)
            handlers.extend([Own(), rospy_s])  # the program's by ROS_PYTHON_LOG_CONFIG_FILE

        said, rospy_s = [], RosStreamHandler()
        with mock.patch.object(logging.getLogger("rosout"), "handlers", [logging.NullHandler()]) as handlers, \
                mock.patch.object(log, "hold_nobody_up", lambda ours: said.extend([logging.raiseExceptions, *ours])), \
                mock.patch.object(node, "_rospy_init_node", init_node):
            rospy.client._init_node_args = "those of a start that fails"
            node._start((), {})
        self.assertEqual([False, False, rospy_s, True, None],
                         [*said, logging.raiseExceptions, rospy.client._init_node_args])
        full = mock.Mock(**{"write.side_effect": OSError("it is full"), "fileno.side_effect": OSError})
        handler, terminal = logging.FileHandler("/dev/null"), RosStreamHandler(stdout=full, stderr=full)
        sources = logging.getLogger("a library")
        with contextlib.redirect_stderr(io.StringIO()) as complaints, mock.patch.object(log, "_taken", []):
            log.hold_nobody_up([handler, terminal])
            sources.addHandler(handler)
            handler.stream = io.StringIO()
            for number in range(2):
                sources.warning("two words", number)  # as a wrong line of a library that its author never saw
            eventually(lambda: handler.stream.getvalue().count("\n") == 2, "both lines")
            self.assertRegex(handler.stream.getvalue(), "(?m)^two words, with .0,.: not all arguments")
            handler.setStream(full)
            sources.addHandler(terminal)
            for _ in range(2):
                sources.warning("a bowl")
            log.flush(30)
            for one in handler, terminal:
                sources.removeHandler(one)
        self.assertCountEqual(["cannot log to %s: it is full" % place for place in ("/dev/null", "the terminal")],
                              complaints.getvalue().splitlines())

    def test_log_that_cannot_be_set_up_is_said_and_goes_to_the_terminal(self):
        self.logged()  # which restores the level
        for error in OSError, ValueError, LoggingException:
            with mock.patch.object(logging.getLogger("rosout"), "handlers", []) as handlers, \
                    mock.patch.object(rospy.core, "_log_filename", None), \
                    contextlib.redirect_stderr(io.StringIO()) as said:
                log.configure(mock.Mock(side_effect=error("no folder")))
            self.assertEqual(("cannot set up the log: no folder\n", 1), (said.getvalue(), len(handlers)))

    def test_log_asks_the_master_once_and_puts_nothing_into_the_cache_of_parameters(self):
        key, cache = "/rosout_disable_topics_generation", rospy.impl.paramserver.ParamServerCache()
        cache.set("/plates", 3)
        with mock.patch.object(rospy.impl.paramserver, "_param_server_cache", cache), \
                mock.patch.object(rospy, "get_param", return_value=False) as asked:
            log.ask_the_master_once()
        self.assertEqual([False, False, 3], [cache.get(name) for name in (key, key, "/plates")])
        asked.assert_called_once()
        self.assertRaises(KeyError, type(cache).get, cache, key)

    def test_log_s_own_stream_has_the_encoding_of_pythons_and_leaves_that_open_and_a_redirected_one_stays(self):
        redirected = io.StringIO()
        self.assertIs(redirected, log._own(redirected))
        pythons = [io.TextIOWrapper(io.BytesIO(), "latin-1") for _ in range(2)]
        terminal = RosStreamHandler(stdout=pythons[0], stderr=pythons[1])
        with mock.patch.multiple(sys, __stdout__=pythons[0], __stderr__=pythons[1]), \
                mock.patch.object(log, "_taken", []):
            log.hold_nobody_up([terminal])
            ours = terminal._stdout, terminal._stderr
            log.give_back()
        self.assertEqual(pythons, [terminal._stdout, terminal._stderr])
        for number, own in enumerate(ours, 1):
            self.assertEqual(("latin-1", "backslashreplace", True, number),
                             (own.encoding, own.errors, own.write_through, own.fileno()))
            own.close()
            os.fstat(number)

    def test_line_that_may_not_fit_into_a_pipe_goes_by_the_thread(self):
        handler, sizes = RosStreamHandler(), []
        with mock.patch.object(log, "_write_at_once", lambda stream, size, write: sizes.append(size < log.AT_ONCE)):
            for name, value in ("msg", "a bowl"), ("msg", "\u4e8c" * 1000), ("stack_info", "here\n" * 400), \
                    ("exc_info", (OSError, OSError("x" * 1600), None)):
                line = record("a bowl")
                setattr(line, name, value)
                log._write_to_terminal(handler, print, line)
        self.assertEqual([True, False, False, False], sizes)

    def test_thread_of_the_log_sleeps_until_there_is_news(self):
        with mock.patch.object(log, "time") as clock:
            log._Caller(0).call(print)
            time.sleep(0.1)
        self.assertLess(clock.sleep.call_count, 5)

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
        log.pause()
        log.give_back()
        with ThreadPoolExecutor(1) as thread:  # another one of the child may fork
            self.assertEqual((True, None), tuple(thread.map(lambda step: step(), (
                functools.partial(log._others.at_work.acquire, timeout=5), log._others.at_work.release))))

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
        with closer() as one, mock.patch.multiple(shutdown, CLOSED_WITHIN=0, LOG_WITHIN=30):
            log._soon.append(lambda: "first")
            log._others.call(lambda: eventually(lambda: said, "the first") and said.append("second") or
                             log._terminal.call(lambda: threading.Event().wait(0.2) or said.append("third")))
            rospy.core.signal_shutdown = one._signal_shutdown  # as begin() does
            one._heard = signal.SIGTERM
            one._finish()
            self.assertIsNone(one._heard, "a signal for a main thread that waits no more")
            self.assertIs(rospy.signal_shutdown, rospy.core.signal_shutdown, "who would end the node once more")
        self.assertEqual(["first", "second", "third"], said)

    def test_end_of_a_node_wakes_each_rate_and_comes_after_the_hooks_of_the_program(self):
        seen = []
        with closer() as one, mock.patch.object(rate, "wake") as wake, mock.patch.object(log, "flush") as flush:
            for _ in range(2):
                shutdown.at_end(self.assertTrue)
            rospy.core.add_shutdown_hook(lambda _: seen.append((flush.call_count, one._closed.is_set())))
            rospy.on_shutdown(one._begin)
            rospy.signal_shutdown("why")
        self.assertEqual([(1, False)], seen, "its last words are for /rosout, too")
        self.assertEqual((1, True), (wake.call_count, one._closed.is_set()))

    def test_request_to_end_for_the_node_that_had_the_port_before_is_refused(self):
        said = self.logged()
        with closer() as one, mock.patch.object(one, "close") as close:
            for name, refused in ("/other", ValueError), (rospy.get_name(), ()):
                with contextlib.suppress(refused):
                    one._hear_request("shutdown request: [%s] Reason: new node registered with same name" % name)
                self.assertEqual(not refused, close.called)
            one._hear_request("shutdown request: user request")
        self.assertEqual(["another node took the name %s, so this one ends" % rospy.get_name(),
                          "shutdown request: user request"], said)

    def test_node_whose_hooks_hang_is_killed_also_where_no_thread_can_be_had(self):
        """As Python 3.12 starts none when it ends."""
        with closer() as one, mock.patch.object(os, "_exit", side_effect=SystemExit), \
                mock.patch.object(threading.Thread, "start", side_effect=RuntimeError), \
                mock.patch.object(shutdown, "KILLED_AFTER", 0.2):
            one._hooks.acquire()
            one.close()
            with self.assertRaises(SystemExit):
                one.run()
        self.assertFalse(rospy.core.is_shutdown_requested())

    def test_node_that_leaves_the_signals_to_python_ends_when_told(self):
        one = shutdown.Closer()
        one.close()
        with mock.patch.object(shutdown, "aside", side_effect=lambda _: one._mouth.close()) as aside, one._ears:
            one.run()
        aside.assert_called_once()
        other = shutdown.Closer()
        with other._ears, other._mouth as mouth:
            mouth.send(b"\0")  # whoever writes there, that is no signal's number
            mouth.shutdown(socket.SHUT_WR)
            other.run()

    def test_hooks_of_the_program_run_once_whatever_they_raise_and_what_comes_later_is_not_theirs(self):
        def hook():
            ran.append(shutdown.hooks_thread == threading.get_ident())
            if len(ran) == 1:
                rospy.on_shutdown(hook)
            rospy.signal_shutdown("by a hook, or a thread that it tells to end")
            sys.exit()

        ran = []
        with closer() as one, contextlib.redirect_stderr(io.StringIO()) as said:
            rospy.core._client_shutdown_hooks[:] = one._begin, hook
            with ThreadPoolExecutor(1) as thread:  # which is just calling rospy.signal_shutdown
                thread.submit(rospy.core._shutdown_lock.acquire).result()
                one._run_hooks()
                thread.submit(rospy.core._shutdown_lock.release).result()
            self.assertEqual([], ran)
            for _ in range(2):
                one._run_hooks()
            self.assertTrue(one._hooks.locked(), "else each signal would have them begin")
            self.assertNotEqual(threading.get_ident(), shutdown.hooks_thread)
        self.assertEqual(([True, True], 2), (ran, said.getvalue().count("SystemExit")))

    def test_handler_of_the_program_is_called_when_the_node_is_down_but_waits_for_no_hooks_that_it_interrupts(self):
        def hook():
            ran_in.append(threading.current_thread())
            rospy.core.add_shutdown_hook(lambda _: hung.wait(30))  # rospy stays a while when the node is down
            os.kill(os.getpid(), signal.SIGTERM)

        def robust_connect_subscriber():  # as in rospy/impl/tcpros_pubsub.py
            eventually(one._closed.is_set, "an end")
            heard.append(time.sleep(0.2))

        ran_in, handled, heard, hung, begun = [], [], [], threading.Event(), time.monotonic()
        handler = signal.signal(signal.SIGTERM, lambda *_: handled.append(one._closed.is_set()))
        self.addCleanup(signal.signal, signal.SIGTERM, handler)
        with mock.patch.object(shutdown.Closer, "ident", 1), mock.patch.object(shutdown, "CLOSED_WITHIN", 15):
            rospy.on_shutdown(hook)
            with closer() as one:  # the program has ended
                shutdown.aside(robust_connect_subscriber)
                one._finish()
                hung.set()
                self.assertTrue(heard, "a callback at work may take its time")
            with closer() as one, mock.patch.object(shutdown, "aside", wraps=shutdown.aside) as aside:
                # Another thread has called rospy.signal_shutdown.
                rospy.core._shutdown_flag, rospy.core._client_shutdown_hooks[:] = False, [hook]
                one._begin()
                for its_hook in rospy.core._client_shutdown_hooks[1:]:
                    its_hook()
                shutdown.hooks_thread = 1
                threading.Timer(shutdown.HELD_FOR + 0.1, one._closed.set).start()
                signal.raise_signal(signal.SIGTERM)
                one._finish()
                aside.assert_not_called()
                one._closed.clear()
                one._deadline = time.monotonic() - shutdown.CLOSED_WITHIN  # it was told to end that long ago
                one._finish()
        self.assertLess(time.monotonic() - begun, 15, "s")
        self.assertEqual([False, True], handled)
        self.assertEqual([threading.main_thread()], ran_in, "once")

    def test_timer_may_be_at_work_when_the_program_ends(self):
        for thread in mock.Mock(spec=rospy.Timer), threading.Thread(target=print):
            with mock.patch.object(threading, "enumerate", return_value=[thread]):
                self.assertEqual(isinstance(thread, rospy.Timer), shutdown._callbacks_run())

    def test_main_thread_stands_still_while_another_runs_the_hooks(self):
        with closer() as one, mock.patch.object(shutdown.Closer, "ident", 1):
            rospy.core._in_shutdown = True  # that has called rospy.signal_shutdown
            threading.Timer(2 * shutdown.HELD_FOR, one._hooks_ran.set).start()
            signal.raise_signal(signal.SIGTERM)
            self.assertTrue(one._hooks_ran.is_set())

    def test_program_that_ends_waits_for_a_thread_that_is_just_closing_the_node(self):
        with closer() as one:
            rospy.core._in_shutdown = True  # that has called rospy.signal_shutdown
            threading.Timer(0.2, one._closed.set).start()
            one._finish()
            self.assertTrue(one._closed.is_set())

    def test_shutdown_for_another_reason_than_the_program_s_end_is_rospys(self):  # of rospy.spin, after Ctrl-C
        with closer() as one:
            one._signal_shutdown("keyboard interrupt")
            self.assertEqual((True, False), (rospy.is_shutdown(), one._hooks.locked()))

    def test_program_that_ends_waits_for_its_node_also_where_no_callback_is_at_work(self):
        with closer() as one, mock.patch.multiple(shutdown, CLOSED_WITHIN=0, _callbacks_run=lambda: False):
            rospy.core.add_shutdown_hook(lambda _: time.sleep(0.2))
            one._finish()
            self.assertTrue(one._closed.is_set())

    def test_node_whose_main_thread_does_not_hear_ends_all_the_same(self):
        with closer() as one, mock.patch.multiple(shutdown, HEARD_WITHIN=0, KILLED_AFTER=0):
            one._deadline = time.monotonic()
            one._shut_down()
        self.assertTrue(rospy.is_shutdown())

    def test_line_on_a_goal_that_another_thread_has_just_taken_is_no_error(self):
        with mock.patch.object(log, "_soon", mock.MagicMock(popleft=mock.Mock(side_effect=IndexError))):
            log.catch_up()

    def test_stdout_stays_shows_each_print_and_progress_at_once_and_a_child_gets_pythons_own_back(self):
        for errors, ours, unbuffered in (("strict", "backslashreplace", False), ("strict", "backslashreplace", True),
                                         ("surrogateescape", "surrogateescape", False)):
            stream = io.TextIOWrapper(io.BytesIO(), "ascii", errors, line_buffering=True, write_through=unbuffered)
            stream.buffer.name, written = "<stdout>", b""
            with mock.patch.multiple(sys, stdout=stream, __stdout__=stream):
                stdout.take_over(print)
                self.assertIs(stream, sys.stdout)
                self.assertEqual((ours, True), (stream.errors, "write" in vars(stream)))
                for text, is_shown in (("two\nlines", False), ("\n", True), ("50 %", False), ("", True),
                                       ("\r51 %", True), ("pending", False)):  # as print does, and a progress
                    before, written = stream.buffer.getvalue(), written + text.encode()
                    self.assertEqual(len(text), stream.write(text))
                    self.assertEqual(written if is_shown or unbuffered else before, stream.buffer.getvalue())
                shown = stream.buffer.getvalue()
                for _ in range(2):  # a child of a child
                    stdout.give_back()
                self.assertEqual(shown, stream.buffer.getvalue(), "a fork may wait for whoever writes")
                stream.write("\n")
                self.assertEqual(written + b"\n", stream.buffer.getvalue())
            self.assertEqual([], list(vars(stream)))
        for other in None, io.StringIO(), io.TextIOWrapper(io.BytesIO()):
            with mock.patch.multiple(sys, stdout=other, __stdout__=other):
                stdout.take_over(print)
                self.assertIs(other, sys.stdout)
        with mock.patch.object(sys, "stdout", weakref.proxy(sys.__stdout__)) as tee:  # a program's own way to it
            stdout.take_over(print)
        self.assertNotIn("write", vars(tee))

    def test_full_pipe_that_does_not_block_is_the_program_s_own_affair(self):
        close_node = mock.Mock()
        with self.assertRaises(BlockingIOError):
            stdout._write(mock.Mock(), mock.Mock(side_effect=BlockingIOError), close_node, "a bowl")
        close_node.assert_not_called()
        with mock.patch.object(os, "dup2"), ThreadPoolExecutor(1) as thread:
            self.logged()
            self.assertEqual(6, thread.submit(
                stdout._write, mock.Mock(), mock.Mock(side_effect=OSError), close_node, "a bowl").result())

    def test_heartbeat_timeout_that_is_no_number_above_0_is_a_value_error(self):
        for wrong in 0, -1, float("nan"), True, "5":
            with self.assertRaisesRegex(ValueError, "^heartbeat_timeout is .*above 0$", msg=wrong):
                robust.SimpleActionClient("work", None, heartbeat_timeout=wrong)

    def watch(self, *goals, **client_s):
        """Have a client look after goals (mock.Mock), one at each look; it has these attributes. Returns it."""
        def tracked(goals=iter([*goals, None])):
            self.assertFalse(is_free(mutex), "another thread may send the next goal just now")
            return next(goals)

        watched, mutex = mock.MagicMock(
            _SimpleActionClient__goal=tracked, _SimpleActionClient__heartbeat_timeout=5, **client_s), threading.RLock()
        watched.action_client.manager.list_mutex = mutex
        robust.SimpleActionClient._SimpleActionClient__watch(watched)
        return watched

    def test_clock_that_is_set_back_adds_no_patience_and_a_goal_sent_while_the_older_is_lost_is_looked_after(self):
        goal, older, newer = mock.Mock(silence=1.0), mock.Mock(silence=100.0, ignored=100.0), mock.Mock(silence=0.0)
        rospy.rostime._set_rostime(rospy.Time(1000))
        goal.look.side_effect = lambda _: rospy.rostime._set_rostime(rospy.Time(10))
        self.watch(goal, goal)
        self.watch(older, newer, newer)
        self.assertEqual([mock.call(0)] * 3, goal.look.mock_calls + newer.look.mock_calls)

    def test_watcher_of_goals_ends_when_there_is_none_that_runs_and_with_the_node(self):
        for goal, rospy.core._shutdown_flag in (
                (None, False), (mock.Mock(simple_state=SimpleGoalState.DONE), False), (mock.Mock(), True)):
            with mock.patch.object(time, "sleep") as sleep:
                self.assertFalse(self.watch(goal)._SimpleActionClient__is_watched, "who would look after the next goal")
            sleep.assert_called_once_with(client.LOOKS)

    def test_goal_that_nobody_confirms_is_sent_again_each_second_for_4_s_or_while_the_server_speaks_of_others(self):
        for speaks_of_others, begun, sent, count in (
                (False, 3, 0.5, 0), (False, 3, 1.5, 1), (False, 9, 1.5, 0), (True, 9, 1.5, 1)):
            goal, now = mock.Mock(silence=0.0, state=CommState.WAITING_FOR_GOAL_ACK), time.monotonic()
            goal.look.return_value, goal.begun_at, goal.sent_at = speaks_of_others, now - begun, now - sent
            with mock.patch.object(client, "LOOKS", 0):
                self.watch(goal)
            self.assertEqual(count, goal.send_again.call_count, (speaks_of_others, begun, sent))

    def test_goal_that_waited_for_a_busy_server_is_not_lost_when_that_speaks_of_others_at_last(self):
        goal, _ = self.goal_and_result(None)
        for passed_over, mentioned, silence, ignored in (
                (False, False, 5, 0), (True, False, 10, 5), (True, False, 15, 10), (True, True, 0, 0)):
            goal.passed_over, goal.mentioned = passed_over, mentioned
            self.assertEqual(passed_over and not mentioned, goal.look(5))
            self.assertEqual((silence, ignored, False), (goal.silence, goal.ignored, goal.passed_over))
        other, ignored = self.goal_and_result(None)[0], []
        for other.topic in "elsewhere", goal.topic:  # where the result waits behind the callback
            goal.passed_over, goal.mentioned = True, False
            other.call(lambda: ignored.append(goal.look(5) and goal.ignored))
        self.assertEqual([5, 5], ignored)
        busy, lives = mock.Mock(silence=9, ignored=1, **{"look.side_effect": [True, False]}), mock.Mock()
        self.watch(busy, busy, _SimpleActionClient__server_lives=lives)
        self.assertEqual(([], 1), (busy.lose.mock_calls, lives.call_count))

    def test_goal_is_lost_after_30_s_unless_a_callback_holds_up_the_statuses_of_a_server_that_lives(self):
        for held_up, speaks_of_others, lives, is_lost in (
                (False, False, True, True), (True, False, True, False), (True, False, False, True),
                (True, True, True, True)):
            goal, _ = self.goal_and_result(lambda gh: gh.comm_state_machine.call(
                lambda: heard.append("/result" in client._running)), mock.Mock())
            heard, goal.silence, goal.state = [], 31, CommState.ACTIVE
            goal.look = mock.Mock(return_value=speaks_of_others)
            with mock.patch.object(client, "_running", [goal.topic] * held_up):
                self.watch(*[goal] * 3, _SimpleActionClient__server_lives=lambda: lives)  # one is not asked for
            self.assertEqual([held_up] * is_lost, heard, (held_up, speaks_of_others, lives))

    def test_feedback_and_status_of_the_goal_not_of_another_are_words_about_it_and_a_callback_is_no_silence(self):
        goal, _ = self.goal_and_result(None)
        goal.feedback_cb = mock.Mock()
        with ThreadPoolExecutor(1) as thread:
            for goal_id, held, silence in ("other", None, 5), ("id", None, 0), ("other", goal.mutex, 0):
                status = GoalStatus(goal_id=GoalID(id=goal_id))
                for hear, message in ((goal.update_feedback, TestActionFeedback(status=status)),
                                      (goal.update_status, GoalStatusArray(status_list=[status]))):
                    goal.silence, goal.mentioned = 0, False
                    hear(message)
                    with held or contextlib.nullcontext():  # as active_cb is called
                        thread.submit(goal.look, 5).result()
                    self.assertEqual(silence, goal.silence, (goal_id, message))
        self.assertEqual(float("inf"), goal.sent_at, "it has come, and is not sent again")

    def test_news_of_other_goals_and_of_one_that_has_ended_wait_for_none_of_its_callbacks(self):
        goal, result = self.goal_and_result(None)
        with ThreadPoolExecutor(1) as thread, goal.mutex:  # as done_cb is called
            thread.submit(goal.update_result, TestActionResult()).result(10)
            goal.state = CommState.DONE
            for hear, news in (goal.update_result, result), (goal.update_status, GoalStatusArray()):
                thread.submit(hear, news).result(10)

    def test_callback_that_fails_is_named_in_the_log(self):
        said, (goal, _) = self.logged(), self.goal_and_result(None)
        goal.call(lambda: 1 / 0)
        self.assertRegex(said[0], "^the callback <lambda> failed: (?s:.*)ZeroDivisionError")

    def test_feedback_that_nobody_wants_is_no_error(self):
        asked = mock.MagicMock(feedback_cb=None)
        robust.SimpleActionClient._handle_feedback(asked, asked.gh, None)

    def test_goal_of_a_handle_that_a_subclass_has_made_as_actionlib_does_has_feedback_and_its_end(self):
        for base in actionlib.SimpleActionClient, robust.SimpleActionClient:
            one, sent, result = base.__new__(base), TestActionGoal(), TestActionResult()
            sent.goal_id.id = result.status.goal_id.id = "id"
            result.status.status = GoalStatus.SUCCEEDED
            one.action_client, one.done_condition = mock.MagicMock(), threading.Condition()
            one.done_cb, one.active_cb, one.feedback_cb = heard = mock.Mock(), mock.Mock(), mock.Mock()
            one.simple_state = SimpleGoalState.PENDING
            machine = actionlib.action_client.CommStateMachine(
                sent, one._handle_transition, one._handle_feedback, None, None)
            one.gh = actionlib.ClientGoalHandle(machine)
            machine.update_feedback(TestActionFeedback(status=result.status))
            machine.update_result(result)
            self.assertEqual([1, 1, 1], [each.call_count for each in heard], base)
            self.assertTrue(one.wait_for_result(rospy.Duration(1)))

    def test_state_that_is_none_has_its_number_for_a_name(self):
        self.assertEqual(["LOST", "42"], list(map(internals.name_of, (GoalStatus.LOST, 42))))

    def test_parameter_that_is_not_the_nodes_own_is_asked_for_before_its_start_too(self):
        for name, rospy.core._client_ready in ("/plates", False), ("~plates", True):  # as it is now
            with arguments("_plates:=5"), self.assertRaises(OSError):  # of the master that it asks
                robust.get_param(name, 1)

    def test_wrong_parameter_of_the_server_is_deleted_by_its_name_and_one_of_the_command_line_is_not_there(self):
        rospy.core._client_ready, cache = True, rospy.impl.paramserver.ParamServerCache()
        with mock.patch.object(rospy.impl.paramserver, "_param_server_cache", cache), arguments("_n:=abc"):
            for name, words in ("~n", ""), ("/plates", "; .* `rosparam delete /plates`"), (
                    "~m", "; .* `rosparam delete %s`" % rospy.get_name()):
                cache.set(rospy.resolve_name(name), "abc")
                with self.assertRaisesRegex(ValueError, "must be a whole number%s$" % words):
                    robust.get_param(name, 1)

    def test_parameter_without_value_and_default_is_a_key_error_and_asked_for_unless_it_can_only_be_an_argument(self):
        for name, rospy.core._client_ready, error in (  # an OSError of the master that is asked
                ("~n", False, KeyError), ("~n", True, OSError), ("/n", False, OSError), ("/n", True, OSError)):
            with arguments("_m:=1"), self.assertRaises(error):
                robust.get_param(name)

    def test_client_whose_topics_are_closed_while_it_starts_says_that_it_was_interrupted(self):
        closed = rospy.ROSException("subscriber has been closed")
        with mock.patch.object(client, "get_params"), mock.patch.object(peers, "serve_all_peers") as mended, \
                mock.patch.object(actionlib.SimpleActionClient, "__init__", side_effect=closed):
            for rospy.core._in_shutdown, words in (False, "subscriber has been closed"), (True, "interrupted"):
                with self.assertRaisesRegex(rospy.ROSInitException, "^the client of /work cannot start: %s$" % words):
                    robust.SimpleActionClient("work", None)
        self.assertEqual(2, mended.call_count)

    def test_server_is_told_of_its_client_once_more_after_3_s_also_where_no_master_answers(self):
        asked, topic = mock.Mock(_SimpleActionClient__registered=0), rospy.Publisher("topic", GoalID, queue_size=1)
        self.addCleanup(topic.unregister)
        with mock.patch.object(rospy.core, "_uri", "uri"), mock.patch.object(client, "ask", wraps=client.ask) as ask:
            for _ in range(2):
                robust.SimpleActionClient._SimpleActionClient__register_again(asked, [topic, topic])
        self.assertEqual(2, ask.call_count)

    def test_server_is_there_when_it_sends_its_results_and_feedback_here_not_elsewhere(self):
        asked, me, ago = mock.MagicMock(), rospy.get_name(), time.monotonic() - 60
        asked.action_client.result_sub.resolved_name = "/result"
        asked.action_client.feedback_sub.resolved_name = "/feedback"
        here, elsewhere = ([(1, me, "o", "TCPROS", "/result"), (2, peer, "o", "TCPROS", "/feedback")]
                           for peer in (me, "/elsewhere"))
        unnamed = [(1, "::ffff:127.0.0.1:5", "o", "TCPROS", "/result", True)]  # rosnodejs
        for connections, registered, is_there in (
                (here, ago, True), (elsewhere, ago, False), ([], ago, True), ([], time.monotonic(), False),
                (0, ago, True), (unnamed, ago, True), ([(1, "http://me", "i", "TCPROS", "/result")], ago, False)):
            asked._SimpleActionClient__registered = registered
            with mock.patch.object(client, "ask_node", return_value=connections):
                self.assertEqual(is_there, robust.SimpleActionClient._SimpleActionClient__is_connected(asked))
        asked._SimpleActionClient__silent = asked.action_client.last_status_msg  # since the server is lost
        self.assertFalse(robust.SimpleActionClient._SimpleActionClient__is_connected(asked))

    def test_who_hears_of_a_goal_that_the_shutdown_ended_waits_for_that_but_hooks_and_goals_of_servers_do_not(self):
        for shutdown.hooks_thread, unended, waits in (
                (None, [], False), (threading.get_ident(), [], False), (-1, ["goal"], False), (-1, [], True)):
            with mock.patch.object(shutdown, "servers", {mock.Mock(**{"unended.return_value": unended})}), \
                    mock.patch.object(shutdown, "wait_until") as wait_until:
                shutdown.let_loops_see_it()
            self.assertEqual([mock.call(rospy.is_shutdown, 1)] * waits, wait_until.mock_calls,
                             (shutdown.hooks_thread, unended))

    def test_shutdown_cancels_the_client_s_goal_but_none_that_a_hook_has_sent(self):
        for in_hook in False, True:
            goal = mock.Mock(in_hook=in_hook, simple_state=SimpleGoalState.DONE)
            robust.SimpleActionClient._SimpleActionClient__end_goal(
                mock.Mock(_SimpleActionClient__goal=lambda goal=goal: goal), 0)
            self.assertEqual(not in_hook, goal.cancel.called)

    def test_goal_that_is_sent_while_the_node_ends_is_a_hook_s_and_no_other_thread_forgets_it_meanwhile(self):
        def send(*_):
            with self.assertRaises(TimeoutError):
                thread.submit(one.stop_tracking_goal).result(0.05)
            return actionlib.ClientGoalHandle(self.goal_and_result(None)[0])

        one = robust.SimpleActionClient.__new__(robust.SimpleActionClient)
        one.__dict__.update(_SimpleActionClient__set_up=mock.Mock(), _SimpleActionClient__is_watched=True)
        one.action_client = mock.MagicMock(send_goal=send, **{"manager.list_mutex": threading.RLock()})
        for shutdown.hooks_thread, rospy.core._in_shutdown in (
                (None, False), (threading.get_ident(), True), (None, True)):
            with mock.patch.object(shutdown, "unfinished") as unfinished, ThreadPoolExecutor(1) as thread:
                one.send_goal(None)
            self.assertEqual(rospy.core._in_shutdown, unfinished.add.mock_calls[0][1][0].in_hook)
        for shutdown.hooks_thread, rospy.core._shutdown_flag in (-1, False), (None, True):  # they have run; it is down
            self.assertRaises(rospy.ROSInitException, one.send_goal, None)
        self.assertEqual(5, one._SimpleActionClient__set_up.call_count, "a subclass may have an __init__ of its own")

    def test_time_out_for_a_result_ends_with_the_tick_of_a_simulated_clock_on_which_it_falls(self):
        one = robust.SimpleActionClient.__new__(robust.SimpleActionClient)
        one.__dict__.update(action_client=mock.MagicMock(), done_condition=mock.MagicMock(),
                            gh=actionlib.ClientGoalHandle(self.goal_and_result(None)[0]))
        rospy.rostime._set_rostime(rospy.Time(0, 900000000))
        ticks = iter([rospy.Time(1, 200000000)])
        one.done_condition.wait = lambda _: rospy.rostime._set_rostime(next(ticks))
        with mock.patch.object(shutdown, "let_loops_see_it") as waits:
            self.assertFalse(one.wait_for_result(rospy.Duration(0, 300000000)))
        waits.assert_not_called()
        one.done_condition.wait = mock.Mock(side_effect=lambda _: one.stop_tracking_goal())
        self.assertFalse(one.wait_for_result())
        one.done_condition.wait.assert_called_once_with(0.1)  # below 0 it would return at once

    def test_short_wait_for_a_server_far_away_finds_it_and_a_look_does(self):
        for timeout in 0.001, -1:
            self.assertTrue(node.wait_for("server", lambda: time.sleep(0.01) or True, timeout))
            self.assertFalse(node.wait_for("server", lambda: False, timeout))

    def test_server_lives_if_its_node_answers_at_the_other_end_of_a_connection(self):
        asked, ours = mock.MagicMock(), mock.Mock(callerid_pub="/server")
        asked.action_client.last_status_msg._connection_header = {"callerid": "/server"}
        lives = robust.SimpleActionClient._SimpleActionClient__server_lives
        for connections, answers in ([ours, ours], True), ([ours], False), ([mock.Mock()] * 2, False), (None, False):
            asked.action_client.status_sub.impl.connections = connections
            with mock.patch.object(client, "ask", side_effect=[OSError, 1]) as ask:
                self.assertEqual(answers, lives(asked), connections)
        self.assertFalse(ask.called)
        asked.action_client.status_sub.impl = None  # of a client that was stopped
        self.assertFalse(lives(asked))
        asked.action_client.last_status_msg, asked.action_client.status_sub.impl = None, mock.Mock(connections=[ours])
        self.assertFalse(lives(asked), "it never spoke")

    def test_wait_for_a_server_before_init_node_does_not_begin(self):
        rospy.rostime.set_rostime_initialized(False)
        asked = mock.MagicMock()
        with self.assertRaisesRegex(rospy.ROSInitException, "init_node"):
            robust.SimpleActionClient.wait_for_server(asked, 0.1)
        asked._SimpleActionClient__set_up.assert_called_once()  # a subclass may have an __init__ of its own

    def goal_and_result(self, told, send_cancel=None):
        """Returns a goal that calls these functions with its handle and with a cancel, and its result, SUCCEEDED."""
        sent, result = TestActionGoal(), TestActionResult()
        sent.goal_id.id = result.status.goal_id.id = "id"
        result.status.status = GoalStatus.SUCCEEDED
        goal = client._Goal(sent, told, None, None, send_cancel)
        goal.begin("/result", False)
        return goal, result

    def test_goal_that_is_lost_while_its_result_comes_or_while_a_callback_takes_its_time_has_one_ending(self):
        def enter(_):
            goal.mutex = mutex
            first()

        for is_lost, ending in (True, (GoalStatus.LOST, "why")), (False, (GoalStatus.SUCCEEDED, "")):
            goal, result = self.goal_and_result(None, mock.Mock())
            ways = functools.partial(goal.update_result, result), functools.partial(goal.lose, "why")
            first, second = reversed(ways) if is_lost else ways
            mutex, goal.mutex = goal.mutex, mock.MagicMock(__enter__=enter)  # as if the other had it, in another thread
            second()
            self.assertEqual(ending, (goal.latest_goal_status.status, goal.why))
            goal.feedback_cb = mock.Mock()
            for stamp, calls in (1, 0), (0, not is_lost):  # sent after the result, and before
                feedback = TestActionFeedback(status=result.status)
                feedback.header.stamp = rospy.Time(stamp)
                goal.update_feedback(feedback)
                self.assertEqual(calls, goal.feedback_cb.call_count, "feedback of %d s, LOST: %s" % (stamp, is_lost))

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

    def test_socket_for_peers_waits_whatever_the_default_time_out_and_may_be_closed_before_its_thread_runs(self):
        server, tcpros = self.peers_server()[0], tcpros_base.init_tcpros_server()
        connect = tcpros.topic_connection_handler
        peers.serve_all_peers()
        self.assertIs(connect, tcpros.topic_connection_handler, "that of the first call")
        self.assertTrue(os.get_blocking(server.server_sock.fileno()))
        server.shutdown()
        server.run()

    def test_silent_peer_is_let_go_and_holds_up_nobody_one_that_speaks_slowly_is_heard_and_one_may_be_gone(self):
        heard, header = [], encode_ros_handshake_header({"topic": "topic"})
        _, connect = self.peers_server(lambda peer, *_: heard.append(peer.gettimeout()))
        with mock.patch.object(peers, "SPEAKS_WITHIN", 3), mock.patch.object(threading, "excepthook") as complaint:
            silent, slow, gone = connect(b""), connect(header[:3]), connect(b"")
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # with a reset
            gone.close()
            connect(header)
            eventually(lambda: heard, "the peer that speaks")
            silent.settimeout(30)
            self.assertEqual(b"", silent.recv(1))
            slow.sendall(header[3:])
            eventually(lambda: len(heard) == 2, "the slow one")
        self.assertEqual([None, None], heard, "time-outs of those that have spoken")
        complaint.assert_not_called()

    def test_peers_are_connected_one_after_the_other_by_locks_that_are_looked_up_so_and_forgotten(self):
        def alone(*_):
            inside.append(1)
            most.append(len(inside))
            threading.Event().wait(0.01)
            inside.pop()
            return threading.Lock()

        inside, most = [], []
        _, connect = self.peers_server(alone)
        one_at_a_time = peers._OneAtATime(alone)
        with mock.patch.object(peers, "ANSWERS_WITHIN", 60), ThreadPoolExecutor(20) as threads:
            for _ in range(20):
                connect(encode_ros_handshake_header({"topic": "topic"}))
            eventually(lambda: len(most) == 20 and not inside, "20 connections")
            threads.map(one_at_a_time, ["topic"] * 20, ["uri"] * 20)
        self.assertEqual(0, len(one_at_a_time._locks))
        one_at_a_time = peers._OneAtATime(lambda *_: None)
        one_at_a_time._locks = mock.Mock(setdefault=alone)
        with ThreadPoolExecutor(20) as threads:
            threads.map(one_at_a_time, range(20), range(20))
        self.assertEqual([1] * 60, most)

    def test_what_rospy_quotes_of_a_peer_steers_no_terminal(self):
        said, (_, connect) = self.logged(), self.peers_server(lambda *_: "\x1b[2J\nfake")
        connect(encode_ros_handshake_header({"topic": "topic"}))
        self.assertIn(r"\x1b[2J\nfake", eventually(lambda: said, "a warning")[0])

    def test_publishers_of_a_topic_are_those_of_all_lists_that_have_come(self):
        listener = rospy.impl.masterslave.ROSHandler("/node", None).reg_man
        registration.get_registration_listeners().add_listener(listener)
        self.addCleanup(registration.get_registration_listeners().listeners.remove, listener)
        peers.serve_all_peers()
        listener.publisher_update("another", ["elsewhere"])
        for uris in ["uri", "other"], ["uri"], []:
            listener.publisher_update("topic", uris)
        self.assertEqual([("another", ["elsewhere"]), ("topic", ["uri", "other"])], listener.updates)
        mended = listener.handler._connect_topic
        self.assertIsInstance(mended, peers._OneAtATime)
        peers.serve_all_peers()
        self.assertIs(mended, listener.handler._connect_topic, "mended once")

    def test_peer_that_fails_leaves_the_lock_to_the_next_or_to_whom_it_has_waited_for_in_vain(self):
        self.assertLessEqual(peers.ANSWERS_WITHIN, 2, "s for which one at the port of a lost peer would wait")
        lock = threading.Lock()
        patience = threading.Timer(20, lock.release)
        self.addCleanup(patience.cancel)
        patience.start()
        for is_held in False, True:
            with mock.patch.object(peers, "ANSWERS_WITHIN", 0), self.assertRaises(OSError):
                peers._in_turn(lock, mock.Mock(side_effect=OSError))
            self.assertEqual(is_held, lock.locked())
            lock.acquire(blocking=False)

    def test_port_that_is_none_is_named(self):
        for port in 70000, "11311":
            with self.assertRaisesRegex(rospy.ROSInitException, "^tcpros_port is %r: " % port):
                peers.check_port("tcpros_port", port)

    def test_period_begins_with_a_clock_that_begins_in_a_sleep_or_after_one_set_back_with_its_end_else_as_rospys(self):
        for begin, *seconds, end, next_begins in (
                (0, 0, 100, 100.5, 101, 101), (100, 10, 10.5, 11, 11), (100, 100.25, 203.5, 101)):
            rospy.rostime._set_rostime(rospy.Time(begin))
            looked, a_rate = [], rate.Rate(1, bool)
            a_rate.remaining = lambda a_rate=a_rate: looked.append(1) or rospy.Rate.remaining(a_rate)
            with ThreadPoolExecutor(1) as thread:
                slept = thread.submit(a_rate.sleep)
                for number, second in enumerate([*seconds, end]):
                    eventually(lambda: len(looked) > number, "a look at the clock")
                    self.assertFalse(slept.done(), "ended at %s" % second)
                    rospy.rostime._set_rostime(rospy.Time(second))
                self.assertTrue(slept.result(10))
            self.assertEqual(next_begins, a_rate.last_time.to_sec())
        for late in 1, 2.5, 3, 3.5, 100.5:  # it catches up if it is late by up to two periods
            rospy.rostime._set_rostime(rospy.Time(100))
            both = rate.Rate(1, bool), rospy.Rate(1)
            rospy.rostime._set_rostime(rospy.Time(100 + late))
            for one in both:
                one.sleep()
            self.assertEqual(*(one.last_time for one in both))

    def test_rate_asks_whether_to_stop_without_the_clock_s_lock_and_hears_whoever_wakes_it_meanwhile(self):
        def stop_requested():
            waker = shutdown.aside(rate.wake)  # which takes that lock
            waker.join(5)
            asked.append(waker.is_alive())
            return asked[1:]

        asked = []
        with mock.patch.object(rospy.rostime.get_rostime_cond(), "wait") as wait:
            self.assertFalse(rate.Rate(0.1, stop_requested).sleep())
        wait.assert_not_called()
        self.assertEqual([False, False], asked)

    def test_rate_sleeps_until_its_end_in_real_time_or_news_of_a_simulated_clock_and_does_not_poll(self):
        for clock in None, rospy.Time(1):
            with mock.patch.object(rospy.rostime, "_rostime_current", clock), \
                    mock.patch.object(rospy.rostime.get_rostime_cond(), "wait") as wait:
                self.assertFalse(rate.Rate(0.01, mock.Mock(side_effect=[False, True])).sleep())
            left, = (left for (left,), _ in wait.call_args_list)
            self.assertTrue(left is None if clock else 90 < left <= 100, left)

    def test_whoever_wakes_one_rate_wakes_all(self):
        def sleep():
            with clock:
                asleep.append(1)
                return clock.wait(10)

        clock, asleep = rospy.rostime.get_rostime_cond(), []
        with ThreadPoolExecutor(2) as threads:
            slept = [threads.submit(sleep) for _ in range(2)]
            eventually(lambda: len(asleep) == 2, "two that sleep")
            rate.wake()
            self.assertEqual([True, True], [one.result() for one in slept])

    def advertise(self, action_server):
        """Gives it its topics, to which nobody listens. The last message is in NAME_pub.impl.latch."""
        rospy.core.set_initialized(True)
        for topic, message in (("status", GoalStatusArray), ("feedback", TestActionFeedback),
                               ("result", TestActionResult)):
            publisher = rospy.Publisher("work/" + topic, message, latch=True, queue_size=1)
            setattr(action_server, topic + "_pub", publisher)
            self.addCleanup(publisher.unregister)

    def serving(self):
        """Returns a server that needs no master."""
        one = robust.SimpleActionServer("work", TestAction, auto_start=False)
        one.lock = threading.Lock()  # as a subclass may have for data of its own
        one.action_server.started = True
        self.advertise(one.action_server)
        return one

    def test_loop_of_a_server_waits_when_it_looked_in_vain_but_not_if_a_goal_came_meanwhile(self):
        for comes in False, True:
            asked = mock.MagicMock(new_goal=False)
            asked.is_new_goal_available = lambda: setattr(asked, "new_goal", comes)  # None: it found none
            type(asked).need_to_terminate = mock.PropertyMock(side_effect=[False, True])
            robust.SimpleActionServer.executeLoop(asked)
            self.assertEqual([] if comes else [mock.call(0.1)], asked.execute_condition.wait.mock_calls)
        rospy.core._shutdown_flag = True  # before the server was started
        robust.SimpleActionServer.executeLoop(mock.Mock(need_to_terminate=False))

    def test_server_that_its_subclass_or_program_starts_in_a_way_of_its_own_begins_once_and_ends_when_told(self):
        class Own(robust.SimpleActionServer):
            start = None  # it means something else by that

        for auto_start, end in (True, Own.__del__), (False, lambda one: setattr(one, "need_to_terminate", True)):
            with mock.patch.object(server._ActionServer, "initialize", autospec=True,
                                   side_effect=self.advertise) as initialize, \
                    mock.patch.object(robust.SimpleActionServer, "_SimpleActionServer__look_for_twins"):
                one = Own("work", TestAction, print, auto_start)
                self.addCleanup(setattr, one, "need_to_terminate", True)
                for _ in range(2):
                    one.action_server.start()
                initialize.assert_called_once()
                thread, one.action_server.started = one.execute_thread, False
                one.action_server.start()  # it was stopped
                self.assertIs(thread, one.execute_thread)
                Own("work", TestAction, print, False).__del__()
                other = Own("work", TestAction)
                self.addCleanup(setattr, other, "need_to_terminate", True)
                self.assertIsNone(other.execute_thread, "it would take the callback's goals")
            one.action_server.status_frequency = 7
            self.assertEqual((7, True), (one.action_server.status_frequency, one.execute_thread.is_alive()))
            shutdown.aside(end, one)
            eventually(lambda: not one.execute_thread.is_alive(), "an end")

    def test_loop_of_a_server_asks_a_subclass_without_a_lock_and_again_each_0_1_s_while_that_lets_a_goal_wait(self):
        def is_new_goal_available():
            free.append(is_free(one.execute_condition) and is_free(one.action_server.lock))
            one.need_to_terminate = len(free) == 2

        one, free = self.serving(), []
        one.new_goal, one.is_new_goal_available = True, is_new_goal_available
        with mock.patch.object(one.execute_condition, "wait") as wait:
            one.executeLoop()
        wait.assert_called_with(0.1)
        self.assertEqual([True, True], free)

    def test_result_waits_until_feedback_is_through_but_not_after_a_cancel(self):
        for end, waits in ("set_succeeded", True), ("set_aborted", True), ("set_preempted", False):
            one, free = self.serving(), []
            take_up(one)
            one.publish_feedback(TestActionFeedback().feedback)
            with mock.patch.object(server, "time", mock.Mock(
                    monotonic=time.monotonic, sleep=lambda _: free.append(is_free(one.action_server.lock)))):
                getattr(one, end)(text=end)
            self.assertEqual(end, one.action_server.result_pub.impl.latch.status.text)
            self.assertEqual([False] * waits, free, "what comes meanwhile comes too late for " + end)

    def test_shutdown_ends_a_goal_aborted_that_no_client_has_cancelled_before(self):
        for cancel, state, text in ((), GoalStatus.ABORTED, "the server is shutting down: parked"), (
                [GoalID()], GoalStatus.PREEMPTED, "parked"):
            one = self.serving()
            take_up(one)
            for goal_id in cancel:
                one.action_server.internal_cancel_callback(goal_id)
            one._SimpleActionServer__shutting_down = True
            one.set_preempted(text="parked")
            status = one.action_server.result_pub.impl.latch.status
            self.assertEqual((state, text), (status.status, status.text))

    def test_callback_for_goals_that_exits_keeps_no_lock(self):
        one = self.serving()
        one.register_goal_callback(sys.exit)
        with self.assertRaises(SystemExit):
            one.action_server.internal_goal_callback(TestActionGoal())
        self.assertTrue(is_free(one.execute_condition))

    def test_newer_goal_that_is_accepted_while_the_end_of_the_older_one_waits_for_the_lock_is_not_ended_by_it(self):
        def wait(*_):
            one.action_server.lock = lock
            take_up(one, "newer")

        one = self.serving()
        take_up(one, "older")
        lock, one.action_server.lock = one.action_server.lock, mock.MagicMock(__enter__=wait)
        one.set_succeeded()
        status = one.action_server.result_pub.impl.latch.status
        self.assertEqual(("older", GoalStatus.PREEMPTED, True), (status.goal_id.id, status.status, one.is_active()))

    def test_goals_without_an_ending_are_those_that_came_and_wait_or_run(self):
        one = server._ActionServer.__new__(server._ActionServer)
        one.status_list = [StatusTracker(GoalID(), state) for state in (*range(10), GoalStatus.RECALLING)]
        for tracker in one.status_list[:-1]:  # that is a cancel's
            tracker.goal = TestActionGoal()
        self.assertEqual([GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTING, GoalStatus.RECALLING],
                         [tracker.status.status for tracker in one.unended()])

    def test_line_on_a_goal_has_its_plain_fields_if_any_and_no_more_than_60_letters_of_each(self):
        said = server._plain_fields(GoalStatus(status=3, text="\x1b" * 1000))
        self.assertEqual(r": status 3, text '\x1b", said[:22])
        self.assertLess(len(said), 100)
        self.assertEqual("", server._plain_fields(GoalStatusArray()))

    def test_goal_that_is_recalled_while_the_loop_takes_it_up_or_with_the_server_s_stop_is_not_executed(self):
        asked = mock.Mock(is_active=lambda: False)
        for goal in None, TestActionGoal().goal:
            robust.SimpleActionServer._SimpleActionServer__execute(asked, goal)
        self.assertEqual([], asked.mock_calls)

    def test_server_names_another_that_serves_in_this_node_or_in_one_that_lives_also_where_no_master_answers(self):
        asked = mock.Mock(_SimpleActionServer__name="/action")
        asked.action_server.result_pub.resolved_name, said = "/action/result", self.logged()
        for serves_here, state, named in (
                (True, OSError, rospy.get_name()), (False, OSError, r"^\[]$"),
                # The first that is asked is gone.
                (False, ([["/action/result", ["/one", rospy.get_name(), "/other"]]], [], []), "node /(one|other):"),
                (False, ([], [], []), r"^\[]$")):  # of a new master
            with mock.patch.object(server, "ask", side_effect=[state]), \
                    mock.patch.object(server, "ask_node", side_effect=[OSError, 1]):
                robust.SimpleActionServer._SimpleActionServer__look_for_twins(asked, serves_here)
            self.assertRegex(str(said), named)
            said.clear()

    def test_goal_that_waits_while_the_node_ends_is_recalled_and_not_taken_up(self):
        for state, is_recalled in (GoalStatus.PENDING, True), (GoalStatus.REJECTED, False):
            asked = mock.MagicMock(**{"is_active.return_value": False})
            asked.next_goal.get_goal_status().status = state  # the program may have ended it in its goal callback
            robust.SimpleActionServer._SimpleActionServer__ask_to_stop(asked)
            self.assertEqual((is_recalled, False), (asked.next_goal.set_canceled.called, asked.new_goal))
            self.assertTrue(asked.action_server.lock.__enter__.called and asked.execute_condition.__enter__.called)
            asked.preempt_callback.assert_not_called()
        asked.next_goal.get_goal_status.reset_mock()
        robust.SimpleActionServer._SimpleActionServer__ask_to_stop(asked)
        asked.next_goal.get_goal_status.assert_not_called()  # of none that waits there is none
        asked.new_goal, asked.next_goal = True, None  # of a program that refuses goals
        asked.is_active.return_value = True
        robust.SimpleActionServer._SimpleActionServer__ask_to_stop(asked)
        asked.preempt_callback.assert_called_once()

    def test_goal_that_is_accepted_takes_over_from_one_that_runs_only(self):
        one = self.serving()
        for count, callback in enumerate((print, print, one.set_preempted)):  # the last leaves no active goal
            one.register_preempt_callback(callback)
            one.action_server.internal_goal_callback(TestActionGoal())
            one.preempt_request &= count == 2  # as programs do that let a goal end first
            for _ in range(2):  # the second time none waits
                one.accept_new_goal()
            self.assertEqual((count, threading.get_ident() if count else None),
                             (one._SimpleActionServer__taken_over, one._SimpleActionServer__taken_by))

    def test_rate_that_serves_several_goals_ends_one_sleep_for_each_that_is_taken_over(self):
        asked = mock.Mock(_SimpleActionServer__taken_over=0, is_preempt_requested=lambda: False)
        with mock.patch.object(rate, "Rate", lambda hz, stop_requested: stop_requested):
            stop_requested = robust.SimpleActionServer.rate(asked, 1)
        before = stop_requested()
        asked.is_preempt_requested = lambda: True
        status = asked.current_goal.status_tracker.status
        for status.status, stops in (GoalStatus.PREEMPTED, True), (GoalStatus.PREEMPTING, True), \
                (GoalStatus.PREEMPTED, False):  # a preempt callback may have ended it before
            self.assertEqual(stops, stop_requested(), "whoever has heard and ended its goal sleeps on")
        asked.is_active.assert_not_called()  # which waits for a callback that may wait for the worker
        with mock.patch.object(rospy.core, "_shutdown_flag", True):
            self.assertTrue(stop_requested(), "the clock may stand still")
        asked.current_goal.status_tracker = None
        self.assertFalse(stop_requested(), "there was no goal")
        asked.is_preempt_requested, asked._SimpleActionServer__taken_over = lambda: False, 5
        self.assertFalse(stop_requested(), "by a goal that came since the last stop")
        asked._SimpleActionServer__taken_over = 1
        self.assertEqual([False, True, False], [before, stop_requested(), stop_requested()])
        asked._SimpleActionServer__taken_over, asked._SimpleActionServer__taken_by = 2, threading.get_ident()
        self.assertFalse(stop_requested(), "whoever has taken up the newer goal sleeps on")

    def test_server_that_is_stopped_ends_its_goals_and_each_that_comes_later_and_may_go_on_without_them(self):
        def shown():
            return [(each.goal_id.id, each.status) for each in one.action_server.status_pub.impl.latch.status_list]

        for others in [], ["waits"]:
            one = self.serving()
            sent = one.action_server.internal_goal_callback
            take_up(one, "runs")
            for other in others:
                sent(TestActionGoal(goal_id=GoalID(id=other, stamp=rospy.Time(2 ** 31))))  # a clock that is wrong
            with mock.patch.object(one, "execute_condition", mock.MagicMock()) as lock, \
                    mock.patch.object(time, "sleep") as sleep, mock.patch.object(rate, "wake") as wake, \
                    mock.patch.object(actionlib.ActionServer, "stop",
                                      side_effect=lambda: sleep.assert_called_with(shutdown.SENT_WITHIN)):
                one.action_server.stop()
            wake.assert_called_once()
            lock.__enter__.assert_called_once()
            self.assertEqual([("runs", GoalStatus.ABORTED)] + [(each, GoalStatus.RECALLED) for each in others], shown())
            self.assertEqual((False, True), (one.is_new_goal_available(), one.is_preempt_requested()))
            sent(TestActionGoal(goal_id=GoalID(id="late")))  # its topics may be open yet
            self.assertEqual([("late", GoalStatus.RECALLED)], shown())
            late = one.action_server.result_pub.impl.latch
            self.assertEqual(("late", server.SHUTTING_DOWN), (late.status.goal_id.id, late.status.text))
            self.assertGreater(late.header.stamp, rospy.Time())
            one.action_server.started, one.action_server.status_list_timeout = True, rospy.Duration(-1)  # again
            take_up(one, "next", 1)
            self.assertEqual((True, False), (one.is_active(), one.is_preempt_requested()))
            one.action_server.publish_status()
            self.assertEqual([("next", GoalStatus.ACTIVE)], shown())
            with ThreadPoolExecutor(1) as thread:
                thread.submit(one.action_server.lock.acquire).result()  # a callback that never comes back
                one.action_server.close()
            self.assertEqual([("next", GoalStatus.ABORTED)], shown())

    def test_goal_comes_and_ends_and_a_heart_beats_with_the_lock(self):
        one = self.serving()
        held = mock.Mock(side_effect=lambda: self.assertFalse(is_free(one.action_server.lock)))
        with mock.patch.object(one.action_server, "_look_at_the_clock", held), \
                mock.patch.object(one, "is_active", held):
            take_up(one)
            one.set_succeeded()
            one.action_server.publish_status_async(None)
        self.assertGreaterEqual(held.call_count, 5)

    def test_status_after_a_cancel_shows_what_the_callback_has_made_of_the_goal(self):
        for callback, state in (mock.Mock(), GoalStatus.PREEMPTING), (
                actionlib.ServerGoalHandle.set_canceled, GoalStatus.PREEMPTED):
            one = self.serving()
            one.action_server.cancel_callback = callback
            take_up(one, "goal")
            one.action_server.status_pub.impl.latch = None
            one.action_server.internal_cancel_callback(GoalID(id="goal"))
            self.assertEqual([state], [each.status for each in one.action_server.status_pub.impl.latch.status_list])

    def test_feedback_that_waits_while_another_thread_stops_the_server_is_not_sent(self):
        one = self.serving()
        take_up(one)
        one.action_server.lock = mock.MagicMock(**{
            "__enter__.side_effect": lambda *_: setattr(one.action_server, "started", False)})
        one.publish_feedback(TestFeedback())
        self.assertIsNone(one.action_server.feedback_pub.impl.latch)

    def test_goal_that_is_older_than_the_one_that_runs_is_recalled(self):
        one, said = self.serving(), self.logged()
        for stamp in 2, 1:
            take_up(one, "of %d" % stamp, stamp)
        ended = one.action_server.result_pub.impl.latch.status.goal_id.id
        self.assertEqual(("of 1", False), (ended, one.is_preempt_requested()))
        self.assertNotIn("ignored", str(said))

    def test_status_shows_an_ending_also_where_the_clock_leaps_meanwhile_and_for_5_s_after_one_was_set_back(self):
        one = self.serving()
        one.action_server.status_list_timeout = rospy.Duration(5)
        program_s = GoalStatus(status=GoalStatus.SUCCEEDED)  # of a goal that is no server's
        one.action_server.publish_result(program_s, None)
        self.assertEqual((GoalStatus.SUCCEEDED, ""), (program_s.status, program_s.text))
        take_up(one, "goal", 600)
        one.action_server.internal_goal_callback(TestActionGoal(goal_id=GoalID(id="next")))
        with mock.patch.object(rospy.Time, "now", side_effect=map(rospy.Time, range(1000, 2000, 10))):
            one.set_succeeded()
        shown, _ = one.action_server.status_pub.impl.latch.status_list
        self.assertEqual(("goal", GoalStatus.SUCCEEDED), (shown.goal_id.id, shown.status))
        goal, following = ("goal", rospy.Time(600)), ("next", rospy.Time())  # whose stamp would be in the future
        for now, shows in (700, [goal, following]), (705, [goal, following]), (706, [following]):
            rospy.rostime._set_rostime(rospy.Time(now))
            one.action_server.publish_status_async(None)
            statuses = one.action_server.status_pub.impl.latch.status_list
            self.assertEqual(shows, [(status.goal_id.id, status.goal_id.stamp) for status in statuses])

    def test_what_is_logged_of_a_goal_holds_up_neither_it_nor_its_ending_and_is_what_came(self):
        one, goal = self.serving(), TestActionGoal(goal_id=GoalID(id="\x1b" * 1000))
        goal.goal.goal = 7
        publish = mock.Mock(side_effect=[rospy.ROSSerializationException("no"), None])
        one.action_server.result_pub.publish = publish
        lines = self.logged(lambda line: (line.getMessage(), is_free(one.action_server.lock), publish.call_count))
        with mock.patch.object(log, "_taken", [1]), mock.patch.object(rate, "wake", lambda: lines.append("woken")):
            one.execute_thread = threading.current_thread()
            one.action_server.internal_goal_callback(goal)
            one.accept_new_goal().goal = 0
            one.action_server.internal_goal_callback(TestActionGoal(goal_id=goal.goal_id))
            one.set_succeeded()
            one.action_server.publish_status_async(None)  # the next heartbeat
            one.action_server.internal_goal_callback(TestActionGoal(goal_id=goal.goal_id))
            self.assertFalse(one.is_new_goal_available())
        ignored = "/work: goal ignored: its id %.60r is that of a recent goal" % goal.goal_id.id
        self.assertEqual(["woken", "woken", ("/work: goal accepted: goal 7", True, 0), (ignored, True, 0),
                          ("/work: the result cannot be sent: no", False, 2),
                          ("/work: goal ABORTED: the result cannot be sent: no", True, 2),
                          "woken", (ignored, True, 2)], lines)

    def test_whoever_wakes_a_rate_waits_for_nobody(self):  # a signal handler of rospy's, say, that holds the lock
        with rospy.rostime.get_rostime_cond():
            before, waker = rate._wakes, shutdown.aside(rate.wake)
            waker.join(5)
            self.assertEqual((False, True), (waker.is_alive(), rate._wakes > before))


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units", Units)
