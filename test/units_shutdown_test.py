#!/usr/bin/python3
"""How a node ends, without a node."""
import contextlib
import io
import os
import signal
import socket
import sys
import threading
import time
import types
import weakref
from concurrent.futures import ThreadPoolExecutor
from unittest import mock

import rospy
import rosunit

from actions_tutorial.robust import log, rate, shutdown
from processes import eventually
from units import UnitCase, closer


class ShutdownUnits(UnitCase):

    def test_signals_that_nobody_gets_round_to_are_no_error(self):
        with closer() as one, mock.patch.object(sys, "unraisablehook") as complaint:
            for _ in range(2000):
                one.close()
            signal.raise_signal(signal.SIGTERM)
            self.assertFalse(one._hooks.locked(), "hooks run before there is a node")
        complaint.assert_not_called()

    def test_signal_that_comes_while_the_main_thread_has_a_server_s_lock_lets_it_go_on_and_comes_again(self):
        a_server = self.server().action_server
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
            for something in {}, {"unfinished": ["a goal"]}, {"servers": ["a server"]}:
                with mock.patch.object(time, "sleep") as sleep, mock.patch.multiple(
                        shutdown, **dict({"unfinished": []}, **something)):
                    rospy.core._client_shutdown_hooks[-1]()  # which waits for them, and for what they have sent
                sleep.assert_called_once_with(shutdown.SENT_WITHIN if something else 0.02)
            caller, called = log._Caller(0), threading.Event()
            caller.call(print)  # nor does the log fail
        caller.call(called.set)
        self.assertTrue(called.wait(30), "no word of the log since a thread was missing")
        self.assertCountEqual([server, other], ended)
        self.assertTrue(shutdown.aside(print).daemon)  # one that never ends does not hold up the program's end

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
        with mock.patch.object(shutdown, "aside", side_effect=lambda *_: one._mouth.close()) as aside, one._ears:
            one.run()
        aside.assert_called_once_with(one._shut_down, False)  # which is not to wait for a signal to be heard
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
        for thread in rospy.Timer.__new__(rospy.Timer), threading.Thread(target=print):
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
        begun = time.monotonic()
        for by_signal, heard, hooks in (
                (True, None, []), (False, None, [self.id]), (True, signal.SIGTERM, [self.id])):
            with closer() as one, mock.patch.multiple(shutdown, HEARD_WITHIN=0, HOOKS_WITHIN=60, KILLED_AFTER=0):
                rospy.core._in_shutdown = rospy.core._shutdown_flag = False
                rospy.core._client_shutdown_hooks[:] = [one._begin, *hooks]
                one._deadline, one._heard = time.monotonic(), heard
                one._shut_down(by_signal)
                self.assertLess(time.monotonic() - one._deadline, 30, "s, with nothing to wait for")
            self.assertTrue(rospy.is_shutdown())
        self.assertAlmostEqual(begun, shutdown._told_at, delta=30)

    def test_hooks_wait_for_a_main_thread_that_is_late_and_goals_have_less_time_then(self):
        def end_goal(_, deadline):
            ran.append(round(deadline - told, 1))

        ran = []
        with closer() as one, mock.patch.object(shutdown.Closer, "ident", 1), \
                mock.patch.object(shutdown, "HOOKS_WITHIN", 30), \
                mock.patch.object(shutdown, "wait_until", wraps=shutdown.wait_until) as wait_until:
            shutdown.at_end(types.MethodType(end_goal, self))
            rospy.on_shutdown(lambda: ran.append(threading.current_thread()))
            shutdown._told_at = told = time.monotonic() - 0.4
            thread = shutdown.aside(one._shut_down, True)
            eventually(lambda: wait_until.called, "a thread that waits")
            signal.raise_signal(signal.SIGTERM)
            thread.join()
        self.assertEqual((30, True), (wait_until.call_args_list[0][0][1], rospy.is_shutdown()))
        self.assertEqual({shutdown.GOALS_END_WITHIN, threading.main_thread()}, set(ran))

    def test_who_hears_of_a_goal_that_the_shutdown_ended_waits_for_that_but_hooks_and_goals_of_servers_do_not(self):
        for shutdown.hooks_thread, unended, waits in (
                (None, [], False), (threading.get_ident(), [], False), (-1, ["goal"], False), (-1, [], True)):
            with mock.patch.object(shutdown, "servers", {mock.Mock(**{"unended.return_value": unended})}), \
                    mock.patch.object(shutdown, "wait_until") as wait_until:
                shutdown.let_loops_see_it()
            self.assertEqual([mock.call(rospy.is_shutdown, 1)] * waits, wait_until.mock_calls,
                             (shutdown.hooks_thread, unended))


if __name__ == "__main__":
    rosunit.unitrun("actions_tutorial", "units_shutdown", ShutdownUnits)
