#!/usr/bin/python3
"""robust in programs that it does not know: what works on rospy works there, and the process stays the program's."""
import contextlib
import glob
import os
import pty
import re
import select
import signal
import socket
import struct
import time
import unittest

import pexpect
import rostest
from rosgraph.network import encode_ros_handshake_header

from scenes import SLACK, check_quiet, concurrently
from processes import Master, eventually

# What the programs here begin with. state() waits a moment: what ends a node does so within 0.1 s.
HEAD = """
import asyncio, contextlib, ctypes, faulthandler, io, multiprocessing, os, random, signal, sys, threading, time
from actions_tutorial import robust
import actionlib, psutil, rosgraph, rospy, unittest
from actionlib.msg import TestAction, TestGoal
from actionlib_msgs.msg import GoalStatus

def so(condition, seconds=10):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.02)
    return condition()

def state():
    return "down" if so(rospy.is_shutdown, 0.7) else "up"

def hear(*names):
    for name in names:
        signal.signal(getattr(signal, name), lambda number, _: print(signal.Signals(number).name))

def send(*names):
    for name in names:
        os.kill(os.getpid(), getattr(signal, name))
        print(state())
"""

# Prints what an import, and then an init_node, has changed that is not its own.
PROCESS = """
import atexit, logging, os, random, signal, sys, threading
import actionlib, rospy

def process():
    wakeup = signal.set_wakeup_fd(-1)
    signal.set_wakeup_fd(wakeup)
    return {
        "signals": [signal.getsignal(number) for number in signal.valid_signals()], "wake-up": wakeup,
        "excepthook": sys.excepthook, "hooks": (sys.unraisablehook, threading.excepthook), "argv": list(sys.argv),
        "atexit": atexit._ncallbacks(), "streams": (sys.stdout, sys.stderr), "random": random.getstate(),
        "logging": (dict(vars(logging.Handler)), logging.getLoggerClass()), "handlers": list(logging.root.handlers),
        "complaints": logging.raiseExceptions,
        "threads": threading.enumerate(), "files": os.listdir("/proc/self/fd"), "Thread": dict(vars(threading.Thread)),
        "libraries": (dict(vars(actionlib.SimpleActionServer)), rospy.init_node, rospy.get_param)}

before = process()
from actions_tutorial import robust
print([name for name, what in process().items() if what != before[name]])
robust.init_node("guest")
print([name for name, what in process().items() if what != before[name] and name not in (
    "signals", "wake-up", "excepthook", "atexit", "streams", "handlers", "threads", "files", "Thread")])
"""

# Children, while a goal is under way. Each line: exit status, node, goal, and whether the master knows all topics.
PARENT = """
def execute(goal):
    while not done.wait(0.02):
        if server.is_preempt_requested():
            return server.set_preempted()
    server.set_succeeded()

def speak():
    print("child prints")
    rospy.logwarn("child logs")

def work():
    speak()
    started.set()
    while not rospy.is_shutdown():
        time.sleep(0.02)

def report(status):
    known = rosgraph.Master("/test").getSystemState() == before
    print(status, state(), GoalStatus.to_string(client.get_state()), known)

robust.init_node("parent", log_level=rospy.WARN)
fork, spawn = map(multiprocessing.get_context, ("fork", "spawn"))
done, started = threading.Event(), fork.Event()
server = robust.SimpleActionServer("work", TestAction, execute, False)
server.start()
client = robust.SimpleActionClient("work", TestAction)
client.wait_for_server()
client.send_goal(TestGoal())
so(lambda: client.get_state() == GoalStatus.ACTIVE)
before = rosgraph.Master("/test").getSystemState()
child = os.fork()
if not child:
    speak()
    sys.exit(3)
report(os.waitpid(child, 0)[1] >> 8)
child = ctypes.PyDLL(None).fork()  # Python's hooks do not hear of it, as in a child of subprocess before its exec
if not child:
    signal.raise_signal(signal.SIGTERM)
    os._exit(4)
report(os.waitpid(child, 0)[1] >> 8)
for context, target, terminated in (fork, speak, False), (fork, work, True), (spawn, time.sleep, True):
    child = context.Process(target=target, args=[60] if context is spawn else [])
    child.start()
    if terminated:
        # A signal before the exec is lost, whoever has a handler for it (until Python 3.10). Until then the arguments
        # are this program's.
        execed = lambda: "--multiprocessing-fork" in psutil.Process(child.pid).cmdline()
        so(execed) if context is spawn else started.wait(10)
        child.terminate()
    child.join(10)
    report(child.exitcode)
done.set()
client.wait_for_result(rospy.Duration(10))
print(GoalStatus.to_string(client.get_state()))
rospy.signal_shutdown("done")
"""

# init_node before asyncio's handlers, or after them.
ASYNCIO = """
async def main():
    heard, stopped, loop = asyncio.Event(), asyncio.Event(), asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGUSR1, heard.set)
    if not rospy.core.is_initialized():
        loop.add_signal_handler(signal.SIGTERM, stopped.set)
        robust.init_node("guest")
    os.kill(os.getpid(), signal.SIGUSR1)
    await asyncio.wait_for(heard.wait(), 10)
    print("heard", state())
    while not (rospy.is_shutdown() or stopped.is_set()):
        await asyncio.sleep(0.02)
    print("stopped")
"""

SUITE = """
class Suite(unittest.TestCase):
    def test(self):
        robust.init_node("suite")
        rospy.signal_shutdown("done")
        time.sleep(3)
        self.fail()
"""

# Main programs that do not end by themselves.
STUBBORN = (
    "print('ready')\nwhile True:\n    time.sleep(1)",
    "print('ready')\nlock = bytes(64)\nwhile True:\n    ctypes.CDLL(None).pthread_mutex_lock(lock)",
    "print('ready')\nthreading.Thread(target=threading.Event().wait).start()\nrospy.spin()",
    "rospy.on_shutdown(threading.Event().wait)\nprint('ready')\nrospy.spin()",
)


def program(master, code, head=HEAD, **env):
    """Start a program in a namespace of its own, whose lines of log have no times. -> Process"""
    return master.start("/usr/bin/python3", "-c", head + code, **dict({
        "PYTHONUNBUFFERED": "1", "ROSCONSOLE_FORMAT": "[${severity}] ${message}",
        "ROS_NAMESPACE": "/guest_%d" % len(master.processes)}, **env))


@concurrently(Master, at_once=4)
class Guest(unittest.TestCase):

    def says(self, node, *lines, status=0):
        """The node (Process) ends with this exit status when it has printed these lines (str)."""
        self.assertEqual(status, node.wait(), node)
        self.assertEqual(list(lines), node.stdout.splitlines(), node)

    def ends(self, *nodes, status=0, tell=lambda *nodes: [node.signal(signal.SIGTERM) for node in nodes]):
        """The nodes (Process) end with this exit status within 2 s of tell(*nodes)."""
        tell(*nodes)
        begun = time.monotonic()
        self.assertEqual([status] * len(nodes), [node.wait() for node in nodes], nodes[-1])
        self.assertLess(time.monotonic() - begun, 2 + SLACK, "s until the end of %s" % nodes[-1])

    def is_up(self, node, *lines):
        """The node (Process) prints these lines (str), then SIGTERM ends it."""
        eventually(lambda: len(node.stdout.splitlines()) >= len(lines), "%d lines" % len(lines), node)
        self.ends(node)
        self.assertEqual(list(lines), node.stdout.splitlines(), node)

    def test_import_and_init_node_leave_the_process_as_it_was(self, master):
        self.says(program(master, "", PROCESS), "[]", "[]")

    def test_signals_that_the_program_handles_leave_the_node_up(self, master):
        for names, code in (
                (["SIGUSR1", "SIGALRM", "SIGCHLD", "SIGHUP"], "hear(*{0})\nrobust.init_node('guest')\nsend(*{0})"),
                (["SIGINT", "SIGUSR1", "SIGHUP"], "robust.init_node('guest')\nhear(*{0})\nsend(*{0})")):
            self.is_up(program(master, code.format(names) + "\nrospy.spin()"),
                       *(line for name in names for line in (name, "up")))
        node = program(master, "faulthandler.register(signal.SIGUSR1)\nrobust.init_node('guest')\nsend('SIGUSR1')\n"
                       "rospy.spin()")
        node.expect("most recent call first")
        self.is_up(node, "up")

    def test_handler_that_was_there_before_is_called_when_the_node_is_down(self, master):
        for name in "SIGTERM", "SIGINT":
            for code, status in ("None", 0), ("sys.exit(3)", 3), ("signal.default_int_handler(2, None)", 0):
                node = program(master, "signal.signal(signal.%s, lambda *_: [print('motors off', state()), %s])\n"
                               "robust.init_node('guest')\n"
                               "rospy.on_shutdown(lambda: print('hook', time.sleep(0.3)))\nprint('ready')\n"
                               "so(rospy.is_shutdown, 30)" % (name, code))
                node.expect("ready")
                node.signal(getattr(signal, name))
                self.says(node, "ready", "hook None", "motors off down", status=status)
                check_quiet(node)

    def test_main_program_hears_of_ctrl_c_before_the_hooks_have_run(self, master):
        node = program(master, """
robust.init_node("guest")
heard = threading.Event()
rospy.on_shutdown(lambda: print(heard.wait(1)))
print("ready")
while not rospy.core.is_shutdown_requested():
    time.sleep(0.02)
heard.set()
""")
        node.expect("ready")
        node.signal(signal.SIGINT)
        self.says(node, "ready", "True")

    def test_main_program_in_pause_goes_on_when_the_node_is_down(self, master):
        node = program(master, "robust.init_node('guest')\nprint('ready')\nwhile not rospy.is_shutdown():\n"
                       "    signal.pause()\nprint('motors off')\nsys.exit(3)")
        node.expect("ready")
        self.ends(node, status=3)
        self.assertIn("motors off", node.stdout, node)

    def test_signal_ends_the_node_though_the_wake_up_descriptor_of_the_program_is_closed(self, master):
        node = program(master, "import socket\n_, wake = socket.socketpair()\nwake.setblocking(False)\n"
                       "signal.set_wakeup_fd(wake.fileno())\nrobust.init_node('guest')\nwake.close()\nprint('ready')\n"
                       "rospy.spin()")
        node.expect("ready")
        self.ends(node)

    def test_handler_that_came_later_is_a_child_s_too(self, master):
        self.says(program(master, "robust.init_node('guest')\nsignal.signal(signal.SIGTERM, hear)\n"
                          "if not os.fork():\n    print(signal.getsignal(signal.SIGTERM) is hear)\n"
                          "    robust.log.flush = print\n    sys.exit()\nos.wait()\nrospy.signal_shutdown('')"), "True")

    def test_child_that_cannot_print_leaves_its_parent_up(self, master):
        self.says(program(master, "robust.init_node('guest')\nif not os.fork():\n"
                          "    os.dup2(os.open('/dev/full', os.O_WRONLY), 1)\n"
                          "    thread = threading.Thread(target=print)\n    thread.start()\n"
                          "    thread.join()\n    os._exit(0)\nos.wait()\nprint(state())\n"
                          "rospy.signal_shutdown('')"), "up")

    def test_more_signals_give_a_stubborn_node_no_more_time(self, master):
        node, = self.stubborn(master, STUBBORN[0])
        eventually(lambda: node.signal(signal.SIGTERM) or not node.running(), "an end", timeout=2 + SLACK, pause=0.2)

    def test_stubborn_start_is_ended_with_exit_status_1(self, master):
        node = program(master, "from actions_tutorial import robust\nrobust.init_node('guest')", head="""
import rospy, threading
rospy.init_node = lambda *_, **__: print("ready") or threading.Event().wait()
""")
        node.expect("ready")
        self.ends(node, status=1)

    def test_start_that_fails_for_whatever_reason_is_one_line(self, master):
        with socket.socket() as taken:
            taken.bind(("", 0))
            taken.listen(1)
            port = taken.getsockname()[1]
            for head, arguments, reason in (
                    ("rospy.init_node = lambda *_, **__: [].pop()", "",
                     "the node guest cannot start: pop from empty list"),
                    ("rospy.init_node = lambda *_, **__: {}['a']", "", "the node guest cannot start: KeyError('a')"),
                    ("", ", log_level=7", "the node guest cannot start: KeyError(7)"),
                    ("", ", argv=['', '_p:=[1']",
                     "the node guest cannot start: invalid command-line parameters: .*\\[1.*"),
                    ("", ", tcpros_port=%d" % port, "tcpros_port is %d: .*in use" % port),
                    ("", ", xmlrpc_port=%d" % port, "xmlrpc_port is %d: .*in use" % port)):
                node = program(master, "from actions_tutorial import robust\nrobust.init_node('guest'%s)" % arguments,
                               head="import rospy\n%s\n" % head)
                self.assertEqual(1, node.wait(), node)
                self.assertRegex(node.stderr, "^%s\n$" % (reason if ".*" in reason else re.escape(reason)), node)

    def test_node_starts_on_ipv6_with_ports_of_its_own_choice(self, master):
        if not os.path.exists("/proc/net/if_inet6"):
            self.skipTest("this machine has no IPv6")
        with socket.socket() as one, socket.socket() as other:
            for free in one, other:
                free.bind(("", 0))
            ports = [free.getsockname()[1] for free in (one, other)]
        self.says(program(master, "robust.init_node('guest', xmlrpc_port=%d, tcpros_port=%d)\n"
                          "print(rospy.get_node_uri().split(':')[-1], "
                          "rospy.impl.tcpros_base.get_tcpros_server_address()[1])" % tuple(ports),
                          ROS_IPV6="on"), "%d/ %d" % tuple(ports))

    def test_exit_status_of_a_program_stays_however_long_its_end_takes(self, master):
        self.says(program(master, "from actions_tutorial.robust import shutdown\nshutdown.KILLED_AFTER = 0.1\n"
                          "robust.init_node('guest')\nrospy.on_shutdown(lambda: time.sleep(0.5))\nsys.exit(7)"),
                  status=7)
        self.says(program(master, "import atexit\natexit.register(time.sleep, 2)\nrobust.init_node('guest')\n"
                          "os.kill(os.getpid(), signal.SIGTERM)\nrospy.spin()\nsys.exit(7)"), status=7)

    def test_node_is_up_until_the_functions_of_atexit_have_run(self, master):
        self.says(program(master, "import atexit\natexit.register(lambda: print(state()))\nrobust.init_node('guest')\n"
                          "atexit.register(lambda: print(state()))"), "up", "up")

    def test_lines_of_log_that_wait_are_written_at_the_end(self, master):
        node = program(master, "robust.shutdown.LOG_WITHIN = 20\nrobust.init_node('last')\n"
                       # 1000 may wait, and each goes to two handlers
                       "[rospy.loginfo('line %d!', number) for number in range(400)]")
        self.assertEqual(0, node.wait(), node)
        written, = glob.glob(os.path.join(master.env["ROS_LOG_DIR"], "*last*.log"))
        with open(written) as file:
            self.assertIn("line 399!", file.read())

    def test_stdout_that_cannot_be_written_is_said_once_and_ends_the_node(self, master):
        for code, status in ("print('x')\ntime.sleep(60)", 1), (
                "threading.Thread(target=lambda: [print('x') for _ in range(3)]).start()\nrospy.spin()", 0):
            with open("/dev/full", "w") as full:
                node = program(master, "robust.init_node('guest')\n" + code, stdout=full)
            self.assertEqual((status, 1), (node.wait(), node.stderr.count("cannot write to stdout")), node)

    def test_lines_stand_in_the_order_in_which_they_were_printed_and_logged(self, master):
        node = program(master, "stdout = sys.stdout\nprint('first')\nrobust.init_node('guest')\nprint('second')\n"
                       "print('through the stream from before', file=stdout)\n"
                       "[rospy.loginfo(str(number) * (2500 >> number % 2 * 9)) for number in range(10)]\n"
                       "sys.stdout = io.TextIOWrapper(sys.stdout.buffer)\nprint('through another stream')",
                       ROSCONSOLE_FORMAT="${message}", PYTHONUNBUFFERED="")
        self.assertEqual(0, node.wait(), node)
        self.assertEqual(["f", "s", "t", *"0123456789", "t"], [line[0] for line in node.stdout.splitlines()], node)

    def test_silent_peers_of_a_node_without_a_server_hold_up_nobody_and_are_let_go(self, master):
        """And one that speaks slowly is heard to its end."""
        node = program(master, "robust.peers.SPEAKS_WITHIN = 2\nrobust.init_node('guest')\n"
                       "print(rospy.impl.tcpros_base.get_tcpros_server_address()[1])\nrospy.spin()")
        address = "localhost", int(node.expect(r"^(\d+)$").group(1))
        header = encode_ros_handshake_header(dict(callerid="/t", topic="/rosout", md5sum="*", type="*"))
        slow = socket.create_connection(address, 30)
        slow.sendall(header[:3])
        speaks, gone, silent = (socket.create_connection(address, 30) for _ in range(3))
        with slow, silent, speaks:
            gone.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # with a reset
            gone.close()
            speaks.sendall(header)
            for peer, answer in (speaks, True), (silent, False):
                self.assertEqual(answer, bool(peer.recv(1)), node)
            slow.sendall(header[3:])
            self.assertTrue(slow.recv(1), node)
        check_quiet(node)

    def test_children_that_end_leave_node_goals_and_topics_and_are_heard(self, master):
        node, kept = program(master, PARENT), "up ACTIVE True"
        self.says(node, "child prints", "3 " + kept, "4 " + kept, "child prints", "0 " + kept, "child prints",
                  "-15 " + kept, "-15 " + kept, "SUCCEEDED")
        self.assertEqual(3, node.stderr.count("[WARN] child logs\n"), node)
        written, = glob.glob(os.path.join(master.env["ROS_LOG_DIR"], "*parent*.log"))
        with open(written) as file:
            self.assertEqual(3, file.read().count("child logs"), written)

    def test_handlers_of_asyncio_and_of_the_node_do_not_take_signals_from_each_other(self, master):
        for code in "asyncio.run(main())", "robust.init_node('guest')\nasyncio.run(main())":
            node = program(master, ASYNCIO + code)
            node.expect("heard")
            node.signal(signal.SIGTERM)
            self.says(node, "heard up", "stopped")

    def test_ctrl_c_with_disable_signals_is_python_s(self, master):
        node = program(master, """
robust.init_node("guest", disable_signals=True)
try:
    print("ready")
    threading.Event().wait()
except KeyboardInterrupt:
    print("KeyboardInterrupt")
finally:
    print("finally", state())
""")
        node.expect("ready")
        node.signal(signal.SIGINT)
        self.says(node, "ready", "KeyboardInterrupt", "finally up")

    def test_program_that_goes_on_after_its_node_keeps_its_time_its_processor_and_its_exit_status(self, master):
        suite = os.path.join(master.home, "suite_test.py")
        with open(suite, "w") as file:
            file.write(HEAD + SUITE)
        for node, status in (
                (program(master, "robust.init_node('x')\nrospy.signal_shutdown('')\nbefore = time.process_time()\n"
                         "time.sleep(3)\nsys.exit(7 if time.process_time() - before < 1 else 'a busy end')"), 7),
                (program(master, SUITE + "unittest.main()"), 1),
                (master.start("/usr/bin/python3", "-m", "pytest", "-p", "no:cacheprovider", suite), 1)):
            self.assertEqual(status, node.wait(), node)

    def test_ctrl_c_at_python_s_prompt_and_before_it_ends_the_node_and_not_the_prompt(self, master):
        code = "import rospy, time; from actions_tutorial import robust; robust.init_node('guest'); print('re' + 'ady')"
        env = dict(os.environ, HOME=master.home, PYTHON_BASIC_REPL="1", **master.env)  # a prompt writes its history
        for arguments, typed in ([], [code]), (["-i", "-c", code + "; rospy.spin()"], []):
            with contextlib.closing(pexpect.spawn("/usr/bin/python3", arguments, env=env)) as prompt:
                for line in typed:
                    prompt.sendline(line)
                prompt.expect("ready")
                prompt.sendintr()
                prompt.sendline("time.sleep(3); 'down: %s' % rospy.is_shutdown()")
                prompt.expect("down: True")

    def test_excepthook_of_the_program_stays(self, master):
        node = program(master, "sys.excepthook = hook = lambda kind, *_: print('mine:', kind.__name__)\n"
                       "robust.init_node('guest')\nprint(sys.excepthook is hook)\nraise ValueError")
        self.says(node, "True", "mine: ValueError", status=1)
        check_quiet(node)

    def test_server_goes_on_when_the_main_program_has_ended(self, master):
        self.is_up(program(master, """
robust.init_node("guest", log_level=rospy.WARN)
server = robust.SimpleActionServer("work", TestAction, lambda _: None, False)
server.start()
threading.Thread(target=lambda: print(state()), daemon=True).start()
"""), "up")

    def test_redirected_stdout_gets_what_it_gets_with_rospy(self, master):
        nodes = [program(master, """
buffer = io.StringIO()
with contextlib.redirect_stdout(buffer):
    %s.init_node("guest")
    print("print inside")
    rospy.loginfo("log inside")
print("print outside")
rospy.loginfo("log outside")
so(lambda: "log outside" in buffer.getvalue())
print(sorted(buffer.getvalue().splitlines()))
""" % module) for module in ("rospy", "robust")]
        self.assertEqual([0, 0], [node.wait() for node in nodes], nodes[1])
        self.assertEqual(nodes[0].stdout, nodes[1].stdout, nodes[1])

    def test_each_print_is_seen_at_once_a_progress_without_an_end_of_line_too(self, master):
        for make in os.pipe, pty.openpty:
            for line, code in (("50 %\n", "print('50 %')"), ("50 %\r", "print('50 %', end='\\r')"),
                               ("50 %", "print('50 %', end='')"), ("\r50 %", "sys.stdout.write('\\r50 %')")):
                read, write = make()
                node = program(master, "robust.init_node('guest')\n%s\nrospy.spin()" % code,
                               stdout=write, PYTHONUNBUFFERED="")
                seen = ""
                while seen.replace("\r\n", "\n") != line:
                    self.assertTrue(select.select([read], [], [], 20)[0], "%r of %r seen through %s by %s" % (
                        seen, line, make.__name__, node))
                    seen += os.read(read, 100).decode()
                node.stop()
                for number in read, write:
                    os.close(number)

    def test_seeded_random_numbers_stay_the_same_and_python_warns_of_nothing_of_ours(self, master):
        node = program(master, """
random.seed(1)
robust.init_node("guest", log_level=rospy.WARN)
server = robust.SimpleActionServer("work", TestAction, lambda _: server.set_succeeded(), False)
server.start()
client = robust.SimpleActionClient("work", TestAction)
client.wait_for_server()
print([client.send_goal_and_wait(TestGoal()) for _ in range(2)], random.random() == random.Random(1).random())
rospy.signal_shutdown("done")
""", PYTHONWARNINGS="default")
        self.says(node, "[3, 3] True")
        self.assertNotIn("/robust/internals.py", node.stderr, node)

    def test_init_node_and_get_param_of_rospy_and_robust_mix(self, master):
        rows = (
            ("robust.init_node('x')", "rospy.init_node('x')", "None up"),
            ("rospy.init_node('x')", "robust.init_node('x') or None", "None up"),
            ("robust.init_node('x', None, False, None, False, False, True)",
             "rospy.init_node('x', disable_signals=True)", "None up"),
            ("rospy.init_node('x', disable_signals=True)",
             "robust.init_node('x', disable_signals=True) or None", "None up"),
            ("robust.init_node('x')", "rospy.init_node('y')", "ROSException"),
            ("rospy.init_node('x')", "robust.init_node('y')", "ROSException"),
            ("rospy.init_node = robust.init_node; rospy.init_node('x')", "rospy.init_node('x') or None", "None up"),
            ("rospy.get_param = robust.get_param; rospy.init_node('x')", "rospy.get_param('~n', 7)", "7 up"),
            ("robust.init_node('x')", "robust.init_node('x', parameters={'~n': (7, 0, 9)})", "(7,) up"),
            ("robust.init_node('x'); rospy.set_param('~n', [1])",  # a type that is none of ROS's checks nothing
             "*(robust.get_param(name, default) for name in ('~n', '~m') for default in (None, (1, 2)))",
             "[1] [1] None (1, 2) up"))
        self.says(program(master, """
for first, second, _ in %r:
    if not os.fork():
        exec(first)
        try:
            sys.exit(eval("print(%%s, state())" %% second))
        except rospy.ROSException as error:
            sys.exit(print(type(error).__name__))
    assert os.wait()[1] == 0
""" % (rows,)), *(outcome for _, _, outcome in rows))

    def test_parameter_of_the_command_line_is_not_said_to_be_from_the_server(self, master):
        node = program(master, "sys.argv.append('_n:=abc')\nrobust.init_node('guest')\nrobust.get_param('~n', 7)")
        self.assertEqual(1, node.wait(), node)
        self.assertEqual("ValueError: ~n is 'abc', must be a whole number", node.stderr.splitlines()[-1])

    def test_name_that_is_none_is_a_value_error_at_once_in_rospy_s_words(self, master):
        master.kill()
        node = program(master, """
for name in "ns/node", "", None:
    for init_node in rospy.init_node, robust.init_node:
        try:
            init_node(name)
        except ValueError as error:
            print(error)
""")
        self.assertEqual(0, node.wait(), node)
        self.assertRegex(node.stdout, r"^(.+\n)\1(.+\n)\2(.+\n)\3$", node)

    def stubborn(self, master, *programs):
        """Returns nodes (Process) that do not end by themselves."""
        nodes = [program(master, "robust.init_node('guest')\n" + code) for code in programs]
        for node in nodes:
            node.expect("ready")
        return nodes

    def test_client_finds_its_server_without_the_master_and_another_one_cannot_start(self, master):
        node = program(master, """
robust.init_node("guest", log_level=rospy.WARN)
server = robust.SimpleActionServer("/work", TestAction, lambda _: None, True)
client = robust.SimpleActionClient("/work", TestAction)
print(client.wait_for_server(20))
os.kill(rosgraph.Master("").getPid(), signal.SIGKILL)
so(lambda: not rosgraph.is_master_online())
print(client.wait_for_server(10))
try:
    robust.SimpleActionClient("/other", TestAction)
except rospy.ROSInitException as error:
    print(str(error).partition(": ")[0])
rospy.signal_shutdown("done")
""")
        self.says(node, "True", "True", "the client of /other cannot start")
        check_quiet(node)

    def test_goal_after_the_end_of_the_node_is_not_sent(self, master):
        self.says(program(master, """
robust.init_node("guest")
client = robust.SimpleActionClient("work", TestAction)
rospy.signal_shutdown("done")
try:
    client.send_goal(TestGoal())
except rospy.ROSInitException as error:
    print(error)
"""), "the node was shut down before it sent its goal")

    def test_stubborn_node_ends_within_2_s_of_a_signal(self, master):
        for number in signal.SIGTERM, signal.SIGINT, signal.SIGHUP:
            self.ends(*self.stubborn(master, *STUBBORN), tell=lambda *nodes: [node.signal(number) for node in nodes])

    def test_stubborn_node_ends_within_2_s_of_rosnode_kill(self, master):
        def kill(*nodes):
            master.start("rosnode", "kill", "-a")
            for node in nodes:
                node.expect("shutdown request")

        self.ends(*self.stubborn(master, *STUBBORN), tell=kill)

    def test_exit_status_of_a_program_stays_though_the_master_is_frozen(self, master):
        node = program(master, "robust.shutdown.KILLED_AFTER = 20\nrobust.init_node('guest')\nprint('ready')\n"
                       "rospy.spin()\nsys.exit(3)")
        node.expect("ready")
        master.process.signal(signal.SIGSTOP)
        node.signal(signal.SIGTERM)
        self.assertEqual(3, node.wait(), node)

    def test_exit_status_of_a_stubborn_node_is_1_while_its_goal_is_under_way(self, master):
        program(master, """
rospy.init_node("server")
server = actionlib.SimpleActionServer("/work", TestAction, lambda goal: (
    threading.Event().wait() if goal.goal else server.set_succeeded()), False)
server.start()
""")
        for goals, status in ([], 0), ([0, 0], 0), ([0, 1], 1):
            node = program(master, """
robust.init_node("client", log_level=rospy.WARN)
client = robust.SimpleActionClient("/work", TestAction)
client.wait_for_server()
for goal in %r:
    client.send_goal(TestGoal(goal))
    print(so(lambda: client.get_state() == (GoalStatus.ACTIVE if goal else GoalStatus.SUCCEEDED)))
print("ready")
threading.Event().wait()
""" % goals)
            node.expect("ready")
            self.assertNotIn("False", node.stdout, node)
            self.ends(node, status=status)

    def test_threads_are_as_many_as_the_reference_says(self, master):
        node = program(master, """
def count():  # those that stay
    print(min(threading.active_count() for _ in range(20) if not time.sleep(0.05)))

robust.init_node("guest", log_level=rospy.WARN)
count()
servers = [robust.SimpleActionServer(name, TestAction, lambda goal: so(rospy.is_shutdown), True) for name in ("a", "b")]
count()
client = robust.SimpleActionClient("a", TestAction)
client.wait_for_server()
count()
[client.send_goal(TestGoal()) for _ in range(3)]
count()
rospy.signal_shutdown("done")
""")
        self.assertEqual(0, node.wait(), node)
        node, servers, client, goal = map(int, node.stdout.split())
        for more, at_most in (node, 8), (servers - node, 2 * 2), (goal - client, 1):
            self.assertLessEqual(more, at_most)

    def test_start_that_fails_is_caught_as_a_ros_init_exception_and_nothing_else_is_said(self, master):
        node = program(master, "try:\n    robust.init_node('guest')\nexcept rospy.ROSInitException as error:\n"
                       "    print(error)\n    sys.exit(5)", ROS_MASTER_URI="localhost")
        self.assertEqual((5, ""), (node.wait(), node.stderr), node)
        self.assertRegex(node.stdout, r"^.*ROS_MASTER_URI is 'localhost', must be like \S+\n$", node)

    def test_ctrl_c_while_the_parameters_are_checked_is_one_line(self, master):
        node = program(master, "robust.node.get_params = lambda _: signal.raise_signal(signal.SIGINT) or ()\n"
                       "robust.init_node('guest')", ROS_MASTER_URI="http://localhost:1")
        self.assertEqual((1, "interrupted while waiting for the master http://localhost:1\n"),
                         (node.wait(), node.stderr), node)

    def test_child_that_is_forked_while_a_line_is_written_to_the_log_file_logs_too(self, master):
        self.says(program(master, """
import logging

class Slow:
    def __init__(self, file):
        self.file, self.lock, self.writes = file, threading.Lock(), 0

    def __getattr__(self, name):
        return getattr(self.file, name)

    def write(self, text):
        with self.lock:
            self.writes += 1
            time.sleep(0.05)
            self.file.write(text)

robust.init_node("guest", log_level=rospy.WARN)
handler, = (one for one in logging.getLogger().handlers if hasattr(one, "baseFilename"))
so(lambda: not robust.log._others.waiting)
handler.stream = slow = Slow(handler.stream)
logging.getLogger("rosout").warning("a line")
while not slow.writes:
    time.sleep(0.001)
child = multiprocessing.get_context("fork").Process(
    target=logging.getLogger("rosout").warning, args=["another"], daemon=True)
child.start()
child.join(10)
print(child.exitcode)"""), "0")

    def test_log_changes_neither_parameters_nor_what_other_handlers_see(self, master):
        master.api.setParam("/plates", 3)
        self.says(program(master, """
import logging

class Mine(logging.Handler):
    def emit(self, record):
        print(record.msg, record.args)

robust.init_node("guest", log_level=rospy.FATAL)
logging.getLogger("rosout").addHandler(Mine())
logging.getLogger("rosout").critical("bowl %d", 1)
print(rospy.get_param("/")["plates"])"""), "bowl %d (1,)", "3")
        file = os.path.join(master.home, "log.yaml")
        with open(file, "w") as config:
            config.write("{version: 1, handlers: {mine: {class: __main__.Mine}}, root: {handlers: [mine]},"
                         " loggers: {rosout: {level: INFO}}}")
        self.says(program(master, """
import logging

class Mine(logging.Handler):
    def emit(self, record):
        if record.name == "rosout":
            print(record.msg, record.args, threading.current_thread() is threading.main_thread())

robust.init_node("guest")
logging.getLogger("rosout").info("bowl %d", 1)""", ROS_PYTHON_LOG_CONFIG_FILE=file), "bowl %d (1,) True")

    def test_unbuffered_stdout_shows_what_is_no_line(self, master):
        node = program(master, "robust.init_node('guest')\nsys.stdout.write('a plate')\nos._exit(0)")  # as by -u
        self.assertEqual((0, "a plate"), (node.wait(), node.stdout.strip()), node)

    def test_flood_of_log_into_a_terminal_that_is_stopped_takes_no_memory(self, master):
        read, write = os.pipe()
        node = program(master, """
robust.init_node("guest")
rss = psutil.Process().memory_info().rss
for number in range(40000):
    rospy.loginfo("%5000d", number)
sys.stderr.write("%d MiB more\\n" % ((psutil.Process().memory_info().rss - rss) >> 20))
""", stdout=write)
        self.assertLess(int(node.expect(r"(-?\d+) MiB more").group(1)), 20, node)
        self.assertEqual(0, node.wait(), node)
        for number in read, write:
            os.close(number)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "guest", Guest)
