"""How ./tutorial fails and is interrupted, on one bare machine: each check finds it as the previous one left it."""
import re
import subprocess

import pytest

from machines import Machine
from support.processes import eventually

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")
CHECKOUT = "/srv/actions_tutorial"


@pytest.fixture(scope="module")
def machine(debian):
    with Machine(debian("bookworm"), "learner", CHECKOUT) as machine:
        # Everything that asks takes it for an Ubuntu; what counts is what apt knows.
        (machine.path / "usr/lib/os-release").write_text('ID=ubuntu\nVERSION_ID="24.04"\n')
        yield machine


@pytest.fixture
def ready(machine):
    machine.let_sudo()
    machine.run(machine.tutorial, "shell", "true")


def fails(machine, words, *command, by=(), **options):
    """The last line on stderr says why. by: words (str) before ./tutorial. Returns what words (regex) found."""
    process = machine.start(*by, machine.tutorial, *command, **options)
    assert process.wait(600) > 0, "expected a failure of %s" % process
    found = re.search("^tutorial: .*" + words, process.stderr.splitlines()[-1])
    assert found, "expected /%s/ of %s" % (words, process)
    return found


def interrupted(machine, words, *command):
    """Press Ctrl-C when a line of the command holds words (regex). Nothing of it may be left."""
    before = machine.processes_in_it()
    process = machine.start(machine.tutorial, *command, terminal=True, stdin=subprocess.PIPE)
    process.expect(words, timeout=300)
    process.type("\003")
    assert process.wait(300) > 0, str(process)
    eventually(lambda: machine.processes_in_it().items() <= before.items(), "no more than %s" % before, machine)


def test_an_unknown_command_prints_the_usage(machine):
    assert "tutorial demo" in machine.run(machine.tutorial, "wash", status=2).stderr


@pytest.mark.parametrize("command", ["demo -h", "test --help", "ros -h", "shell -h", "benchmark 1 -h", "clean -h"])
def test_help_after_a_command_starts_nothing(machine, command):
    shown = machine.run(machine.tutorial, *command.split(), TUTORIAL_WS="/home/learner/help").stdout
    assert shown.startswith("./tutorial demo") and not (machine.path / "home/learner/help").exists()


# There is no sudo until a check needs it.
@pytest.mark.parametrize("words, command, options", [
    pytest.param("sudo is needed .*apt-get install", "demo", {}, id="no sudo"),
    pytest.param("connect this machine to the network", "demo", dict(user="root", offline=True), id="no network"),
    pytest.param("set TUTORIAL_WS", "demo", dict(user="root", TUTORIAL_WS="/proc/ws"), id="read-only"),
    pytest.param("not created by", "clean", dict(user="root", TUTORIAL_WS="/home"), id="not its folder"),
    pytest.param("there is no test nosuch; there are: action ", "test nosuch", {}, id="no such test")])
def test_what_is_missing_is_named(machine, words, command, options):
    fails(machine, words, *command.split(), **options)


def test_a_repository_without_its_key_is_named(machine):
    machine.run("rm", "-r", "/var/lib/apt/lists", user="root")  # it would go by these
    other = "deb [signed-by=/usr/share/keyrings/debian-archive-bookworm-security-automatic.gpg] "
    with machine.changed("/etc/apt/sources.list", lambda text: text.replace("deb ", other)):
        fails(machine, "key has expired or is missing.* not know .*catkin .*NO_PUBKEY", "demo", user="root")


@pytest.mark.parametrize("file, change, words", [
    ("/usr/bin/apt-get", None, "no apt-get .*"),
    ("/etc/apt/sources.list", lambda text: text.replace(" main", " contrib"), "not know .*catkin.* container.*")],
    ids=["no apt", "no ROS in apt"])
def test_a_system_that_cannot_have_ros_gets_a_container(machine, file, change, words):
    with machine.changed(file, change):
        fails(machine, words + "docker run .*%s.* debian:12 .*tutorial demo" % CHECKOUT, "demo", user="root")


def test_sudo_that_asks_for_a_password_is_named(machine):
    machine.let_sudo("ALL")
    fails(machine, "sudo is needed", "demo")


def test_root_in_a_users_home_is_told_to_go_without_sudo(machine):
    machine.let_sudo()
    fails(machine, "run it without sudo", "demo", by=["sudo", "HOME=/home/learner"])


def test_ros_one_in_opt_is_used(machine):
    machine.let_sudo()
    (machine.path / "opt/ros/one").mkdir(parents=True)
    (machine.path / "opt/ros/one/setup.bash").touch()
    fails(machine, "does not know .*ros-one-actionlib ", "demo")
    machine.run("rm", "-r", "/opt/ros", user="root")


def test_ctrl_c_while_it_installs_and_builds(machine):
    machine.let_sudo()
    for words in "^Get:.* g[+][+]", "^Unpacking", "^.*Generating":
        interrupted(machine, words, "demo")
    machine.run(machine.tutorial, "demo", "1")


@pytest.mark.parametrize("words, command", [("bowl-1", "demo"), (r"passed\]", "test service action")])
def test_ctrl_c_in_demo_and_test(machine, ready, words, command):
    interrupted(machine, words, *command.split())


@pytest.mark.parametrize("minutes, status, words", [
    ("1", 0, "- bowl-0$"), ("-3", 1, "^ABORTED: number_of_minutes is -3")], ids=["succeeds", "aborts"])
def test_demo_has_the_clients_status_whatever_the_address(machine, ready, minutes, status, words):
    demo = machine.run(machine.tutorial, "demo", minutes, status=status, stderr=subprocess.STDOUT, ROS_IP="192.0.2.1",
                       ROS_MASTER_URI="http://192.0.2.1:11311")
    assert re.search(words, demo.stdout, re.M), str(demo)
    assert len(machine.processes_in_it()) == 1, str(machine)


def test_demo_ends_when_its_server_does(machine, ready):
    with machine.changed(CHECKOUT + "/scripts/action_server.py", lambda _: "raise SystemExit('no water')\n"):
        fails(machine, "the server ended", "demo")


def test_nothing_is_built_beneath_tests(machine, ready):
    tests = machine.start(machine.tutorial, "test", "service")
    tests.expect("testing")
    assert machine.start(machine.tutorial, "shell", "true").wait(10) == 0 and tests.running(), str(tests)
    with machine.changed(CHECKOUT + "/CMakeLists.txt", lambda text: text + "# changed\n"):
        shell = machine.start(machine.tutorial, "shell", "true")
        shell.expect("waiting for another ./tutorial")
        assert tests.wait(300) == 0, str(tests)
        assert shell.wait(300) == 0 and "building in" in shell.stderr, str(shell)


@pytest.mark.parametrize("place", ["", "/actions_tutorial/*/devel"])
def test_a_folder_that_is_roots_is_given_back(machine, ready, place):
    machine.run("sh", "-c", "chown -R root /home/learner/.cache" + place, user="root")
    chown = fails(machine, "cannot write to .*: (sudo chown [^.]*[.]cache')[.] ", "shell", "true").group(1)
    machine.run("sh", "-c", chown)
    machine.run(machine.tutorial, "shell", "true")


def test_clean_beside_a_waiting_command_spares_it(machine, ready):
    clean = machine.start("sh", "-c", "mkdir ~/ws; flock ~/ws sh -c 'echo locked; read _; rm -r ~/ws'",
                          stdin=subprocess.PIPE)
    clean.expect("locked")
    shell = machine.start(machine.tutorial, "shell", "true", TUTORIAL_WS="/home/learner/ws")
    shell.expect("waiting for another")
    clean.type("\n")
    assert shell.wait(300) == 0 and len(shell.stderr.splitlines()) == 2 and "building in" in shell.stderr, str(shell)


def test_help_in_a_command_is_the_commands(machine, ready):
    assert "Mounted on" in machine.run(machine.tutorial, "ros", "df -h /").stdout


@pytest.mark.parametrize("command, address", [
    (["printenv ROS_HOSTNAME; exit 7"], "localhost"), (["sh", "-c", "echo $ROS_IP$ROS_HOSTNAME; exit 7"], "192.0.2.1")])
def test_shell_runs_a_command_and_nothing_else(machine, ready, command, address):
    env = {} if address == "localhost" else {"ROS_IP": address}
    shell = machine.run(machine.tutorial, "shell", *command, status=7, **env)
    assert (shell.stdout, shell.stderr) == (address + "\n", "")


@pytest.mark.parametrize("file, change, words", [
    ("/CMakeLists.txt", lambda text: text.replace("FILES Wash", "FILES Washed"), "Assertion failed: .*WashedTheDishes"),
    ("/action/WashTheDishes.action", lambda text: text.replace("---\n", "", 1), "action: wrong number of pieces")])
def test_a_build_that_fails_names_the_mistake(machine, ready, file, change, words):
    with machine.changed(CHECKOUT + file, change):
        fails(machine, "the build failed: .*%s.* .more in " % words, "demo")
    assert "building in" in machine.run(machine.tutorial, "shell", "true").stderr
