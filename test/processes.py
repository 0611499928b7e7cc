"""The processes of a test: started, read as they speak, measured, signalled, and none left behind. A master is one."""
import atexit
import contextlib
import os
import re
import shutil
import signal
import socket
import statistics
import subprocess
import tempfile
import threading
import time

import psutil
import rosgraph

PACKAGE = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))  # its folder
os.environ.pop("PYTHONUNBUFFERED", None)  # of whoever tests: with it, what is not flushed is seen, too


def eventually(condition, what, *concerned, timeout=50, news=None, pause=0.02):
    """Wait until condition() is true, and return its value. It is asked every pause (s), and at news
    (threading.Condition). AssertionError with what (str) and all that those concerned (Process, RawClient) have said,
    after timeout (s), and when a Process among them has ended."""
    waited, now, news = 0, time.monotonic(), news or threading.Condition()
    with news:
        while True:
            over = any(isinstance(one, Process) and one.over() for one in concerned)
            value = condition()
            if value:
                return value
            before, now = now, time.monotonic()
            waited += min(now - before, 1)  # a virtual machine that stood still itself has made nobody late
            if over or waited > timeout:
                raise AssertionError("\n".join(
                    ["expected: %s; not so after %.1f s" % (what, waited)] + [str(one) for one in concerned]))
            news.wait(pause)


class Process:
    """A command (list of str) in a process group of its own, with env (dict of str) added to the environment; popen: of
    subprocess.Popen. lines: [(s since the start, "stdout" or "stderr", text)], as they come; usage: psutil.Process."""

    starting = threading.Lock()  # held while anything comes that is not to be left behind
    left = set()  # those that are not killed yet
    _kept = []  # sockets, of all processes together

    def __init__(self, command, env=None, **popen):
        self.command, self.lines, self._news, self.started = command, [], threading.Condition(), time.monotonic()
        options = dict({"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}, **popen)
        with self.starting:
            self._popen = subprocess.Popen(command, env=dict(os.environ, **env or {}), start_new_session=True,
                                           universal_newlines=True, errors="replace", **options)
            self.left.add(self)
        self.usage = psutil.Process(self._popen.pid)
        self._readers = [threading.Thread(target=self._read, args=[name, pipe], daemon=True) for name, pipe in (
            ("stdout", self._popen.stdout), ("stderr", self._popen.stderr)) if pipe]
        for reader in self._readers:
            reader.start()

    def expect(self, pattern, timeout=50):
        """Wait until a line holds pattern (regex), also one that came earlier. Returns the match."""
        def match():
            return next(filter(None, (re.search(pattern, text) for _, _, text in self.lines)), None)

        return eventually(match, "a line with /%s/" % pattern, self, timeout=timeout, news=self._news)

    def wait(self, timeout=50):
        """Wait until the process ends, for timeout (s). Returns its exit status (int; -n: killed by signal n)."""
        eventually(lambda: not self.running(), "an end", self, timeout=timeout)
        for reader in self._readers:
            reader.join(5)  # a child of it may still hold the pipe
        return self._popen.returncode

    def running(self):
        return self._popen.poll() is None

    def over(self):
        """Whether the process has ended and all that it said is in lines."""
        return not self.running() and not any(reader.is_alive() for reader in self._readers)

    def type(self, keys):
        """Write keys (str) to its stdin, which popen has made a pipe."""
        self._popen.stdin.write(keys)
        self._popen.stdin.flush()

    def signal(self, number):
        """Send a signal to the process alone, as kill(1) does. It stands still when this has sent SIGSTOP; SIGKILL is
        stop()."""
        if number == signal.SIGKILL:
            return self.stop()
        self._popen.send_signal(number)
        if number == signal.SIGSTOP:
            eventually(lambda: self.usage.status() == psutil.STATUS_STOPPED, "a process that stands still", self)

    def stop(self):
        """Kill whatever is left of the group. Its ports go to nobody else while the tests run: when a node comes that
        has the name of one that was killed, the master tells that one's address to end."""
        ports = []
        with contextlib.suppress(psutil.Error):  # it has ended
            ports = [one.laddr.port for one in getattr(self.usage, "net_connections", self.usage.connections)("tcp4")
                     if one.status == psutil.CONN_LISTEN]  # psutil 6 gave it another name
        self.kill()
        self.wait()
        for port in ports:
            with contextlib.suppress(OSError):  # a child that is out of the group has it, too
                self._kept.append(bound_socket(port))

    def kill(self):
        # Once it has ended and nothing is left of its group, the system may give its number to a stranger, who lives.
        if self.running() or not psutil.pid_exists(self._popen.pid):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)
        self.left.discard(self)

    def _read(self, name, pipe):
        with pipe:
            for text in pipe:
                with self._news:
                    self.lines.append((time.monotonic() - self.started, name, text.rstrip("\n")))
                    self._news.notify_all()

    def said(self, stream):
        """The text that came on "stdout" or "stderr" so far."""
        return "".join(text + "\n" for _, name, text in list(self.lines) if name == stream)

    stdout = property(lambda self: self.said("stdout"))
    stderr = property(lambda self: self.said("stderr"))

    def __str__(self):
        status = self._popen.poll()
        return "\n".join(["'%s' (%s), which has said:" % (
            " ".join(self.command), "running" if status is None else "exit status %d" % status)]
            + ["  %7.3f s %s: %s" % line for line in list(self.lines)])


def run(*command, timeout=120, status=0, **env):
    """Run a command (str …) to its end. Returns what it said on stdout; AssertionError if its status is another."""
    process = Process(list(command), env)
    try:
        assert process.wait(timeout) == status, "expected exit status %d of %s" % (status, process)
    finally:
        process.stop()
    return process.stdout


def bound_socket(port=0):
    """Returns a socket that is bound but does not listen: nobody else is given the port, and one may listen there."""
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.bind(("127.0.0.1", port))
    return bound


def bowls(count):
    """The bowls that count seconds of washing name."""
    return ["bowl-%d" % i for i in range(count)]


def printed_bowls(client):
    """Returns the bowls (list of str) that a client (Process) printed as feedback, and those of its result or None."""
    feedback, _, result = client.stdout.partition("The result is: ")
    named = [line.split('"')[1] for line in feedback.splitlines() if "last_dish_washed" in line]
    return named, [line[4:] for line in result.splitlines() if line.startswith("  - ")] if result else None


def check_client(client, status, count):
    """Wait for the end of a client (Process): exit status (int), and count bowls as feedback and as its result."""
    assert client.wait(60) == status, "expected exit status %d of %s" % (status, client)
    assert printed_bowls(client) == (bowls(count), bowls(count)), "expected %d bowls of %s" % (count, client)


def check_seconds(client, within):
    """Expect the seven bowls of a client (Process) a second apart, the median to within (s); a busy machine may be late
    with the last one."""
    times = [at for at, _, text in client.lines if "Feedback received" in text]
    gap = statistics.median(after - before for before, after in zip(times, times[1:]))
    assert abs(gap - 1) < within and 5 < times[-1] - times[0] < 10, "expected a bowl a second of %s" % client


class Group:
    """Processes that end together, at the end of a with statement at the latest; env: added to their environment."""

    def __init__(self, **env):
        self.env, self.processes = env, []

    def start(self, *command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **env):
        """Start a command (str …). -> Process"""
        self.processes.append(Process(list(command), dict(self.env, **env), stdin=stdin, stdout=stdout, stderr=stderr))
        return self.processes[-1]

    def node(self, name, *arguments, **options):
        """Start one of the package's nodes. Not by rosrun, which looks for it for longer than it takes to start.
        -> Process"""
        return self.start(os.path.join(PACKAGE, "scripts", name), *arguments, **options)

    def stop(self):
        while self.processes:
            self.processes.pop().stop()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()


class Master(Group):
    """A rosmaster on a free port, with files of its own, and the processes that run on it; process: the master's."""

    homes = []  # folders, of all masters together

    def __init__(self, _=None):
        self._port = bound_socket()
        self.uri = "http://localhost:%d" % self._port.getsockname()[1]
        with Process.starting:
            self.home = tempfile.mkdtemp(prefix="actions_tutorial-")
            self.homes.append(self.home)
        super().__init__(ROS_MASTER_URI=self.uri, ROS_HOSTNAME="localhost", ROS_IP="", ROS_NAMESPACE="",
                         ROS_HOME=self.home, ROS_LOG_DIR=os.path.join(self.home, "log"))
        self.run()

    @property
    def api(self):
        """The master's API (rosgraph.Master), a new one each time: threads cannot share one."""
        return rosgraph.Master("/test", self.uri)

    def run(self):
        """Start the master, also again on the same port after kill()."""
        self.process = Process(["rosmaster", "--core", "-p", self.uri.rpartition(":")[2]], self.env)
        eventually(lambda: rosgraph.is_master_online(self.uri), "a master at " + self.uri, self.process, self)

    def kill(self):
        """Kill the master alone; its nodes live on."""
        self.process.stop()

    def stop(self):
        super().stop()
        self.kill()
        self._port.close()
        shutil.rmtree(self.home, ignore_errors=True)

    def __str__(self):
        """What the master, which hardly ever says a word, has written into its log."""
        log = os.path.join(self.env["ROS_LOG_DIR"], "master.log")
        if not os.path.exists(log):
            return "no %s" % log
        with open(log) as file:
            return "%s:\n%s" % (log, file.read()[-4000:])


@atexit.register
def leave_nothing():
    """A test that is interrupted leaves no process and no folder behind either."""
    Process.starting.acquire()  # tests that still run start no more
    for process in list(Process.left):
        process.kill()
    for home in Master.homes:
        shutil.rmtree(home, ignore_errors=True)
