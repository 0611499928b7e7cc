#!/usr/bin/python3
"""How a node starts, without a node and without a master: parameters, arguments, and what robust offers."""
import ast
import atexit
import contextlib
import inspect
import io
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import threading
import warnings
import xmlrpc.client
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import actionlib
import rospy
import rosunit
from actionlib_msgs.msg import GoalStatus

from actions_tutorial import robust
from actions_tutorial.robust import internals, node, peers, shutdown
from processes import eventually
from units import UnitCase

STANDS_FOR = {name: getattr(rospy if hasattr(rospy, name) else actionlib, name)
              for name in ("init_node", "get_param", "SimpleActionServer", "SimpleActionClient")}


def arguments(*values):
    """A command line with these arguments (str)."""
    return mock.patch.object(sys, "argv", ["node", *values])


def written(name, function):
    """Returns the signature of function, called name, as doc/robust.md writes it."""
    signature = inspect.signature(function)
    parts = str(signature.replace(return_annotation=signature.empty, parameters=[
        each.replace(annotation=each.empty) for each in signature.parameters.values() if each.name != "self"]))
    return name + re.sub("<[^>]*object[^>]*>", "…", parts).replace("rospy.Duration[0]", "rospy.Duration()")


class StartUnits(UnitCase):

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
                ("_m:=3", 2, "unknown parameter ~m, must be one of ~n, ~arm/n\n"),
                ("__n:=3", 2, "unknown parameter ~_n, must be one of ~n"),
                *((wrong, 2, "unknown argument %r" % wrong) for wrong in ("--n=3", "--n:=3", "n-1:=3", "m:=")),
                ("/n:=3", 2, "'/n:=3' renames a topic, must be _n:=3 to set"), (":=3", 2, "unknown argument ':=3'"),
                *((name + ":=3", 2, "'%s:=3' renames a topic, must be _n:=3 to set" % name)
                  for name in ("~n", "/node/n", "/robot/node/n", "node/n")),
                ("__name:=own own/n:=3", 2, "'own/n:=3' renames a topic"), ("arm/n:=3", 2, "must be _arm/n:=3 to set"),
                ("_name:=x", 2, "unknown parameter ~name, must be one of ~n, ~arm/n; __name:=VALUE names the node")):
            said = io.StringIO()
            with arguments(*argument.split()), contextlib.redirect_stderr(said), contextlib.redirect_stdout(said), \
                    mock.patch.object(node, "_wait_for_master", side_effect=AssertionError(argument)), \
                    self.assertRaises(SystemExit) as end:
                robust.init_node("node", usage="how to", parameters={"~n": (7, 0, 9), "~arm/n": (7, 0, 9)})
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
        documented = {"_connection_header", "_exit", "_current_frames"}
        needed, ours, used = set(), set(), set()
        for file in pathlib.Path(robust.__file__).parent.glob("*.py"):
            for part in ast.walk(ast.parse(file.read_text())):
                if isinstance(part, ast.Call) and getattr(part.func, "id", "") == "need":
                    needed.update(*(ast.literal_eval(name).split(".") for name in part.args[2:]))
                elif isinstance(part, ast.Attribute):
                    (ours if isinstance(part.ctx, ast.Store) else used).add(part.attr)
                elif isinstance(part, (ast.FunctionDef, ast.ClassDef)):
                    ours.add(part.name)
        undocumented = {name for name in used if re.match("_[^_]|internal_|add_shutdown_hook", name)}
        self.assertEqual(set(), undocumented - ours - needed - documented)
        self.assertEqual(set(), needed - used - ours)
        lacking = r"^rospy \d+\.\d+\.\d+ has no rospy.rostime.get_rostime_cond, which robust needs; it was "
        with mock.patch.object(rospy.rostime, "get_rostime_cond"), \
                self.assertRaisesRegex(rospy.ROSInitException, lacking):
            del rospy.rostime.get_rostime_cond
            self.server().action_server.initialize()  # not in the midst of a goal

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
            rospy.client._init_node_args = "those of a start that failed half-way"
            with self.assertRaises(ValueError):
                node._start(("", [], False, None, False, False), {})
            self.assertIsNone(rospy.client._init_node_args)
        waited.assert_not_called()
        self.assertEqual([], said)  # of files that stay open
        with arguments("--help"), contextlib.redirect_stdout(io.StringIO()), self.assertRaises(SystemExit):
            robust.init_node("node", usage="how to")
        self.assertEqual((before, added.mock_calls), (process(), removed.mock_calls))
        eventually(lambda: not any(isinstance(one, shutdown.Closer) for one in threading.enumerate()), "its end")

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

    def test_state_that_is_none_has_its_number_for_a_name(self):
        self.assertEqual(["LOST", "42"], list(map(internals.name_of, (GoalStatus.LOST, 42))))

    def test_parameter_that_is_not_the_nodes_own_is_asked_for_before_its_start_too(self):
        for name, rospy.core._client_ready in ("/plates", False), ("~plates", True):  # as it is now
            with arguments("_plates:=5"), self.assertRaises(OSError):  # of the master that it asks
                robust.get_param(name, 1)

    def test_wrong_parameter_of_the_server_is_deleted_by_its_name_and_one_of_the_command_line_is_not_there(self):
        cache, rospy.core._client_ready = self.cache(n="abc", plates="abc"), True
        for name, words in ("~n", ""), ("/plates", "; .* `rosparam delete /plates`"), (
                "~m", "; .* `rosparam delete %s`" % rospy.get_name()):
            cache.set(rospy.resolve_name(name), "abc")
            with arguments("_n:=abc"), self.assertRaisesRegex(ValueError, "must be a whole number%s$" % words):
                robust.get_param(name, 1)

    def test_parameter_without_value_and_default_is_a_key_error_and_asked_for_unless_it_can_only_be_an_argument(self):
        for name, rospy.core._client_ready, error in (  # an OSError of the master that is asked
                ("~n", False, KeyError), ("~n", True, OSError), ("/n", False, OSError), ("/n", True, OSError)):
            with arguments("_m:=1"), self.assertRaises(error):
                robust.get_param(name)

    def test_port_that_is_none_is_named(self):
        for port in 70000, "11311":
            with self.assertRaisesRegex(rospy.ROSInitException, "^tcpros_port is %r: " % port):
                peers.check_port("tcpros_port", port)


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_start", StartUnits)
