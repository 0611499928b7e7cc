#!/usr/bin/python3
"""The log and stdout of a node, without a node."""
import contextlib
import functools
import io
import logging
import os
import re
import signal
import sys
import threading
import time
import weakref
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import rospy
import rosunit
from rosgraph.roslogging import LoggingException, RosStreamHandler

from actions_tutorial.robust import log, shutdown, stdout
from processes import eventually
from units import UnitCase, closer


def record(*line):
    """A logging.LogRecord of arguments of rospy.loginfo."""
    return logging.LogRecord("rosout", logging.INFO, "file", 1, line[0], line[1:], None)


class LogUnits(UnitCase):

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
            with mock.patch.dict("os.environ", ROSCONSOLE_FORMAT="mine"), mock.patch.object(log, "_usual", []) as none:
                log.hold_nobody_up([RosStreamHandler(), logging.NullHandler()])
            for number, other in enumerate((
                    mock.patch.object(log, "_usual", none), mock.patch.object(terminal, "level", 30),
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
        self.assertEqual(["a plate"] * 3, said)

    def test_line_waits_for_a_stream_that_takes_none_and_where_none_can_be_asked_for_none(self):
        handler, (read, full) = mock.Mock(handleError=self.fail), os.pipe2(os.O_NONBLOCK)
        with open(read, "rb"), io.TextIOWrapper(io.FileIO(full, "w"), write_through=True) as pipe, \
                mock.patch.object(log, "_terminal", mock.MagicMock()) as later:
            stream = log._Stream(pipe, handler)
            stream.write("a bowl")  # after those that wait
            self.assertEqual(1, later.call.call_count)
            later.__bool__.return_value = False
            stream.write("a bowl")
            self.assertEqual((b"a bowl", 1), (os.read(read, 99), later.call.call_count))
            stream.write("b" * log.AT_ONCE)  # which a pipe may not take
            self.assertEqual(2, later.call.call_count)
            os.write(full, bytes(1 << 20))
            stream.write("a bowl")
            self.assertEqual(3, later.call.call_count)
            for error in AttributeError, OSError, ValueError:
                other = mock.Mock(fileno=mock.Mock(side_effect=error))
                log._Stream(other, handler).write("a bowl")
                other.write.assert_called_once_with("a bowl")
            self.assertEqual(3, later.call.call_count)

    def test_line_stands_on_a_terminal_that_takes_it_when_the_call_returns(self):
        said, handler, ends = [], mock.Mock(handleError=self.fail), os.openpty()
        terminal = mock.Mock(fileno=lambda: ends[1], write=lambda text: (
            time.sleep(0.05), said.append((text, threading.current_thread() is threading.main_thread()))))
        self.assertIs(terminal.isatty, log._Stream(terminal, handler).isatty, "rospy has colours for a terminal")
        with mock.patch.multiple(log, _terminal=log._Caller(0), READ_WITHIN=30):
            log._Stream(terminal, handler).write("a bowl")
        self.assertEqual([("a bowl", False)], said)
        with mock.patch.object(threading.Thread, "start", side_effect=RuntimeError), \
                mock.patch.object(log, "_terminal", log._Caller(0)) as caller:
            log._Stream(terminal, handler).write("where no thread can be had")
            self.assertEqual((2, 0), (len(said), len(caller)))
            for _ in range(2 * log.WAITING):
                caller.call(print)
        self.assertEqual(log.WAITING, len(caller))
        for end in ends:
            os.close(end)

    def test_complaint_of_the_log_names_what_it_cannot_log_to_and_where_nobody_can_be_told_is_no_error(self):
        for stderr in None, *(mock.Mock(**{"write.side_effect": error}) for error in (OSError, ValueError)):
            with mock.patch.object(sys, "stderr", stderr):
                log._say_once(mock.Mock(), [], None)
        with contextlib.redirect_stderr(io.StringIO()) as said:
            for handler in mock.Mock(spec=[]), RosStreamHandler(), mock.Mock(baseFilename="/file"):
                log._say_once(handler, [], None)
        self.assertEqual(["/rosout", "the terminal", "/file"], re.findall("cannot log to (.+?): ", said.getvalue()))

    def test_handler_that_fails_says_so_once(self):
        full = mock.Mock(**{"write.side_effect": OSError("it is full"), "fileno.side_effect": OSError})
        handler, terminal = logging.FileHandler("/dev/null"), RosStreamHandler(stdout=full, stderr=full)
        sources = logging.getLogger("a library")
        with contextlib.redirect_stderr(io.StringIO()) as complaints, mock.patch.object(log, "_taken", []):
            log.hold_nobody_up([handler, terminal])
            sources.addHandler(handler)
            handler.setStream(io.StringIO()).close()
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

    def test_log_asks_the_master_once_and_puts_nothing_into_the_cache_of_parameters(self):
        cache = self.cache(rosout_disable_topics_generation=True, plates=3)
        log.ask_the_master_once()
        cache.delete("/rosout_disable_topics_generation")  # as if it had only asked
        self.assertEqual([True, True, 3], [cache.get(name) for name in (
            "/rosout_disable_topics_generation", "/rosout_disable_topics_generation", "/plates")])

    def test_log_that_cannot_be_set_up_is_said_and_goes_to_the_terminal(self):
        self.logged()  # which restores the level
        for error in OSError, ValueError, LoggingException:
            with mock.patch.object(logging.getLogger("rosout"), "handlers", []) as handlers, \
                    mock.patch.object(rospy.core, "_log_filename", None), \
                    contextlib.redirect_stderr(io.StringIO()) as said:
                log.configure(mock.Mock(side_effect=error("no folder")))
            self.assertEqual(("cannot set up the log: no folder\n", 1), (said.getvalue(), len(handlers)))

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
        for by_thread, name, value in (0, "msg", "a bowl"), (1, "msg", "\u4e8c" * 1000), \
                (1, "stack_info", "here\n" * 400), (1, "exc_info", (OSError, OSError("x" * 1600), None)):
            handler, line = RosStreamHandler(stdout=io.StringIO(), stderr=io.StringIO()), record("a bowl")
            line.levelno = logging.WARNING if name == "stack_info" else logging.INFO  # stderr, stdout
            line.args = None  # as logging.handlers.QueueHandler makes it
            setattr(line, name, value)
            with mock.patch.object(log, "_taken", []), mock.patch.object(
                    log, "_terminal", mock.MagicMock(__bool__=lambda caller: False)) as later:
                log.hold_nobody_up([handler])
                handler.emit(line)
            self.assertEqual(by_thread, later.call.call_count)

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


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_log", LogUnits)
