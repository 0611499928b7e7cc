"""Bare machines, networks, and Pythons, for the checks."""
import contextlib
import glob
import os
import pathlib
import shlex
import shutil
import subprocess

import pytest

from support.processes import Group, PACKAGE, run


def copy_package(folder):
    shutil.copytree(PACKAGE, str(folder), ignore=shutil.ignore_patterns(".git", "__pycache__"))


def find_python(version):
    """Returns the path (str) of a Python of a version (str, as "3.8") that can make a venv, or None."""
    found = glob.glob(os.path.expanduser("~/.pyenv/versions/%s.*/bin/python%s" % (version, version)))
    return next((path for path in filter(None, found + [shutil.which("python" + version)]) if not subprocess.call(
        [path, "-c", "import ensurepip, venv"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)), None)


def on_terminal(*command):
    """Returns the command (str …) that runs this one on a terminal of its own."""
    return ["script", "-qefc", "exec " + " ".join(map(shlex.quote, command)), "/dev/null"]


class Namespaces(Group):
    """Processes in namespaces of their own, which the kernel removes with their first process, a shell that ends with
    us. kinds: --mount, --net, --pid (str); pid: the shell's; enter: the command that runs another one in there."""

    def __init__(self, *kinds, **env):
        super().__init__(**env)
        shell = super().start("unshare", "--fork", *kinds, "bash", "-c", "echo there; read", stdin=subprocess.PIPE)
        try:
            shell.expect("there")
        except AssertionError:
            pytest.skip("this needs the right to make namespaces: %s" % shell.stderr)
        self.pid = str(shell.usage.children()[0].pid)
        self.enter = ["nsenter", *kinds, "--target", self.pid]

    def start(self, *command, **options):
        return super().start(*self.enter, *command, **options)


class Machine(Namespaces):
    """A bare Debian, a copy of what the fixture debian made: a chroot on a tmpfs. path: its files, for us; tutorial:
    where it has ours; user: who runs its commands, root or learner."""

    def __init__(self, base, user="root", checkout="/srv/actions_tutorial"):
        super().__init__("--mount", "--pid")
        self.user, self.tutorial = user, checkout + "/tutorial"
        self.path = pathlib.Path("/proc", self.pid, "root", "mnt")
        # A limit, not what it takes; rosbag warns below 5 GB.
        for command in ("mount -t tmpfs -o size=16G,mode=755 tmpfs /mnt", "cp -a %s/. /mnt" % base,
                        "mount -t proc proc /mnt/proc", "mount --rbind --make-rslave /dev /mnt/dev"):
            run(*self.enter, *command.split())
        # An ordinary user, with another python3 in front.
        self.run("useradd", "--create-home", "--shell", "/bin/bash", "learner", user="root")
        python = self.path / "home/learner/python/bin/python3"
        python.parent.mkdir(parents=True)
        python.write_text("#!/bin/sh\nexit 99\n")
        python.chmod(0o755)
        # Only root may write there.
        copy_package(self.path / checkout[1:])
        self.run("chmod", "-R", "go-w", checkout, user="root")

    def start(self, *command, user=None, terminal=False, offline=False, stdin=subprocess.DEVNULL,
              stderr=subprocess.PIPE, **env):
        """Start a command (str …) with only a few usual variables and env, on a terminal or not; offline: with no
        network except its loopback. -> Process"""
        user = user or self.user
        home = "/root" if user == "root" else "/home/" + user
        words = ["chroot", "--userspec=" + user, "/mnt", "env", "-i", "HOME=" + home, "LANG=C.UTF-8",
                 "PATH=%s/python/bin:/usr/sbin:/usr/bin:/sbin:/bin" % home]
        words += ["%s=%s" % pair for pair in env.items()] + list(command)
        network = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "-"] if offline else []
        return super().start(*network, *(on_terminal(*words) if terminal else words), stdin=stdin, stderr=stderr)

    def run(self, *command, status=0, timeout=900, **options):
        """Run a command to its end. -> Process; AssertionError if its status differs."""
        process = self.start(*command, **options)
        assert process.wait(timeout) == status, "expected exit status %d of %s" % (status, process)
        return process

    def let_sudo(self, how="NOPASSWD: ALL"):
        """Let learner use sudo, which is installed if needed."""
        if not (self.path / "usr/bin/sudo").exists():
            self.run("sh", "-c", "apt-get update && apt-get install -y --no-install-recommends sudo", user="root")
        (self.path / "etc/sudoers.d/learner").write_text("learner ALL=(ALL) %s\n" % how)

    @contextlib.contextmanager
    def changed(self, file, change=None):
        """With a file (str) after change (a function from str to str), or without it."""
        path = self.path / file.lstrip("/")
        was = path.with_name(path.name + ".was")
        path.rename(was)
        if change:
            path.write_text(change(was.read_text()))
            shutil.copymode(str(was), str(path))
        try:
            yield
        finally:
            was.replace(path)

    def processes_in_it(self):
        """Returns {PID in there: command line}, except for zombies, which have none."""
        found = {}
        for file in (self.path / "proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):  # it has just ended
                found[int(file.parent.name)] = file.read_text(errors="replace").replace("\0", " ")
        return {pid: line for pid, line in found.items() if line}

    def __str__(self):
        return "in the machine there are now: %s" % self.processes_in_it()
