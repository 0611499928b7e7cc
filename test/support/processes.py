"""Processes and ROS masters, for tests, checks/ and benchmark/."""
import atexit
import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time

import psutil
import rosgraph

PACKAGE = os.path.realpath(__file__ + "/../../..")  # its folder


def eventually(condition, what, *shown, timeout=50, changed=None, pause=0.02):
    """Wait until condition() is true. It is called every pause (s), and when changed (threading.Condition) is notified.

    shown: objects that the error shows. The wait ends when a Process among them has ended.
    Returns what condition() returned. Raises AssertionError with what (str) after timeout (s).
    """
    begun, changed = time.monotonic(), changed or threading.Condition()
    with changed:
        while True:
            ended = any(isinstance(one, Process) and one.has_ended() for one in shown)
            value = condition()
            if value:
                return value
            waited = time.monotonic() - begun
            if ended or waited > timeout:
                raise AssertionError("\n".join(
                    ["expected: %s; not so after %.1f s" % (what, waited)] + [str(one) for one in shown]))
            changed.wait(pause)


class Process:
    """A command (list of str) in a process group of its own. env (dict of str) is added to the environment; popen: for
    subprocess.Popen. lines: [(s since the start, "stdout" or "stderr", text)]; usage: psutil.Process."""

    running_ones = set()

    def __init__(self, command, env=None, **popen):
        self.command, self.lines, self._changed, self.started = command, [], threading.Condition(), time.monotonic()
        options = dict({"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}, **popen)
        environment = dict(os.environ)
        environment.pop("PYTHONUNBUFFERED", None)  # or nobody would see that a flush is missing
        environment.update(env or {})
        self._popen = subprocess.Popen(command, env=environment, start_new_session=True, universal_newlines=True,
                                       errors="replace", **options)
        self.running_ones.add(self)
        self.usage = psutil.Process(self._popen.pid)
        self._readers = [threading.Thread(target=self._read, args=[name, pipe], daemon=True) for name, pipe in (
            ("stdout", self._popen.stdout), ("stderr", self._popen.stderr)) if pipe]
        for reader in self._readers:
            reader.start()

    def _read(self, name, pipe):
        with pipe:
            for text in pipe:
                with self._changed:
                    self.lines.append((time.monotonic() - self.started, name, text.rstrip("\n")))
                    self._changed.notify_all()

    def output(self, stream):
        """Returns the text that came on "stdout" or "stderr" so far."""
        return "".join(text + "\n" for _, name, text in list(self.lines) if name == stream)

    stdout = property(lambda self: self.output("stdout"))
    stderr = property(lambda self: self.output("stderr"))

    def expect(self, pattern, timeout=50):
        """Wait until a line holds pattern (regex), also one that came earlier. Returns the match."""
        def match():
            return next(filter(None, (re.search(pattern, text) for _, _, text in self.lines)), None)

        return eventually(match, "a line with /%s/" % pattern, self, timeout=timeout, changed=self._changed)

    def running(self):
        return self._popen.poll() is None

    def has_ended(self):
        """Returns whether the process has ended and all its output is in lines."""
        return not self.running() and not any(reader.is_alive() for reader in self._readers)

    def wait(self, timeout=50):
        """Wait until the process ends, for timeout (s). Returns its exit status (int; -n: killed by signal n)."""
        eventually(lambda: not self.running(), "the process ends", self, timeout=timeout)
        for reader in self._readers:
            reader.join(5)  # a child of it may still hold the pipe
        return self._popen.returncode

    def type(self, keys):
        """Write keys (str) to its stdin, which must be a pipe."""
        self._popen.stdin.write(keys)
        self._popen.stdin.flush()

    def signal(self, number):
        """Send a signal only to the process, as kill(1) does; SIGKILL is stop()."""
        if number == signal.SIGKILL:
            return self.stop()
        self._popen.send_signal(number)
        if number == signal.SIGSTOP:
            eventually(lambda: self.usage.status() == psutil.STATUS_STOPPED, "the process is stopped", self)

    def stop(self):
        """Kill the group."""
        self.kill()
        self.wait()

    def kill(self):
        """Kill the group, without waiting, and its children in other groups, such as the nodes of a roslaunch."""
        with contextlib.suppress(psutil.Error):  # it has ended
            for child in self.usage.children(recursive=True):
                child.kill()
        # After its end, its number may belong to another process, unless there is no such process.
        if self.running() or not psutil.pid_exists(self._popen.pid):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._popen.pid, signal.SIGKILL)
        self.running_ones.discard(self)

    def __str__(self):
        status = self._popen.poll()
        return "\n".join(["'%s' (%s), its output:" % (
            " ".join(self.command), "running" if status is None else "exit status %d" % status)]
            + ["  %7.3f s %s: %s" % line for line in list(self.lines)])


def run(*command, timeout=120, status=0, **env):
    """Run a command (str …) to its end. Returns its stdout. Raises AssertionError if the exit status is not status."""
    process = Process(list(command), env)
    try:
        assert process.wait(timeout) == status, "expected exit status %d of %s" % (status, process)
    finally:
        process.stop()
    return process.stdout


def bound_socket(port=0):
    """Returns a socket that is bound and does not listen. A program may still listen on its port, and no other gets
    it by chance."""
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    bound.bind(("127.0.0.1", port))
    return bound


class Group:
    """Processes that end together, at the end of a with statement at the latest. env: added to their environment."""

    def __init__(self, **env):
        self.env, self.processes = env, []

    def start(self, *command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **env):
        """Start a command (str …). -> Process"""
        self.processes.append(Process(list(command), dict(self.env, **env), stdin=stdin, stdout=stdout, stderr=stderr))
        return self.processes[-1]

    def node(self, name, *arguments, **options):
        """Start scripts/NAME, without rosrun, which takes longer than the node. -> Process"""
        return self.start(os.path.join(PACKAGE, "scripts", name), *arguments, **options)

    def stop(self):
        while self.processes:
            self.processes.pop().stop()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()


class Master(Group):
    """A rosmaster on a free port, with a ROS_HOME of its own, and processes that run on it."""

    homes = []  # folders, of all masters together

    def __init__(self):
        self._port = bound_socket()
        port = str(self._port.getsockname()[1])
        self.home = tempfile.mkdtemp(prefix="actions_tutorial-")
        self.homes.append(self.home)
        super().__init__(ROS_MASTER_URI="http://localhost:" + port, ROS_HOSTNAME="localhost", ROS_IP="",
                         ROS_NAMESPACE="", ROS_HOME=self.home, ROS_LOG_DIR=os.path.join(self.home, "log"))
        master = self.start("rosmaster", "--core", "-p", port)
        eventually(lambda: rosgraph.is_master_online(self.env["ROS_MASTER_URI"]), "a master", master)

    def stop(self):
        super().stop()
        self._port.close()
        shutil.rmtree(self.home, ignore_errors=True)


@atexit.register
def leave_nothing():
    """A test that is interrupted or terminated leaves neither processes nor folders behind."""
    for process in list(Process.running_ones):
        process.kill()
    for home in Master.homes:
        shutil.rmtree(home, ignore_errors=True)


def _terminate(number, _):
    leave_nothing()
    os._exit(128 + number)


signal.signal(signal.SIGTERM, _terminate)  # rospy's own handler calls it
