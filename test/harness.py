"""What tests with real processes share: start them, read them as they speak, signal them, and leave none behind."""
import atexit
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time

import rosgraph


def eventually(condition, what, timeout=30):
    """Poll condition() until it is true and return its value. AssertionError with what (str) after timeout (s)."""
    started = time.monotonic()
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() - started > timeout:
            raise AssertionError("expected: %s; not so after %.1f s" % (what, timeout))
        time.sleep(0.02)


class Process:
    """A command (list of str) in a process group of its own, with env (dict of str) added to the environment.

    lines: list of (seconds since the start, "stdout" or "stderr", text without newline), as they come.
    """

    def __init__(self, command, env=None, **popen):
        self.command, self.lines, self._news = command, [], threading.Condition()
        self.started = time.monotonic()
        self._popen = subprocess.Popen(
            command, env=dict(os.environ, **(env or {})), start_new_session=True, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True, errors="replace", **popen)
        self.pid = self._popen.pid
        self._readers = [threading.Thread(target=self._read, args=[name], daemon=True) for name in ("stdout", "stderr")]
        for reader in self._readers:
            reader.start()
        atexit.register(self._kill)  # a test that is interrupted leaves none behind either

    def expect(self, pattern, timeout=30, stream="stdout"):
        """Wait until a line of stream ("stdout", "stderr", None: either) holds pattern (regex). Returns the match.
        Lines that came earlier count. Fails at once when the process has ended without one."""
        started = time.monotonic()
        seen = 0
        while True:
            with self._news:
                ended = not any(reader.is_alive() for reader in self._readers)
                if seen == len(self.lines) and not ended:
                    self._news.wait(0.1)
                news, seen = self.lines[seen:], len(self.lines)
            for _, name, text in news:
                match = stream in (None, name) and re.search(pattern, text)
                if match:
                    return match
            waited = time.monotonic() - started
            if (ended and not news) or waited > timeout:
                raise AssertionError("expected a line with /%s/ on %s, none came in %.1f s from %s"
                                     % (pattern, stream or "stdout or stderr", waited, self))

    def wait(self, timeout=30):
        """Wait until the process ends, for timeout (s). Returns its exit status (int; -n: killed by signal n)."""
        try:
            status = self._popen.wait(timeout)
        except subprocess.TimeoutExpired:
            raise AssertionError("expected an end, none came in %.1f s from %s" % (timeout, self)) from None
        for reader in self._readers:
            reader.join(5)  # a child of it may still hold the pipe
        return status

    def running(self):
        return self._popen.poll() is None

    def signal(self, number):
        """Send a signal to the process alone, as kill(1) does."""
        self._popen.send_signal(number)

    def stop(self):
        """Kill whatever is left of the group."""
        self._kill()
        self.wait()

    def _kill(self):
        try:
            os.killpg(self.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        atexit.unregister(self._kill)

    def _read(self, name):
        with getattr(self._popen, name) as pipe:
            for text in pipe:
                with self._news:
                    self.lines.append((time.monotonic() - self.started, name, text.rstrip("\n")))
                    self._news.notify_all()
        with self._news:
            self._news.notify_all()

    @property
    def stdout(self):
        return self._text("stdout")

    @property
    def stderr(self):
        return self._text("stderr")

    def _text(self, stream):
        return "".join(text + "\n" for _, name, text in list(self.lines) if name == stream)

    def __str__(self):
        status = self._popen.poll()
        return "\n".join(["«%s» (%s), which has said:" % (
            " ".join(self.command), "running" if status is None else "exit status %d" % status)]
            + ["  %7.3f s %s: %s" % line for line in list(self.lines)])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()


class Master(Process):
    """A rosmaster on a free port, with files of its own; env (dict of str) leads a process to it."""

    def __init__(self):
        # Bound but not listening: nobody else is given the port, and the master may still listen there.
        self._port = socket.socket()
        self._port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._port.bind(("127.0.0.1", 0))
        self.uri = "http://localhost:%d" % self._port.getsockname()[1]
        self.home = tempfile.mkdtemp(prefix="actions_tutorial-")
        atexit.register(shutil.rmtree, self.home, ignore_errors=True)
        self.env = {"ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost", "ROS_IP": "", "ROS_NAMESPACE": "",
                    "ROS_HOME": self.home, "ROS_LOG_DIR": os.path.join(self.home, "log")}
        self._nodes = []
        self.start()

    @property
    def api(self):
        """The master's API (rosgraph.Master), a new one each time: threads cannot share one."""
        return rosgraph.Master("/harness", self.uri)

    def start(self):
        """Start the master, also again on the same port after kill()."""
        super().__init__(["rosmaster", "--core", "-p", self.uri.rpartition(":")[2]], self.env)
        eventually(lambda: rosgraph.is_master_online(self.uri), "a master at " + self.uri)

    def kill(self):
        """Kill the master alone; its nodes live on."""
        super().stop()

    def node(self, name, *arguments, **env):
        """Start one of the package's nodes by rosrun, which becomes the node, so that signals reach it. -> Process"""
        return self.process("rosrun", "actions_tutorial", name, *arguments, **env)

    def process(self, *command, **env):
        """Start any other command against this master. -> Process, stopped with the master at the latest"""
        self._nodes.append(Process(list(command), dict(self.env, **env)))
        return self._nodes[-1]

    def stop(self):
        for node in self._nodes:
            node.stop()
        super().stop()
        self._port.close()
        shutil.rmtree(self.home, ignore_errors=True)
