"""doc/ros2.md on real ROS 2: what the page saves is built with colcon, and its programs run. The wheels of ROS 2 Jazzy
come from pip, for Python 3.12; the command `ros2` is not among them, so the programs are started without it."""
import glob
import itertools
import os
import re
import shutil
import signal
import subprocess

import pytest

from conftest import ROOT
from harness import Group, bowls, run
from typed_pages_test import edit, pattern_of, steps_of

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
PAGE = "doc/ros2.md"
WHEELS = ["colcon-common-extensions"] + ["ros-jazzy-" + name for name in (
    "ament-cmake", "ament-cmake-gmock", "ament-cmake-gtest", "ament-cmake-include-directories", "ament-cmake-pytest",
    "ament-cmake-ros", "ament-package", "python-cmake-module", "rclpy[fastrtps]", "rosidl-core-generators",
    "rosidl-default-generators")]
# Cancels all goals, as the page's `ros2 service call` does, and prints how many will stop.
CANCEL = """
import rclpy
from action_msgs.srv import CancelGoal
rclpy.init()
node = rclpy.create_node("cancel")
client = node.create_client(CancelGoal, "/wash_dishes_as/_action/cancel_goal")
client.wait_for_service()
future = client.call_async(CancelGoal.Request())
rclpy.spin_until_future_complete(node, future)
print(len(future.result().goals_canceling))
"""


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
        for step in steps_of(PAGE):
            if not isinstance(step, tuple):
                if re.match(r"\$ (mkdir|cp|touch|cd) ", step.typed):
                    run(*self.clean, "bash", "-c", "cd '%s' && %s" % (ROOT, step.typed[2:]), timeout=300)
            elif step[0] == "Save this":
                edit(step[0], home / step[1], step[2])

    def start(self, *command):
        """Start a command (str …) in a terminal that knows the workspace. -> Process"""
        source = 'source ~/dishes2_ws/install/setup.bash && exec "$@"'
        return super().start(*self.clean, "bash", "-c", source, "-", *command)

    def server(self):
        server = self.start(self.programs + "action_server")
        server.expect("wash_dishes_as waits for goals")
        return server

    def client(self, number_of_minutes):
        return self.start(self.programs + "action_client", str(number_of_minutes))

    def cancel(self):
        """Cancel all goals. Returns how many will stop."""
        cancel = self.start("python", "-c", CANCEL)
        assert cancel.wait() == 0, str(cancel)
        return int(cancel.stdout)


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


def test_goals_end_as_the_page_shows(ros2):
    server = ros2.server()
    check_output(ros2.client(3), 0, "ros2 run dishes action_client 3")
    check_output(ros2.client(-3), 1, "ros2 run dishes action_client -3")
    server.expect(r"ERROR.* number_of_minutes is -3, must be 0 or more")


def test_cancelled_goal_has_its_partial_result(ros2):
    ros2.server()
    client = ros2.client(60)
    client.expect("bowl-1")
    newer = ros2.client(1)
    assert newer.wait() == 0 and client.running(), "expected a newer goal to run beside: %s\n%s" % (newer, client)
    assert ros2.cancel() == 1
    check_output(client, 1, "ros2 run dishes action_client 60")
    feedback, result = bowls_in(client)
    assert feedback == result == bowls(len(result)) and 2 <= len(result) < 60, str(client)


def test_ctrl_c_leaves_the_goal_as_the_page_says(ros2):
    server, client, other = ros2.server(), ros2.client(60), ros2.client(60)
    for one in client, other:
        one.expect("bowl-0")
    client.signal(signal.SIGINT)
    assert client.wait() == 1, str(client)
    assert ros2.cancel() == 2, "expected both goals to go on"
    assert other.wait() == 1
    client = ros2.client(60)
    client.expect("bowl-0")
    server.signal(signal.SIGINT)
    assert server.wait() == 0 and client.running(), "expected no outcome: %s\n%s" % (server, client)


def test_cancel_is_refused_without_cancel_callback(ros2):
    change, = (step for step in steps_of(PAGE) if isinstance(step, tuple) and step[0] == "Change")
    edit(change[0], ros2.home / change[1], change[2])
    run(*ros2.clean, "bash", "-c", "cd ~/dishes2_ws && colcon build --packages-select dishes")
    ros2.server()
    client = ros2.client(4)
    client.expect("bowl-1")
    assert ros2.cancel() == 0
    assert client.wait() == 0 and bowls_in(client) == [bowls(4), bowls(4)], str(client)
