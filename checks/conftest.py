"""What the checks share: a workspace, a bare machine, and what a check needs or else is skipped."""
import contextlib
import os
import pathlib
import random
import shlex
import shutil
import subprocess
import sys

import pytest

ROOT = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))
sys.path.insert(0, os.path.join(ROOT, "test"))
from support.processes import Group, Master, eventually, run  # noqa: E402


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    for name in [name for mark in item.iter_markers("needs") for name in mark.args]:
        if os.geteuid() if name == "root" else not shutil.which(name):
            pytest.skip("this needs %s" % name)


@pytest.fixture(scope="session")
def workspace(tmp_path_factory):
    """A workspace with the package in it, thrown away; what is started afterwards runs as in ./tutorial shell."""
    folder = tmp_path_factory.mktemp("workspace")
    variables = run(os.path.join(ROOT, "tutorial"), "shell", "env", "-u", "TUTORIAL_WS", "-u", "ROS_HOSTNAME", "-0",
                    TUTORIAL_WS=str(folder), timeout=600)
    os.environ.update(pair.split("=", 1) for pair in variables.split("\0")[:-1])
    yield folder
    shutil.rmtree(str(folder))


@pytest.fixture
def master():
    with Master() as master:
        yield master


@pytest.fixture(scope="session")
def debian(tmp_path_factory):
    """Makes the bare system of a suite (str), once. -> pathlib.Path"""
    made = {}

    def make(suite):
        if suite not in made:
            folder = made[suite] = tmp_path_factory.mktemp(suite)
            run("debootstrap", "--variant=minbase", suite, str(folder), timeout=900)
            folder.chmod(0o755)
            shutil.copy("/etc/resolv.conf", str(folder / "etc"))
            (folder / "etc/hosts").write_text("127.0.0.1 localhost\n")
        return made[suite]

    yield make
    for folder in made.values():
        shutil.rmtree(str(folder))


def on_terminal(*command):
    """Returns the command (str …) that runs this one on a terminal of its own."""
    return ["script", "-qefc", "exec " + " ".join(map(shlex.quote, command)), "/dev/null"]


class Machine(Group):
    """A bare Debian, a copy of what the fixture debian made: a chroot on a tmpfs in namespaces of its own, which the
    kernel removes when they end. path: its files, for us; tutorial: where it has ours; user: who runs its commands,
    root or learner; env: for them."""

    def __init__(self, base, user="root", checkout="/srv/actions_tutorial"):
        super().__init__()
        self.user, self.tutorial, self.network = user, checkout + "/tutorial", []
        # A process without a parent becomes a child of sleep, which does not wait for it: let the kernel do that.
        namespaces = super().start("setpriv", "--pdeathsig", "KILL", "unshare", "--mount", "--pid", "--fork",
                                   "--kill-child", "env", "--ignore-signal=CHLD", "sleep", "infinity")
        self.init = eventually(lambda: [child.pid for child in namespaces.usage.children() if child.name() == "sleep"],
                               "a machine", namespaces)[0]
        self.path = pathlib.Path("/proc", str(self.init), "root", "mnt")
        self.enter = ["nsenter", "--mount", "--pid", "--target", str(self.init)]
        # A limit, not what it takes; rosbag warns below 5 GB.
        for command in ("mount -t tmpfs -o size=16G,mode=755 tmpfs /mnt", "cp -a %s/. /mnt" % base,
                        "mount -t proc proc /mnt/proc", "mount --rbind --make-rslave /dev /mnt/dev"):
            run(*self.enter, *command.split())
        # The network is the host's, where a master may run already.
        self.env = dict(ROS_MASTER_URI="http://localhost:%d" % random.randrange(20000, 30000))
        # An ordinary user, with another python3 in front.
        self.run("useradd", "--create-home", "--shell", "/bin/bash", "learner", user="root")
        python = self.path / "home/learner/python/bin/python3"
        python.parent.mkdir(parents=True)
        python.write_text("#!/bin/sh\nexit 99\n")
        python.chmod(0o755)
        # What git has or would add; only root may write there.
        names = run("git", "-c", "safe.directory=*", "-C", ROOT, "ls-files", "--cached", "--others",
                    "--exclude-standard").splitlines()
        folder = self.path / checkout[1:]
        for name in filter(lambda name: os.path.exists(os.path.join(ROOT, name)), names):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(os.path.join(ROOT, name), str(folder / name))
        run("chmod", "-R", "go-w", str(folder))

    def start(self, *command, user=None, terminal=False, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, **env):
        """Start a command (str …) with no variables but a few usual ones, the machine's env and env. -> Process"""
        learner = (user or self.user) == "learner"
        home, first = ("/home/learner", "/home/learner/python/bin:") if learner else ("/root", "/usr/sbin:/sbin:")
        words = ["chroot", "/mnt"] + learner * ["setpriv", "--reuid=learner", "--regid=learner", "--init-groups"]
        words += ["env", "-i", "HOME=" + home, "LANG=C.UTF-8", "PATH=%s/usr/bin:/bin" % first]
        words += ["%s=%s" % pair for pair in dict(self.env, **env).items()] + list(command)
        return super().start(*self.enter, *self.network, *(on_terminal(*words) if terminal else words),
                             stdin=stdin, stderr=stderr)

    def run(self, *command, status=0, timeout=900, **options):
        """Run a command to its end. -> Process; AssertionError if its status is another."""
        process = self.start(*command, **options)
        assert process.wait(timeout) == status, "expected exit status %d of %s" % (status, process)
        return process

    def let_sudo(self, how="NOPASSWD: ALL"):
        """Let learner use sudo, which is installed if need be."""
        if not (self.path / "usr/bin/sudo").exists():
            self.run("sh", "-c", "apt-get update && apt-get install -y --no-install-recommends sudo", user="root")
        (self.path / "etc/sudoers.d/learner").write_text("learner ALL=(ALL) %s\n" % how)

    @contextlib.contextmanager
    def offline(self):
        """With no network but its loopback."""
        self.network = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "-"]
        try:
            yield
        finally:
            self.network = []

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
        """Returns {PID in there: command line}, but for zombies, which have none."""
        found = {}
        for file in (self.path / "proc").glob("[0-9]*/cmdline"):
            with contextlib.suppress(OSError):  # it has just ended
                found[int(file.parent.name)] = file.read_text(errors="replace").replace("\0", " ")
        return {pid: line for pid, line in found.items() if line}

    def __str__(self):
        return "in the machine there are now: %s" % self.processes_in_it()
