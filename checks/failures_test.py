"""Each way in which ./tutorial can fail or be interrupted, on a bare machine that is thrown away.

A user may call it at any time: each check finds the machine as the one before has left it.
"""
import contextlib
import fcntl
import re
import subprocess
import threading

import pytest

from conftest import Machine
from harness import bound_socket, eventually

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")
CHECKOUT, COPY, WORKSPACE = "/srv/actions_tutorial", "/srv/copy", "/home/learner/workspace"
UPDATE, INSTALL, BUILD = (WORKSPACE + "/log/%s.log" % step for step in ("apt-update", "apt-install", "build"))
ROOTS = dict(user="root", TUTORIAL_WS="/srv/ws")


@pytest.fixture(scope="module")
def machine(debian):
    with Machine(debian("bookworm"), "learner", CHECKOUT) as machine:
        # It looks like a system that nobody has tried: what counts is what apt knows.
        (machine.path / "usr/lib/os-release").write_text('ID=ubuntu\nVERSION_ID="24.04"\n')
        machine.put_checkout(machine.path / COPY[1:])
        machine.env["TUTORIAL_WS"] = WORKSPACE
        yield machine


@pytest.fixture(scope="module")
def sudo(machine):
    machine.let_sudo()


@pytest.fixture
def ready(machine, sudo):
    machine.run(machine.tutorial, "shell", "true")


def fails(machine, words, *command, tutorial=None, **options):
    """It fails, and one line on stderr says why."""
    process = machine.start(tutorial or machine.tutorial, *(command or ["demo"]), **options)
    assert process.wait(600) > 0, "expected a failure of %s" % process
    assert re.search(words, process.stderr) and process.stderr.count("\n") == 1, "expected /%s/ of %s" % (
        words, process)


def interrupted(machine, how, words, *command, log=None, grace=20, tutorial=None, **options):
    """Run a command on a terminal until it says words, or a log (str) does; then Ctrl-C is pressed, it is closed,
    it gets a signal, or is killed. It must end with a status that says so and leave nothing behind; on a closed one we
    do not see when it has ended, so that has grace (s)."""
    before = machine.all()
    path = machine.path / (log or "none")[1:]
    if log and path.exists():
        path.unlink()
    process = machine.start(tutorial or machine.tutorial, *command, terminal=True, stdin=subprocess.PIPE, **options)
    if log:
        eventually(lambda: path.exists() and re.search(words, path.read_text(errors="replace"), re.M),
                   "/%s/ in %s" % (words, log), process, timeout=120)
    else:
        process.expect(words, 120)
    script = process.usage.children()[0]
    if how == "Ctrl-C":
        process.type("\003")
    elif how == "closed":
        script.kill()
    elif how == "TERM":
        script.children()[0].terminate()
    else:
        machine.run("sh", "-c", "kill -9 -1", user="root")
    status = process.wait(60)
    print(process)  # shown with a failure
    assert status < 0 or status > 128
    assert "did not come to its end" not in process.stdout
    eventually(lambda: machine.all().items() <= before.items(), "no more than %s" % before, machine,
               timeout=grace if how == "closed" else 2)


def test_no_command_or_an_unknown_one_prints_the_usage(machine):
    assert "tutorial demo" in machine.run(machine.tutorial).stdout
    assert "tutorial demo" in machine.run(machine.tutorial, "wash", status=2).stderr


# On a system without sudo, until a row lets learner use it; around(machine) may return a context.
@pytest.mark.parametrize("words, command, options, around", [
    pytest.param(words, command.split(), options, around, id=name) for name, words, command, options, around in [
        ("no master", "'local:1', must be like http", "demo", dict(ROS_MASTER_URI="local:1"), None),
        ("no sudo", "no sudo to install .*apt-get install", "demo", {}, None),
        ("a space", "set TUTORIAL_WS", "demo", dict(ROOTS, TUTORIAL_WS="/srv/a ws"), None),
        ("in the checkout", "set TUTORIAL_WS", "demo", dict(ROOTS, TUTORIAL_WS=CHECKOUT + "/ws"), None),
        ("not to be written", "set TUTORIAL_WS", "demo", dict(ROOTS, TUTORIAL_WS="/proc/workspace"), None),
        ("somebody else's, demo", "set TUTORIAL_WS", "demo", dict(ROOTS, TUTORIAL_WS="/home"), None),
        ("somebody else's, clean", "not a folder that", "clean", dict(ROOTS, TUTORIAL_WS="/home"), None),
        ("no such test", "no test/nosuch.test", "test nosuch", {}, None),
        ("too many words", "clean takes no argument, such as 'all'", "clean all", {}, None),
        ("no apt", "no apt-get .*docker run", "demo", ROOTS, lambda machine: machine.changed("/usr/bin/apt-get")),
        ("an apt that knows no ROS", "not know .*catkin.* container.*docker run .*%s.* debian:12 .*tutorial demo"
         % CHECKOUT, "demo", ROOTS, lambda machine: machine.changed(
             "/etc/apt/sources.list", "(?s).*", "deb [trusted=yes] file:/srv/empty ./\n")),
        ("no network", "connect this machine to the network", "demo", ROOTS, Machine.offline),
        ("a password", "asks for a password", "demo", {}, lambda machine: machine.let_sudo("ALL")),
        ("no network but lists", "connect this machine to the network", "demo", {},
         lambda machine: machine.let_sudo() or machine.offline())]])
def test_what_is_missing_or_wrong_is_named(machine, words, command, options, around):
    (machine.path / "srv/empty").mkdir(exist_ok=True)
    (machine.path / "srv/empty/Packages").touch()
    with around and around(machine) or contextlib.nullcontext():
        fails(machine, words, *command, **options)


@pytest.mark.parametrize("ros", ["noetic", "one"])
def test_a_ros_1_in_opt_is_taken_by_its_names(machine, sudo, ros):
    for name, version, python in ("humble", 2, 3), ("melodic", 1, 2), (ros, 1, 3):
        (machine.path / "opt/ros" / name).mkdir(parents=True)
        (machine.path / "opt/ros" / name / "setup.bash").write_text(
            "export ROS_VERSION=%d ROS_PYTHON_VERSION=%d\n" % (version, python))
    fails(machine, "does not know ros-%s-actionlib " % ros)
    machine.run("rm", "-r", "/opt/ros", user="root")


def test_lists_that_the_system_is_just_reading_itself_are_waited_for(machine, sudo):
    def read():
        with open(machine.path / "var/lib/apt/lists/lock", "w") as lock:
            fcntl.lockf(lock, fcntl.LOCK_EX)
            begun.set()
            eventually(lambda: log.exists() and "Could not get lock" in log.read_text(), "a try", timeout=120)

    begun, log, system = threading.Event(), machine.path / UPDATE[1:], threading.Thread(target=read)
    system.start()
    begun.wait()
    interrupted(machine, "Ctrl-C", "^(Get|Hit):", "demo", log=UPDATE)
    system.join()


@pytest.mark.parametrize("how, words", [
    ("Ctrl-C", "reading the list"), ("Ctrl-C", "^Get:"), ("TERM", "^Get:.*boost"), ("Power cut", "^Unpacking"),
    ("Ctrl-C", "^Unpacking"), ("Power cut", "^Setting up"), ("closed", "^Setting up")])
def test_interrupted_while_it_installs(machine, sudo, how, words):
    interrupted(machine, how, words, "demo", log="^" in words and INSTALL, grace=120)  # apt lets dpkg finish


@pytest.mark.parametrize("how", ["Ctrl-C", "TERM", "closed"])
def test_interrupted_while_it_builds_washes_and_tests_and_the_next_call_works(machine, ready, how):
    (machine.path / WORKSPACE[1:] / "built").unlink()
    interrupted(machine, how, "building in", "demo")
    interrupted(machine, how, "Generating", "demo", log=BUILD)
    interrupted(machine, how, "bowl-1", "demo")
    interrupted(machine, how, r"passed\]", "test", "units", "client")
    machine.run(machine.tutorial, "demo", "number_of_minutes:=1")


def test_two_at_once(machine, ready):
    (machine.path / WORKSPACE[1:] / "built").unlink()
    other = machine.start(machine.tutorial, "shell", "true")
    machine.run(machine.tutorial, "shell", "true")
    assert other.wait(60) == 0, str(other)


def test_what_runs_is_named_before_clean_or_a_new_build_takes_it_away(machine, ready):
    sleep = machine.start(machine.tutorial, "shell", "echo begun; exec sleep 1000")
    shell = machine.start(machine.tutorial, "shell", terminal=True, stdin=subprocess.PIPE)
    shell.type("echo begun\n")
    for process in sleep, shell:
        process.expect("^begun", 60)
    all_of_it = r"'sleep 1000' .process \d+., './tutorial shell' .process \d+.; .*exit in each shell"
    fails(machine, "cannot clean .*: " + all_of_it, "clean")
    with machine.changed(WORKSPACE + "/built"):
        fails(machine, "cannot build anew .*: " + all_of_it)
    machine.run(machine.tutorial, "shell", "true")  # which needs no new build
    for process in sleep, shell:
        process.stop()
    eventually(lambda: len(machine.all()) == 1, "an end of all of it", machine)


# The server may say last that the goal has ended; roslaunch says much after what a node says.
@pytest.mark.parametrize("argument, status, among, words, changed", [
    ("client:=no", 1, 1, "^no is not a 'bool' type$", []),
    ("number_of_minutes:=-3", 1, 2, "ABORTED.*number_of_minutes is -3, must be 0 or more", []),
    ("number_of_minutes:=x", 2, 2, "number_of_minutes is 'x', must be .*from the launch$", []),
    ("minutes:=3", 2, 1, "minutes:=3 .*number_of_minutes:=7", []),
    ("number_of_minutes:=7", 1, 1, "is neither a launch file", [CHECKOUT + "/launch/wash_the_dishes.launch"]),
    ("number_of_minutes:=7", 1, 99, "^no water$", [
        CHECKOUT + "/scripts/action_server.py", "(?s).*", "#!/usr/bin/python3\nraise SystemExit('no water')\n"])])
def test_the_demos_last_words_say_why_it_failed(machine, ready, argument, status, among, words, changed):
    with machine.changed(*changed) if changed else contextlib.nullcontext():
        said = machine.run(machine.tutorial, "demo", argument, status=status, stderr=subprocess.STDOUT)
    assert re.search(words, "\n".join(said.stdout.splitlines()[-among:]), re.M), str(said)


def test_a_master_that_never_answers_is_named(machine, ready):
    with bound_socket() as silent:
        silent.listen()
        uri = "http://localhost:%d" % silent.getsockname()[1]
        fails(machine, "^the master %s does not answer$" % uri, ROS_MASTER_URI=uri)


@pytest.mark.parametrize("uri, hostname", [
    ("http://127.0.0.1:11311", "localhost\n"), ("http://localhost:11311/", "localhost\n"),
    ("http://[::1]:11311", "localhost\n"), ("http://192.0.2.1:11311", None)])
def test_only_with_a_master_elsewhere_a_node_is_to_be_reached(machine, ready, uri, hostname):
    options = dict(ROS_MASTER_URI=uri, ROS_HOSTNAME=None, status=0 if hostname else 1)
    assert machine.run(machine.tutorial, "shell", "printenv", "ROS_HOSTNAME", **options).stdout == (hostname or "")


def test_a_second_call_builds_anew_only_with_another_genpy(machine, ready):
    with machine.changed("/var/lib/dpkg/status", r"(?ms)^(Package: python3-genpy$.*?^Version: \S+)", r"\1.1"):
        assert "building in" in machine.run(machine.tutorial, "shell", "true").stderr
    machine.run(machine.tutorial, "shell", "true")
    assert not re.search("building|installing", machine.run(machine.tutorial, "shell", "true").stderr)


def test_clean_that_cannot_remove(machine):
    machine.run("install", "-D", "/dev/null", "/srv/fixed/workspace/.actions_tutorial", user="root")
    machine.run("chown", "-R", "learner", "/srv/fixed/workspace", user="root")
    fails(machine, "not all .* is removed: .*Permission denied", "clean", TUTORIAL_WS="/srv/fixed/workspace")


@pytest.mark.parametrize("file, right, wrong, words", [
    ("CMakeLists.txt", r"\Z", 'message(FATAL_ERROR "broken")\n', "broken"),
    ("CMakeLists.txt", "FILES Wash", "FILES Washed", "action/WashedTheDishes.action' does not exist"),
    ("action/WashTheDishes.action", "int32", "int33", r"Cannot locate message .int33."),
    ("action/WashTheDishes.action", "---\n", "", "action/WashTheDishes.action: wrong number of pieces"),
    ("package.xml", "<depend>", "<depend", "package.xml.* not well-formed")])
def test_a_build_that_fails_names_the_mistake(machine, ready, file, right, wrong, words):
    with machine.changed("%s/%s" % (COPY, file), right, wrong):
        fails(machine, "^tutorial: the build failed: .*%s.* .more in " % words, tutorial=COPY + "/tutorial", **ROOTS)


def test_a_build_that_is_deaf(machine, ready):
    deaf = "execute_process(COMMAND sh -c \"trap '' INT TERM; echo deaf; sleep 1000\")\n"
    with machine.changed(COPY + "/CMakeLists.txt", r"\Z", deaf):
        interrupted(machine, "Ctrl-C", "deaf", "demo", log="/srv/deaf/log/build.log", tutorial=COPY + "/tutorial",
                    user="root", TUTORIAL_WS="/srv/deaf")


def test_a_build_that_is_mended_by_sh_tutorial_in_a_namespace(machine, ready):
    machine.run("sh", COPY + "/tutorial", "demo", "number_of_minutes:=1", ROS_NAMESPACE="/kitchen", **ROOTS)


def test_a_checkout_that_was_renamed(machine, ready):
    options = dict(user="root", TUTORIAL_WS=None)
    machine.run(COPY + "/tutorial", "shell", "true", **options)
    machine.run("mv", COPY, "/srv/after", user="root")
    machine.run("/srv/after/tutorial", "shell", "true", **options)
    machine.run("cp", "-r", "/srv/after", COPY, user="root")  # a new one in its place
    assert COPY == machine.run(
        COPY + "/tutorial", "shell", "realpath $(rospack find actions_tutorial)", **options).stdout.strip()
    machine.run("rm", "-r", COPY, user="root")
    machine.run("/srv/after/tutorial", "shell", "true", **options)
    # What stands on its old workspace finds the nodes.
    machine.run("bash", "-c", """for setup in ~/.cache/actions_tutorial/*/devel/setup.bash; do
        (source $setup && python3 -c 'from actions_tutorial import robust') || exit; done""", **options)
