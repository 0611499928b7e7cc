"""How ./tutorial fails and is interrupted, on one bare machine: each check finds it as the one before has left it."""
import contextlib
import re
import subprocess

import pytest

from conftest import Machine
from support.processes import eventually

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")
CHECKOUT, WORKSPACE = "/srv/actions_tutorial", "/home/learner/workspace"
ACTION, CMAKE = CHECKOUT + "/action/WashTheDishes.action", CHECKOUT + "/CMakeLists.txt"


@pytest.fixture(scope="module")
def machine(debian):
    with Machine(debian("bookworm"), "learner", CHECKOUT) as machine:
        # An Ubuntu to all that ask; what counts is what apt knows.
        (machine.path / "usr/lib/os-release").write_text('ID=ubuntu\nVERSION_ID="24.04"\n')
        machine.env["TUTORIAL_WS"] = WORKSPACE
        yield machine


@pytest.fixture
def ready(machine):
    machine.let_sudo()
    machine.run(machine.tutorial, "shell", "true")


def fails(machine, words, *command, **options):
    """The last line on stderr says why."""
    process = machine.start(machine.tutorial, *(command or ["demo"]), **options)
    assert process.wait(600) > 0, "expected a failure of %s" % process
    assert re.search("^tutorial: .*" + words, process.stderr.splitlines()[-1]), "expected /%s/ of %s" % (words, process)


def interrupted(machine, words, *command, log=None):
    """Press Ctrl-C when the command or its log (str) says words (regex). Nothing of it may be left."""
    before = machine.processes_in_it()
    path = machine.path / "home/learner/workspace/log" / (log or "none")
    process = machine.start(machine.tutorial, *command, terminal=True, stdin=subprocess.PIPE)
    eventually(lambda: re.search(words, path.read_text(errors="replace") if path.exists() else process.stdout, re.M),
               words, process, timeout=300)
    process.type("\003")
    assert process.wait(300) > 0, str(process)
    eventually(lambda: machine.processes_in_it().items() <= before.items(), "no more than %s" % before, machine)


def test_an_unknown_command_prints_the_usage(machine):
    assert "tutorial demo" in machine.run(machine.tutorial, "wash", status=2).stderr


@pytest.mark.parametrize("command", ["demo -h", "test --help", "ros -h", "shell -h", "benchmark 1 -h", "clean -h"])
def test_help_after_a_command_starts_nothing(machine, command):
    shown = machine.run(machine.tutorial, *command.split(), TUTORIAL_WS="/home/learner/help").stdout
    assert shown.startswith("./tutorial " + command.split()[0]) and not (machine.path / "home/learner/help").exists()


# On a system without sudo, until a row lets learner use it; around(machine) may return a context.
@pytest.mark.parametrize("words, command, options, around", [
    pytest.param(words, command.split(), options, around, id=name) for name, words, command, options, around in [
        ("no sudo", "sudo is needed .*apt-get install", "demo", {}, None),
        ("read-only", "set TUTORIAL_WS", "demo", dict(user="root", TUTORIAL_WS="/proc/workspace"), None),
        ("another folder", "not a folder that", "clean", dict(user="root", TUTORIAL_WS="/home"), None),
        ("no such test", "there is no test nosuch, but these: action client ", "test nosuch", {}, None),
        ("no apt", "no apt-get .*docker run", "demo", {}, lambda machine: machine.changed("/usr/bin/apt-get")),
        ("no network", "connect this machine to the network", "demo", dict(user="root", TUTORIAL_WS="/srv/ws"),
         Machine.offline),
        ("a password", "sudo is needed", "demo", {}, lambda machine: machine.let_sudo("ALL")),
        ("no ROS in apt", "not know .*catkin.* container.*docker run .*%s.* debian:12 .*tutorial demo" % CHECKOUT,
         "demo", dict(user="root", TUTORIAL_WS="/srv/ws"), lambda machine: machine.changed(
             "/etc/apt/sources.list", lambda _: "deb [trusted=yes] file:/srv/empty ./\n"))]])
def test_what_is_missing_is_named(machine, words, command, options, around):
    (machine.path / "srv/empty").mkdir(exist_ok=True)
    (machine.path / "srv/empty/Packages").touch()
    with around and around(machine) or contextlib.nullcontext():
        fails(machine, words, *command, **options)


@pytest.mark.parametrize("ros", ["noetic", "one"])
def test_ros_in_opt_is_used(machine, ros):
    machine.let_sudo()
    (machine.path / "opt/ros" / ros).mkdir(parents=True)
    (machine.path / "opt/ros" / ros / "setup.bash").touch()
    fails(machine, "does not know .*ros-%s-actionlib " % ros)
    machine.run("rm", "-r", "/opt/ros", user="root")


def test_ctrl_c_while_it_installs_and_builds(machine):
    machine.let_sudo()
    interrupted(machine, "^Get:", "demo", log="install.log")
    interrupted(machine, "^Unpacking", "demo", log="install.log")
    interrupted(machine, "Generating", "demo", log="build.log")
    machine.run(machine.tutorial, "demo", "1")


def test_ctrl_c_in_demo_and_test(machine, ready):
    interrupted(machine, "bowl-1", "demo")
    interrupted(machine, r"passed\]", "test", "action", "robust_action")


def test_two_set_ups_at_once(machine, ready):
    (machine.path / WORKSPACE[1:] / "built").unlink()
    other = machine.start(machine.tutorial, "shell", "true")
    machine.run(machine.tutorial, "shell", "true")
    assert other.wait(60) == 0, str(other)


@pytest.mark.parametrize("arguments, status, words", [
    (["2"], 0, "- bowl-1$"), (["-3"], 1, "^ABORTED: number_of_minutes is -3"),
    (["seven"], 2, "invalid int value: 'seven'$"), (["1", "2"], 2, "unrecognized arguments: 2$")])
def test_demo_has_the_clients_arguments_and_status(machine, ready, arguments, status, words):
    demo = machine.run(machine.tutorial, "demo", *arguments, status=status, stderr=subprocess.STDOUT)
    assert re.search(words, demo.stdout, re.M) and len(demo.lines) < 20, str(demo)
    assert len(machine.processes_in_it()) == 1, str(machine)


def test_demo_disturbs_no_master_and_needs_no_address(machine, ready):
    demo = machine.run(machine.tutorial, "demo", "1", ROS_IP="192.0.2.1", ROS_MASTER_URI="http://192.0.2.1:11311")
    assert "- bowl-0" in demo.stdout


def test_nothing_is_built_beneath_tests(machine, ready):
    tests = machine.start(machine.tutorial, "test", "service")
    tests.expect("testing")
    assert machine.start(machine.tutorial, "shell", "true").wait(10) == 0 and tests.running(), str(tests)
    with machine.changed(CMAKE, lambda text: text + "# changed\n"):
        shell = machine.start(machine.tutorial, "shell", "true")
        shell.expect("waiting for another ./tutorial")
        assert tests.wait(300) == 0, str(tests)
        assert shell.wait(300) == 0 and "building in" in shell.stderr, str(shell)


def test_demo_ends_when_its_server_does(machine, ready):
    with machine.changed(CHECKOUT + "/scripts/action_server.py", lambda _: "raise SystemExit('no water')\n"):
        fails(machine, "the server ended")


def test_shell_runs_a_command_and_nothing_else(machine, ready):
    shell = machine.run(machine.tutorial, "shell", "printenv ROS_HOSTNAME; exit 7", status=7)
    assert (shell.stdout, shell.stderr) == ("localhost\n", "")
    shell = machine.run(machine.tutorial, "shell", "printenv", "ROS_IP", "ROS_HOSTNAME", status=1, ROS_IP="192.0.2.1")
    assert (shell.stdout, shell.stderr) == ("192.0.2.1\n", "")


@pytest.mark.parametrize("file, change, words", [
    (CMAKE, lambda text: text + 'message(FATAL_ERROR "broken")\n', "broken"),
    (CMAKE, lambda text: text.replace("FILES Wash", "FILES Washed"), "Assertion failed: file .*/WashedTheDishes"),
    (ACTION, lambda text: text.replace("---\n", "", 1), "WashTheDishes.action: wrong number of pieces")])
def test_a_build_that_fails_names_the_mistake(machine, ready, file, change, words):
    with machine.changed(file, change):
        fails(machine, "the build failed: .*%s.* .more in " % words)
    assert "building in" in machine.run(machine.tutorial, "shell", "true").stderr
