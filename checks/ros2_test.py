"""doc/ros2.md on real ROS 2: what the page saves is built with colcon, and its programs run. The wheels of ROS 2 Jazzy
come from pip, for Python 3.12; the command `ros2` is not among them, so the programs are started without it. The tests
of what the page changes come last: the changes stay."""
import glob
import itertools
import os
import re
import shutil
import signal
import subprocess

import pytest

from conftest import ROOT
from printed import bowls
from processes import Group, run
from typed_pages_test import edit, pattern_of, steps_of

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
PAGE = "doc/ros2.md"
WHEELS = ["colcon-common-extensions"] + ["ros-jazzy-" + name for name in (
    "ament-cmake", "ament-cmake-gmock", "ament-cmake-gtest", "ament-cmake-include-directories", "ament-cmake-pytest",
    "ament-cmake-ros", "ament-package", "python-cmake-module", "rclpy[fastrtps]", "rosidl-core-generators",
    "rosidl-default-generators")]
# A small client; what it does is appended.
CLIENT = """
import rclpy
from action_msgs.srv import CancelGoal
from dishes_interfaces.action import WashTheDishes
from rclpy.action import ActionClient

def value(future):
    rclpy.spin_until_future_complete(node, future)
    return future.result()

def send(number_of_minutes):
    return value(client.send_goal_async(WashTheDishes.Goal(number_of_minutes=number_of_minutes)))

def cancel(goal_id=[0] * 16):  # by default all goals, as the page's `ros2 service call` does
    request = CancelGoal.Request()
    request.goal_info.goal_id.uuid = goal_id
    answer = value(service.call_async(request))
    print(answer.return_code, len(answer.goals_canceling))

rclpy.init()
node = rclpy.create_node("client")
service = node.create_client(CancelGoal, "/wash_dishes_as/_action/cancel_goal")
client = ActionClient(node, WashTheDishes, "wash_dishes_as")
client.wait_for_server()
"""
# Runs a program with one text in place of another.
REPLACED = "import sys; exec(open(sys.argv[1]).read().replace(*sys.argv[2:])); main()"


def python_3_12():
    """Returns the path (str) of a Python 3.12, or None."""
    found = glob.glob(os.path.expanduser("~/.pyenv/versions/3.12*/bin/python3.12")) + [shutil.which("python3.12")]
    return next((path for path in filter(None, found) if not subprocess.call(
        [path, "-c", "import ensurepip, venv"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)), None)


class Ros2(Group):
    """A home (pathlib.Path) with a venv of ROS 2 in it, and the workspace of the page. enter: the command (list of str)
    that runs another one where its programs run."""

    def __init__(self, home, python, enter):
        super().__init__()
        self.home, self.programs = home, str(home / "dishes2_ws/install/dishes/lib/dishes") + "/"
        venv = home / "venv"
        run(python, "-m", "venv", str(venv), PYTHONPATH="")
        run(str(venv / "bin/pip"), "install", "-q", *WHEELS, PYTHONPATH="", timeout=600)
        # The wheels' CMake files name the folders of the Python that built them, and of its numpy.
        base, numpy = run(str(venv / "bin/python"), "-c", "import numpy, sys\nprint(sys.base_prefix)\n"
                          "print(numpy.get_include())", PYTHONPATH="").split()
        for file in venv.glob("share/*/cmake/*Export.cmake"):
            text = re.sub(r"/opt/python/cp312-cp312(/lib/[^;\"]*/numpy/_core/include)?",
                          lambda match: numpy if match.group(1) else base, file.read_text())
            file.write_text(text)
        # Nothing of ROS 1.
        self.clean = enter + ["env", "-i", "HOME=%s" % home, "PATH=%s/bin:/usr/bin:/bin" % venv, "LANG=C.UTF-8",
                              "AMENT_PREFIX_PATH=%s" % venv, "CMAKE_PREFIX_PATH=%s" % venv,
                              "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST"]
        steps = steps_of(PAGE)
        first = next(number for number, step in enumerate(steps) if isinstance(step, tuple) and step[0] == "Change")
        self.later = steps[first:]
        self.follow(steps[:first])

    def follow(self, steps):
        """Do what a reader does, but for the commands that need ros2."""
        for step in steps:
            if isinstance(step, tuple):
                edit(step[0], self.home / step[1], step[2])
            elif re.match(r"\$ (mkdir|cp|touch|cd|sed) ", step.typed):
                run(*self.clean, "bash", "-c", "cd '%s' && %s" % (ROOT, step.typed[2:]), timeout=300)

    def start(self, *command):
        """Start a command (str …) in a terminal that knows the workspace. -> Process"""
        source = 'source ~/dishes2_ws/install/setup.bash && exec "$@"'
        return super().start(*self.clean, "bash", "-c", source, "-", *command)

    def server(self, name="action_server", *replaced):
        """Start a server, with a text (str) in its source replaced by another (str) if they are given. -> Process"""
        file = str(self.home / "dishes2_ws/src/dishes/dishes" / name) + ".py"
        server = self.start("python", "-c", REPLACED, file, *replaced) if replaced else self.start(self.programs + name)
        server.expect("wash_dishes_as waits for goals")
        return server

    def client(self, number_of_minutes):
        return self.start(self.programs + "action_client", str(number_of_minutes))

    def washing_client(self):
        """Start a client of a long goal and wait for its second bowl. -> Process"""
        client = self.client(60)
        client.expect("bowl-1")
        return client

    def do(self, what):
        """Let a small client do something (str, Python). Returns the lines (list of str) that it prints."""
        client = self.start("python", "-c", CLIENT + what)
        assert client.wait() == 0, str(client)
        return client.stdout.splitlines()


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    python = python_3_12() or pytest.skip("this needs a Python 3.12, as the wheels of ROS 2 Jazzy do")
    home = tmp_path_factory.mktemp("ros2")
    try:
        with Group() as namespaces:
            # A network and a shared memory of their own: nothing else is reached, and nothing stays of what is killed.
            holder = namespaces.start("setpriv", "--pdeathsig", "KILL", "unshare", "--net", "--mount", "sh", "-c",
                                      "ip link set lo up && mount -t tmpfs tmpfs /dev/shm && echo there && "
                                      "exec sleep infinity")
            holder.expect("there")
            yield Ros2(home, python, ["nsenter", "--net", "--mount", "--target", str(holder.usage.pid)])
    finally:
        shutil.rmtree(str(home))


@pytest.fixture
def ros2(installed):
    with installed:
        yield installed


@pytest.fixture(scope="module")
def changed(installed):
    installed.follow(installed.later)


def check_output(client, status, typed):
    """Expect an exit status of a client (Process), and the output that the page shows below what is typed (str)."""
    assert client.wait() == status, "expected exit status %d of %s" % (status, client)
    steps = [step for step in steps_of(PAGE) if getattr(step, "terminal", "") == "2"]
    steps = itertools.dropwhile(lambda step: step.typed != "$ " + typed, steps)
    shown = list(next(steps).shown)
    for step in itertools.takewhile(lambda step: not step.typed, steps):
        shown += step.shown
    came = client.stdout + client.stderr + "[ros2run]: Process exited with failure %d\n" % status * (status > 0)
    assert re.fullmatch("".join(map(pattern_of, shown)), came), "expected %s of %s" % (shown, client)


def bowls_in(client):
    """Returns the bowls that a client (Process) has printed as feedback, and those of its result."""
    return [re.findall(r"bowl-\d+", part) for part in client.stdout.split("The result is: ")]


def check_stopped(client, outcome):
    """Expect that a client (Process) prints the bowls so far as its result, and an outcome (str)."""
    assert client.wait() == 1, str(client)
    feedback, result = bowls_in(client)
    assert feedback == result == bowls(len(result)) and 2 <= len(result) < 60, str(client)
    assert client.stderr == outcome + "\n", str(client)


def test_goals_end_as_the_page_shows(ros2):
    server = ros2.server()
    check_output(ros2.client(3), 0, "ros2 run dishes action_client 3")
    check_output(ros2.client(-3), 1, "ros2 run dishes action_client -3")
    server.expect(r"ERROR.* number_of_minutes is -3, must be 0 or more")


def test_cancelled_goal_has_its_partial_result(ros2):
    ros2.server()
    client = ros2.washing_client()
    newer = ros2.client(1)
    assert newer.wait() == 0 and client.running(), "expected a newer goal to run beside: %s\n%s" % (newer, client)
    assert ros2.do("cancel()") == ["0 1"]
    check_output(client, 1, "ros2 run dishes action_client 60")
    check_stopped(client, "CANCELED")


def test_ctrl_c_leaves_the_goal_as_the_page_says(ros2):
    server, client, other = ros2.server(), ros2.washing_client(), ros2.washing_client()
    client.signal(signal.SIGINT)
    assert client.wait() == 1, str(client)
    assert ros2.do("cancel()") == ["0 2"], "expected both goals to go on"
    check_stopped(other, "CANCELED")
    client = ros2.washing_client()
    server.signal(signal.SIGINT)
    assert server.wait() == 0 and client.running(), "expected no outcome: %s\n%s" % (server, client)


def test_refused_cancel_lists_goals_from_two_on(ros2):
    ros2.server("action_server", "cancel_callback=self.cancel_cb", "")
    assert ros2.do("""
goals = []
for _ in range(5):
    goals.append(send(5))
    cancel()
print([value(goal.get_result_async()).status for goal in goals])
""") == ["0 0", "0 1", "0 1", "0 2", "0 2", str([4] * 5)]


def test_cancel_that_stops_no_goal_says_why(ros2):
    ros2.server()
    assert ros2.do("""
cancel()
cancel([1] * 16)
goal = send(0)
value(goal.get_result_async())
cancel(goal.goal_id.uuid)
""") == ["0 0", "2 0", "3 0"]


def test_newer_goal_aborts_the_older_one(ros2):
    ros2.server("single_goal_server")
    older, newer = ros2.washing_client(), ros2.client(1)
    assert newer.wait() == 0 and bowls_in(newer) == [bowls(1), bowls(1)], str(newer)
    check_stopped(older, "ABORTED")
    refused = ros2.client(-3)
    assert refused.wait() == 1 and refused.stderr == "the server has refused the goal\n", str(refused)


def test_canceled_needs_a_cancel(ros2):
    server = ros2.server("action_server", "goal_handle.succeed()", "goal_handle.canceled()")
    client = ros2.client(1)
    assert client.wait() == 1 and bowls_in(client) == [bowls(1), []] and client.stderr == "ABORTED\n", str(client)
    server.expect("invalid transition from state EXECUTING with event CANCELED")
    server.stop()
    server = ros2.server("single_goal_server", "self.newest.abort", "self.newest.canceled")
    ros2.washing_client()
    ros2.client(1)
    server.expect(", in spin$")


def test_busy_client_counts_and_cancels(ros2):
    ros2.server("single_goal_server")
    check_output(ros2.start(ros2.programs + "busy_client"), 0, "ros2 run dishes busy_client")


def test_changed_client_cancels_at_ctrl_c(ros2, changed):
    ros2.server("single_goal_server")
    client = ros2.washing_client()
    client.signal(signal.SIGINT)
    check_stopped(client, "CANCELED")


def test_changed_server_aborts_at_ctrl_c(ros2, changed):
    server = ros2.server("single_goal_server")
    client = ros2.washing_client()
    server.signal(signal.SIGINT)
    check_stopped(client, "ABORTED")
    assert server.wait() == 0 and "Traceback" not in server.stderr, str(server)


def test_changed_client_notices_that_the_server_is_gone(ros2, changed):
    server = ros2.server()
    client = ros2.washing_client()
    server.signal(signal.SIGINT)
    assert client.wait() == 1 and client.stderr == "the server is gone\n", str(client)
