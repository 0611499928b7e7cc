#!/usr/bin/python3
"""robust in programs that it does not know: what works on rospy works there, and the process stays the program's."""
import contextlib
import glob
import os
import signal
import socket
import time
import unittest

import pexpect
import rostest

from scenes import SLACK, check_quiet, concurrently
from processes import Master, bound_socket, eventually

# What the programs here begin with. state() waits a moment: what ends a node does so within 0.1 s.
HEAD = """
import asyncio, atexit, ctypes, faulthandler, io, logging, multiprocessing, os, psutil, random, signal, sys
import threading, time
from actions_tutorial import robust
import actionlib, rosgraph, rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from actionlib_msgs.msg import GoalID, GoalStatus

def so(condition, seconds=10):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()

def state():
    return "down" if so(rospy.is_shutdown, 0.7) else "up"

def send(*names):
    for name in names:
        os.kill(os.getpid(), getattr(signal, "SIG" + name))

def outcome(call, *arguments):
    try:
        return call(*arguments)
    except BaseException as error:
        return repr(error)

def pair(execute, library=robust):
    server = library.SimpleActionServer("work", TestAction, execute, True)
    client = robust.SimpleActionClient("work", TestAction)
    client.wait_for_server()
    if library is actionlib:
        server.action_server.status_timer.shutdown()  # which may beat into closed topics, with a traceback
    return server, client
"""
INIT = HEAD + "robust.init_node('guest', log_level=rospy.WARN)\n"
# For programs that do not try how soon a node ends: a busy machine is late.
PATIENT = "robust.shutdown.KILLED_AFTER = robust.shutdown.CLOSED_WITHIN = 20\n"


def program(master, code, head=INIT, **options):
    """Start a program in a namespace of its own, whose lines of log have no times. -> Process"""
    return master.start("/usr/bin/python3", "-c", head + code, **dict({
        "PYTHONUNBUFFERED": "1", "ROSCONSOLE_FORMAT": "[${severity}] ${message}",
        "ROS_NAMESPACE": "/guest_%d" % len(master.processes)}, **options))


def ready(*arguments, **options):
    """Start a program as program() does, and wait until it says that it is ready. -> Process"""
    node = program(*arguments, **options)
    node.expect("ready")
    return node


def log_file(master):
    """Returns all that the node guest has written to its log file."""
    written, = glob.glob(os.path.join(master.env["ROS_LOG_DIR"], "*guest*.log"))
    with open(written) as file:
        return file.read()


@concurrently(Master, at_once=4)
class Guest(unittest.TestCase):

    def says(self, master, code, *lines, status=0, quiet=True, head=INIT, **options):
        """A program ends with this exit status, without a traceback if quiet, when it has printed these lines (str). It
        may be slow to end, unless it sets the bounds itself. -> Process"""
        node = program(master, code, head and head + PATIENT, **options)
        self.assertEqual(status, node.wait(), node)
        self.assertEqual(list(lines), node.stdout.splitlines(), node)
        if quiet:
            check_quiet(node)
        return node

    def ends(self, *nodes, status=0):
        """The nodes (Process), which have just been told to, end with this exit status within 2 s."""
        begun = time.monotonic()
        self.assertEqual([status] * len(nodes), [node.wait() for node in nodes], nodes[-1])
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "s until the end of %s" % nodes[-1])

    def test_import_and_init_node_leave_the_process_as_it_was(self, master):
        self.says(master, """
import atexit, logging, os, random, signal, sys, threading
import actionlib, rospy

def process():
    return {
        "signals": ([signal.getsignal(number) for number in signal.valid_signals()], signal.set_wakeup_fd(-1)),
        "excepthook": sys.excepthook, "hooks": (sys.unraisablehook, threading.excepthook), "argv": list(sys.argv),
        "atexit": atexit._ncallbacks(), "streams": (sys.stdout, sys.stderr), "random": random.getstate(),
        "logging": (dict(vars(logging.Handler)), logging.getLoggerClass()), "handlers": list(logging.root.handlers),
        "complaints": logging.raiseExceptions, "threads": threading.enumerate(), "files": os.listdir("/proc/self/fd"),
        "Thread": dict(vars(threading.Thread)),
        "libraries": (dict(vars(actionlib.SimpleActionServer)), rospy.init_node, rospy.get_param,
                      rospy.core.configure_logging)}

before = process()
from actions_tutorial import robust
print([name for name, what in process().items() if what != before[name]])
before["excepthook"] = sys.excepthook = lambda kind, *_: print("mine:", kind.__name__)
robust.init_node("guest")
print([name for name, what in process().items() if what != before[name] and name not in (
    "signals", "atexit", "streams", "handlers", "threads", "files", "Thread")])
raise ValueError
""", "[]", "[]", "mine: ValueError", head="", status=1)

    def test_signals_that_the_program_handles_leave_the_node_up(self, master):
        for before, after in (["USR1", "ALRM", "CHLD", "HUP"], []), ([], ["INT", "USR1", "HUP"]):
            node = self.says(master, """
def hear(names):
    for name in names:
        signal.signal(getattr(signal, "SIG" + name), lambda *_, name=name: print(name, state()))

faulthandler.register(signal.SIGUSR2)
hear({0})
robust.init_node("guest")
hear({1})
send(*{0}, *{1}, "USR2")
print(state())
send("TERM")
rospy.spin()
""".format(before, after), *(name + " up" for name in before + after), "up", head=HEAD)
            self.assertIn("most recent call first", node.stderr, node)

    def test_handler_that_was_there_before_is_called_when_the_node_is_down(self, master):
        for name in "TERM", "INT":
            for code, status in ("None", 0), ("sys.exit(3)", 3), ("signal.default_int_handler(2, None)", 0):
                self.says(master, """
signal.signal(signal.SIG{0}, lambda *_: [print("motors off", rospy.is_shutdown()), {1}])
robust.init_node("guest")
rospy.on_shutdown(lambda: print("hook", time.sleep(0.3)))
send("{0}")
so(rospy.is_shutdown, 30)
""".format(name, code), "hook None", "motors off True", status=status, head=HEAD)

    def test_hooks_run_in_the_main_thread_which_drives_on_after_them_only_and_goals_end_meanwhile(self, master):
        """As with rospy; and what a hook sends is not cancelled with the goals from before."""
        self.says(master, """
robust.shutdown.HEARD_WITHIN = 20

def end():
    so(lambda: client.get_state() == GoalStatus.ABORTED)
    print(threading.current_thread().name, client.get_state(), rospy.is_shutdown())
    client.send_goal(TestGoal(1))  # such as to park an arm
    print(client.wait_for_result(0.3), len(cancels))
    over.set()
    other = threading.Thread(target=lambda: print(outcome(client.send_goal, TestGoal(1))))
    other.start()
    other.join()

over = threading.Event()
server, client = pair(lambda goal: over.wait(20) if goal.goal else so(lambda: server.is_preempt_requested()), actionlib)
client.send_goal(TestGoal(0))
so(server.is_active)
cancels = []
rospy.Subscriber("work/cancel", GoalID, cancels.append)
rospy.on_shutdown(end)
threading.Timer(0.2, send, ["INT"]).start()
while not rospy.is_shutdown():
    signal.pause()
print("main")
sys.exit(3)
""", "MainThread 4 False", "False 1",
                  "ROSInitException('the node was shut down before it sent its goal')", "main", status=3)

        self.says(master, """
rospy.on_shutdown(lambda: print(robust.shutdown.hooks_thread == threading.get_ident()))  # known at the first hook
robust.init_node("guest")
rospy.signal_shutdown("")
""", "True", head=HEAD)

    def test_loop_that_sends_goals_in_turn_ends_with_the_node_and_a_goal_that_does_so_ends_itself(self, master):
        """What they wait for ends a moment before rospy.is_shutdown()."""
        for told in 'send("INT")', 'rospy.signal_shutdown("battery low")':
            self.says(master, """
robust.shutdown.GOALS_END_WITHIN, robust.shutdown.HELD_FOR, robust.shutdown.SENT_WITHIN = 10, 0, 0.5
def pass_on(goal):
    while not outer.is_preempt_requested():
        inner.send_goal(TestGoal())
        inner.wait_for_result()
    outer.set_preempted(TestResult(7))

server, inner = pair(lambda goal: so(server.is_preempt_requested, 20), actionlib)
outer = robust.SimpleActionServer("outer", TestAction, pass_on, True)
client = robust.SimpleActionClient("outer", TestAction)
client.wait_for_server()
threading.Timer(0.2, lambda: so(server.is_active) and %s).start()
while not rospy.is_shutdown():
    client.send_goal(TestGoal())
    print(client.wait_for_result(), client.get_result().result)
""" % told, "True 7")

    def test_goal_whose_end_needs_the_main_thread_has_its_result_and_main_wakes_from_pause_when_the_node_is_down(
            self, master):
        self.says(master, """
robust.shutdown.GOALS_END_WITHIN = 10
server, client = pair(None)
server.register_goal_callback(lambda: None)
client.send_goal(TestGoal())
so(server.is_new_goal_available)
server.accept_new_goal()
threading.Timer(0.2, send, ["INT"]).start()
while server.rate(5).sleep():
    pass
server.set_preempted(TestResult(7))
print(client.wait_for_result(10), client.get_result().result)
""", "True 7")
        self.says(master, """
server, client = pair(lambda _: so(rospy.core.is_shutdown_requested) and time.sleep(0.5))
client.send_goal(TestGoal())
so(server.is_active)
send("INT")
while not rospy.is_shutdown():
    signal.pause()
sys.exit(3)
""", status=3)

    def test_signal_ends_the_node_whatever_became_of_the_wake_up_descriptor_which_hears_of_nothing_else(self, master):
        none = "BlockingIOError(11, 'Resource temporarily unavailable')"
        for code, end, heard in (("", "read", "{15}"), ("os.close(write)", "other[0]", none),
                                 ("os.close(read)", "other[0]", none)):
            self.says(master, """
other, (read, write) = os.pipe2(os.O_NONBLOCK), os.pipe2(os.O_NONBLOCK)
signal.set_wakeup_fd(write)
robust.init_node("guest")
%s
send("TERM")
rospy.spin()
print(outcome(lambda: set(os.read(%s, 9))))
""" % (code, end), heard, head=HEAD)

    def test_handlers_of_asyncio_and_of_the_node_do_not_take_signals_from_each_other(self, master):
        for head in HEAD, INIT:
            self.says(master, """
async def main():
    heard, stopped, loop = asyncio.Event(), asyncio.Event(), asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGUSR1, heard.set)
    if not rospy.core.is_initialized():
        loop.add_signal_handler(signal.SIGTERM, stopped.set)
        robust.init_node("guest")
    send("USR1")
    await asyncio.wait_for(heard.wait(), 10)
    print("heard", state())
    send("TERM")
    while not (rospy.is_shutdown() or stopped.is_set()):
        await asyncio.sleep(0.02)
    print("stopped")

asyncio.run(main())
""", "heard up", "stopped", head=head)

    def test_ctrl_c_with_disable_signals_is_python_s(self, master):
        self.says(master, "robust.init_node('guest', disable_signals=True)\nprint(outcome(send, 'INT'), state())\n"
                          "threading.Timer(0.5, send, ['INT']).start()\nrospy.spin()\nprint(state())",
                  "KeyboardInterrupt() up", "down", head=HEAD)

    def test_ctrl_c_at_python_s_prompt_or_its_debugger_s_and_before_it_ends_the_node_and_not_the_prompt(self, master):
        code = "import os, rospy, time; from actions_tutorial import robust; robust.init_node('guest'); " \
               "os.write(1, b're' + b'ady')"  # not by print, in which a debugger would stop
        env = dict(os.environ, HOME=master.home, PYTHON_BASIC_REPL="1", **master.env)  # a prompt writes its history
        wrong = "import rospy; from actions_tutorial import robust; robust.init_node('guest', ['', 'a:=b:=c'])"
        with open(os.path.join(master.home, "debugged.py"), "w") as debugged:
            debugged.write(code + "\nwhile True:\n    time.sleep(0.1)")
        for shown, typed, *arguments in (
                ("ready", [wrong, code]), ("ready", [], "-i", "-c", code + "; rospy.spin()"),
                ("ready.*[(]Pdb", [], "-c", code + "; breakpoint()"),
                ("ready", [], "-m", "pdb", "-c", "continue", debugged.name)):
            with contextlib.closing(pexpect.spawn("/usr/bin/python3", arguments, env=env)) as prompt:
                for line in typed:
                    prompt.sendline(line)
                prompt.expect("(?s)" + shown)
                prompt.sendintr()
                prompt.sendline("time.sleep(3); 'down: %s' % rospy.is_shutdown()")
                prompt.expect("down: True")
                prompt.kill(signal.SIGKILL)  # close() has 0.1 s for that
                prompt.wait()

    def test_children_that_end_leave_node_goals_and_topics_and_are_heard(self, master):
        """Each line: exit status, node, goal, and whether the master knows all topics. One child is forked by the
        goal's callback, the next while a line is written to the log file."""
        kept = "up ACTIVE True"
        node = self.says(master, """
def execute(goal):
    child = os.fork()
    if not child:
        sys.exit()
    print(psutil.Process(child).wait(20))
    forked.set()
    so(lambda: done.is_set() or server.is_preempt_requested(), 300)
    (server.set_preempted if server.is_preempt_requested() else server.set_succeeded)()

def write_slowly(text):
    with lock:
        writes.set()
        time.sleep(0.05)
        write(text)

def speak():
    print("child prints")
    rospy.logwarn("child logs")

def speak_in_vain():
    os.dup2(os.open("/dev/full", os.O_WRONLY), 1)
    thread = threading.Thread(target=outcome, args=[print])
    thread.start()
    thread.join()

def work():
    speak()
    started.set()
    time.sleep(60)

def report(status):
    known = rosgraph.Master("/test").getSystemState() == before
    print(status, state(), GoalStatus.to_string(client.get_state()), known)

from actions_tutorial.msg import WashTheDishesGoal
signal.signal(signal.SIGHUP, print)
fork, spawn = map(multiprocessing.get_context, ("fork", "spawn"))
done, started, forked, writes, lock = (
    threading.Event(), fork.Event(), threading.Event(), threading.Event(), threading.Lock())
server, client = pair(execute)
client.send_goal(TestGoal())
so(lambda: forked.is_set() and client.get_state() == GoalStatus.ACTIVE)
before = rosgraph.Master("/test").getSystemState()
file, = (one.stream for one in logging.getLogger().handlers if hasattr(one, "baseFilename"))
write, file.write = file.write, write_slowly
rospy.logwarn("parent logs")
writes.wait()
child = os.fork()
if not child:
    speak()
    robust.log.flush = print  # as a node's end would do
    sys.exit(3 if signal.getsignal(signal.SIGHUP) is print else "no handler")
report(os.waitpid(child, 0)[1] >> 8)
for child, is_ready in (
        (fork.Process(target=speak), None), (fork.Process(target=speak_in_vain), None),
        (spawn.Process(target=WashTheDishesGoal), None),  # finds the messages beside the modules
        (fork.Process(target=work), started.is_set),
        # A signal before the exec is lost, whoever has a handler for it (until Python 3.10). Until then the arguments
        # are this program's.
        (spawn.Process(target=time.sleep, args=[60]),
         lambda: "--multiprocessing-fork" in psutil.Process(child.pid).cmdline())):
    child.start()
    if is_ready:
        so(is_ready)
        child.terminate()
    child.join(10)
    report(child.exitcode)
for _ in range(30):  # before they have taken their first step
    child = fork.Process(target=time.sleep, args=[60])
    child.start()
    child.terminate()
    child.join(10)
report(child.exitcode)
rospy.logwarn("parent logs on")
so(lambda: not robust.log._others)
done.set()
client.wait_for_result(rospy.Duration(10))
print(GoalStatus.to_string(client.get_state()))
rospy.signal_shutdown("done")
""", "0", "child prints", "3 " + kept, "child prints", *["0 " + kept] * 3, "child prints",
                         *["-15 " + kept] * 3, "SUCCEEDED")
        self.assertEqual(3, node.stderr.count("[WARN] child logs\n"), node)
        self.assertEqual(3, log_file(master).count("child logs"), node)
        self.assertIn("parent logs on", log_file(master), node)
        self.assertNotIn("cannot write to stdout", node.stderr, node)

    def test_child_that_is_forked_while_the_node_ends_has_no_part_in_that(self, master):
        self.says(master, "send('TERM')\nso(rospy.core.is_shutdown_requested)\nif not os.fork():\n"
                          "    robust.log.flush = print\n    sys.exit(3)\nprint(os.wait()[1] >> 8)", "3")

    def test_server_made_before_init_node_by_a_subclass_with_its_own_ways_is_served_and_named(self, master):
        node = program(master, """
class Own(robust.SimpleActionServer):
    def accept_new_goal(self):
        self.taken_up = super().accept_new_goal()

    def execute(self, _):
        (self.set_succeeded if self.taken_up.goal else self.set_aborted)()

server = Own("~work", TestAction, lambda goal: server.execute(goal), False)
robust.init_node("guest")
server.start()
client = robust.SimpleActionClient("~work", TestAction)
client.wait_for_server()
print("ends", client.send_goal_and_wait(TestGoal(1)))
rospy.signal_shutdown("done")
""", head=HEAD, PYTHONUNBUFFERED="")  # with it a print is two writes, and a line of log may come between them
        self.assertEqual(0, node.wait(), node)
        self.assertIn("\nends 3\n", node.stdout)
        self.assertIn("/guest/work waits for goals\n", node.stdout)

    def test_stubborn_node_ends_within_2_s_of_a_signal_of_many_and_of_rosnode_kill(self, master):
        stubborn = ("print('ready')\nwhile True:\n    time.sleep(1)",
                    "print('ready')\nlock = bytes(64)\nwhile True:\n    ctypes.CDLL(None).pthread_mutex_lock(lock)",
                    "print('ready')\nthreading.Thread(target=threading.Event().wait).start()\nrospy.spin()",
                    "rospy.on_shutdown(threading.Event().wait)\nprint('ready')\nrospy.spin()")
        for number in signal.SIGTERM, signal.SIGINT, signal.SIGHUP, None:
            first = len(master.processes)
            nodes = [ready(master, code) for code in stubborn]
            if number:
                for node in nodes:
                    node.signal(number)
            else:  # not -a: the master still knows those that were killed, whose ports may be others' by now
                master.start("rosnode", "kill", *("/guest_%d/guest" % (first + i) for i in range(len(nodes))))
                for node in nodes:
                    node.expect("shutdown request")
            self.ends(*nodes)
        node = ready(master, stubborn[0])
        eventually(lambda: node.signal(signal.SIGTERM) or not node.running(), "an end", node, timeout=2 + SLACK,
                   pause=0.2)

    def test_exit_status_of_a_stubborn_node_is_1_while_it_starts_and_unless_its_goal_has_succeeded(self, master):
        for step in "node._rospy_init_node", "log.ask_the_master_once":
            node = ready(master, "robust.%s = lambda *_, **__: print('ready') or threading.Event().wait()\n"
                                 "robust.init_node('guest')" % step, head=HEAD)
            node.signal(signal.SIGTERM)
            self.ends(node, status=1)
        for goals, status in ([], 0), ([0, 0], 0), ([0, 1], 1), ([0, 2], 1):
            node = ready(master, """
server, client = pair(lambda goal: (server.set_succeeded, threading.Event().wait, server.set_aborted)[goal.goal](),
                      actionlib)
for goal in %r:
    client.send_goal(TestGoal(goal))
    assert so(lambda: client.get_state() == (GoalStatus.SUCCEEDED, GoalStatus.ACTIVE, GoalStatus.ABORTED)[goal])
print("ready")
threading.Event().wait()
""" % goals)
            node.signal(signal.SIGTERM)
            self.ends(node, status=status)

    def test_functions_of_atexit_find_the_node_up_and_the_exit_status_stays_however_long_the_end_takes(self, master):
        up = "atexit.register(lambda: print(state()))\n"
        for code, *lines in (
                (up + "robust.init_node('guest')\n" + up, "up", "up"),
                ("robust.shutdown.KILLED_AFTER = 0.1\nrobust.init_node('guest')\n"
                 "rospy.on_shutdown(lambda: [time.sleep(2), print('parked')])\n", "parked"),
                ("robust.init_node('guest')\nrospy.on_shutdown(lambda: [time.sleep(1), print('parked')])\n"
                 "send('TERM')\nso(rospy.core.is_shutdown_requested)\n", "parked"),
                ("robust.shutdown.CLOSED_WITHIN = 1.5\nrobust.init_node('guest')\n"
                 "rospy.on_shutdown(threading.Event().wait)\n"
                 "threading.Thread(target=rospy.signal_shutdown, args=[''], daemon=True).start()\n"
                 "so(rospy.core.is_shutdown_requested)\ntime.sleep(1)\n",),
                ("robust.shutdown.KILLED_AFTER = 4\natexit.register(time.sleep, 4)\nrobust.init_node('guest')\n"
                 "send('TERM')\nrospy.spin()\n",),
                ("robust.shutdown.KILLED_AFTER = 3\natexit.register(time.sleep, 4)\n"
                 "robust.init_node('guest', log_level=rospy.WARN)\n"
                 "server, client = pair(lambda _: so(rospy.core.is_shutdown_requested) and time.sleep(0.5))\n"
                 "client.send_goal(TestGoal())\nso(server.is_active)\nsend('TERM')\n",),
                ("robust.shutdown.CLOSED_WITHIN = 1.5\nrobust.init_node('guest')\n"
                 "os.kill(rosgraph.Master('').getPid(), signal.SIGSTOP)\nsend('TERM')\nrospy.spin()\n",)):
            self.says(master, code + "sys.exit(7)", *lines, status=7, head=HEAD)

    def test_program_that_goes_on_after_its_node_keeps_its_time_its_processor_and_its_exit_status(self, master):
        self.says(master, "robust.shutdown.KILLED_AFTER = 1\nrospy.signal_shutdown('')\n"
                          "before = time.process_time()\ntime.sleep(3)\n"
                          "sys.exit(7 if time.process_time() - before < 1 else 'a busy end')", status=7)
        suite = os.path.join(master.home, "suite_test.py")
        with open(suite, "w") as file:
            file.write(HEAD + "def test():\n    robust.init_node('suite')\n    rospy.signal_shutdown('')\n"
                              "    time.sleep(3)\n    assert False\n")
        node = master.start("/usr/bin/python3", "-m", "pytest", "-p", "no:cacheprovider", suite)
        self.assertEqual(1, node.wait(), node)

    def test_start_that_fails_for_whatever_reason_is_one_line(self, master):
        starts = "the node guest cannot start: "
        with socket.create_server(("", 0)) as taken:
            port = taken.getsockname()[1]
            for before, arguments, reason in (
                    ("", ", log_level=7", starts + r"KeyError\(7\)"),
                    ("", ", argv=['', '_p:=[1']", starts + r"invalid command-line parameters: .*\[1.*"),
                    ("", ", tcpros_port=%d" % port, "tcpros_port is %d: .*in use" % port),
                    ("", ", xmlrpc_port=%d" % port, "xmlrpc_port is %d: .*in use" % port),
                    ("os.environ['ROS_MASTER_URI'] = 'http://localhost:1'\n"
                     "robust.node.get_params = lambda _: send('INT') or ()", "",
                     "interrupted while waiting for the master http://localhost:1")):
                node = self.says(master, "%s\nrobust.init_node('guest'%s)" % (before, arguments), status=1, head=HEAD)
                self.assertRegex(node.stderr, "^%s\n$" % reason, node)

    def test_node_whose_parameter_is_wrong_is_one_still_for_a_program_that_goes_on(self, master):
        self.says(master, """
rosgraph.Master("/test").setParam(rospy.get_namespace() + "guest/n", "abc")
print(outcome(lambda: robust.init_node("guest", parameters={"~n": (7, 0, 9)})))
send("TERM")
print(state())
""", "SystemExit(2)", "down", head=HEAD)

    def test_node_starts_on_ipv6_with_ports_of_its_own_choice(self, master):
        if not os.path.exists("/proc/net/if_inet6"):
            self.skipTest("this machine has no IPv6")
        with bound_socket() as one, bound_socket() as other:
            ports = one.getsockname()[1], other.getsockname()[1]
            self.says(master, "robust.init_node('guest', xmlrpc_port=%d, tcpros_port=%d)\n"
                              "print(rospy.get_node_uri().split(':')[-1], "
                              "rospy.impl.tcpros_base.get_tcpros_server_address()[1])" % ports,
                      "%d/ %d" % ports, head=HEAD, ROS_IPV6="on")

    def test_client_made_before_init_node_leaves_the_port_to_that_and_is_served_beside_a_silent_peer(self, master):
        for library_of_client, library_of_node in ("robust", "rospy"), ("actionlib", "robust"):
            with bound_socket() as one:
                self.says(master, """
client = {1}.SimpleActionClient("work", TestAction)
{2}.init_node("guest", tcpros_port={0})
client.wait_for_server(rospy.Duration(-1))
silent = socket.create_connection(("localhost", {0}))
server = actionlib.SimpleActionServer("work", TestAction, auto_start=True)
print(client.wait_for_server(rospy.Duration(20)), flush=True)
os._exit(0)
""".format(one.getsockname()[1], library_of_client, library_of_node), "True", head="import socket\n" + HEAD)

    def test_init_node_and_get_param_of_rospy_and_robust_mix(self, master):
        self.says(master, """
def case(*calls):
    if not os.fork():
        said = [str(outcome(call)).partition(" has already")[0] for call in calls]
        sys.exit(print(*said[1:], state()))
    assert os.wait()[1] == 0

for one, other in (rospy, robust), (robust, rospy):
    for name, disabled in ("x", False), ("x", True), ("y", False):
        case(lambda: one.init_node("x", None, False, None, False, False, disabled),
             lambda: other.init_node(name, disable_signals=disabled))
case(lambda: robust.init_node("x"), lambda: robust.init_node("x", parameters={"~n": (7, 0, 9)}),
     lambda: rospy.set_param("~k", [1]),  # a type that is none of ROS's checks nothing
     *(lambda name=name, default=default: robust.get_param(name, default)
       for name in ("~k", "~m") for default in (None, (1, 2))))
rospy.init_node, rospy.get_param = robust.init_node, robust.get_param
case(lambda: rospy.init_node("x"), lambda: rospy.init_node("x"), lambda: rospy.get_param("~n", 7))
sys.argv.append("_n:=abc")
case(lambda: robust.init_node("x"), lambda: robust.get_param("~n", 7))
""", *["() up"] * 2, 'ROSException("rospy.init_node() up', *["None up"] * 2, 'ROSException("rospy.init_node() up',
                  "(7,) None [1] [1] None (1, 2) up", "() 7 up",
                  "abc up", head=HEAD,
                  quiet=False)  # Debian 11's rospy, where it is not ours, ends with a traceback

    def test_client_and_server_of_a_node_do_without_the_master_but_not_without_the_node(self, master):
        """And they take no random numbers from the program, and leave no files open, of which Python would warn. A goal
        that has ended is the current one until the next is accepted, also of a server that was started again, as
        actionlib's can be; one that was stopped ends without a word."""
        node = self.says(master, """
def execute(goal):
    mine = server.current_goal.get_goal_id().id
    server.set_succeeded()
    if goal.goal:
        so(server.is_new_goal_available)
        with server.action_server.lock:  # until it has been taken in
            print(server.current_goal.get_goal_id().id == mine)

random.seed(1)
server = robust.SimpleActionServer("work", TestAction, execute, True)
server.action_server.stop()
server.action_server.start()
client, idle = [robust.SimpleActionClient("work", TestAction) for _ in range(2)]
client.wait_for_server()
print([client.send_goal_and_wait(TestGoal(more)) for more in (1, 0)])
print(random.random() == random.Random(1).random())
os.kill(rosgraph.Master("").getPid(), signal.SIGKILL)
so(lambda: not rosgraph.is_master_online())
print(client.wait_for_server(10), outcome(robust.SimpleActionClient, "/other", TestAction).partition(":")[0])
server.action_server.stop()
rospy.signal_shutdown("done")
print(outcome(client.send_goal, TestGoal()))
""", "True", "[3, 3]", "True", "True CannotStart('the client of /other cannot start",
                         "CannotStart('the node was shut down before it sent its goal')", PYTHONWARNINGS="default")
        self.assertNotIn("/robust/internals.py", node.stderr, node)

    def test_threads_are_as_many_as_the_reference_says(self, master):
        self.says(master, """
def count():  # those that stay
    return min(threading.active_count() for _ in range(20) if not time.sleep(0.05))

alone = count()
servers = [robust.SimpleActionServer(name, TestAction, lambda goal: so(rospy.is_shutdown), True) for name in ("a", "b")]
serving = count()
client = robust.SimpleActionClient("a", TestAction)
client.wait_for_server()
idle = count()
for _ in range(3):
    client.send_goal(TestGoal())
busy = count()
print(alone <= 8 and serving - alone <= 2 * 2 and busy - idle <= 1 or (alone, serving, idle, busy))
rospy.signal_shutdown("done")
""", "True")

    def test_stdout_that_cannot_be_written_is_said_once_and_ends_the_node(self, master):
        for code, status in ("print('x')\ntime.sleep(60)", 1), (
                "threading.Thread(target=lambda: [print('x') for _ in range(3)]).start()\nrospy.spin()", 0):
            with open("/dev/full", "w") as full:
                node = program(master, code, stdout=full)
            self.assertEqual((status, 1), (node.wait(), node.stderr.count("cannot write to stdout")), node)

    def test_log_that_the_program_has_configured_stays_and_complains_of_nothing_while_a_node_starts(self, master):
        configuration = os.path.join(master.home, "log.yaml")
        with open(configuration, "w") as file:
            file.write("{version: 1, disable_existing_loggers: false, handlers: {own: {class: __main__.Own}},"
                       " root: {level: INFO, handlers: [own]}}")
        self.says(master, """
class Own(logging.Handler):
    def emit(self, line):
        if line.name in ("rospy.client", "rosout"):
            print(line.name, logging.raiseExceptions, "emit" in vars(self))

earlier = logging.StreamHandler(io.StringIO())
logging.getLogger("rosout").addHandler(earlier)
robust.init_node("guest")
rospy.logwarn("a bowl")
print("emit" in vars(earlier))
""", "rospy.client False False", "rosout True False", "False", head=HEAD, ROS_PYTHON_LOG_CONFIG_FILE=configuration)

    def test_lines_stand_in_the_order_in_which_they_were_printed_and_logged_and_all_are_in_the_log_file(self, master):
        node = program(master, """
robust.shutdown.LOG_WITHIN, robust.log._others._pause = 20, 1  # s; the program's end comes sooner
stdout = sys.stdout
print("first")
robust.init_node("guest")
child = os.fork()
if not child:
    print("child prints")
    rospy.loginfo("logs")
    print("prints")
    sys.exit()
os.waitpid(child, 0)
print("second")
print("through the stream from before", file=stdout)
rospy.loginfo("%(what)s", {"what": "with a dict"})
for number in range(10):
    rospy.loginfo(str(number) * (2500 >> number % 2 * 9))
for number in range(400):
    rospy.loginfo("line %d!", number)  # 1000 may wait, and each goes to two handlers
sys.stdout = io.TextIOWrapper(sys.stdout.buffer)
print("through another stream")
""", head=HEAD, ROSCONSOLE_FORMAT="${message}", PYTHONUNBUFFERED="")
        self.assertEqual(0, node.wait(), node)
        self.assertEqual(["f", "c", "l", "p", "s", "t", "w", *"0123456789", *"l" * 400, "t"],
                         [line[0] for line in node.stdout.splitlines()], node)
        self.assertIn("line 399!", log_file(master), node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "guest", Guest)
