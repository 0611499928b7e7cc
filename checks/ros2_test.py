"""doc/ros2.md on real ROS 2: what the page saves is built with colcon, and its programs run. The wheels of ROS 2 Jazzy
come from pip, for Python 3.12; the command `ros2` is not among them, so the programs are started without it."""
import itertools
import os
import re
import shutil
import signal
import time

import pytest

from machines import Namespaces, find_python
from support.printed import bowls
from support.processes import Group, PACKAGE, run
from typist import edit, pattern_of, steps_of

pytestmark = pytest.mark.needs("root", "ip", "nsenter")
PAGE = "doc/ros2.md"
WHEELS = ["colcon-common-extensions"] + ["ros-jazzy-" + name for name in (
    "ament-cmake", "ament-cmake-gmock", "ament-cmake-gtest", "ament-cmake-include-directories", "ament-cmake-pytest",
    "ament-cmake-ros", "ament-package", "python-cmake-module", "rclpy[fastrtps]", "rosidl-core-generators",
    "rosidl-default-generators")]
# A small client; what it does is appended.
CLIENT = """
import os, rclpy, signal, time
from action_msgs.srv import CancelGoal
from dishes_interfaces.action import WashTheDishes
from rclpy.action import ActionClient
def value(future):
    rclpy.spin_until_future_complete(node, future)
    return future.result()
def send(number_of_minutes):
    return value(client.send_goal_async(WashTheDishes.Goal(number_of_minutes=number_of_minutes)))
def outcome(goal):
    return value(goal.get_result_async()).status
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
CLIENTS = pytest.mark.parametrize("name", ["action_client", "busy_client"])
# Runs a program with one text instead of another.
REPLACED = ("import sys; file, *texts = sys.argv[1:]; del sys.argv[1:]; exec(open(file).read().replace(*texts)); "
            "sys.exit(main())")


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
        for step in steps_of(PAGE):  # what a reader does, except for the commands that need ros2
            if isinstance(step, tuple):
                edit(step[0], self.home / step[1], step[2])
            elif re.match(r"\$ (mkdir|cp|touch|cd) ", step.typed):
                run(*self.clean, "bash", "-c", "cd '%s' && %s" % (PACKAGE, step.typed[2:]), timeout=300)

    def start(self, *command):
        """Start a command (str …) in a terminal that knows the workspace. -> Process"""
        source = 'source ~/dishes2_ws/install/setup.bash && exec "$@"'
        return super().start(*self.clean, "bash", "-c", source, "-", *command)

    def program(self, name, *replaced):
        """Start a program, with a text (str) in its source replaced by another (str) if they are given. -> Process"""
        file = str(self.home / "dishes2_ws/src/dishes/dishes" / name) + ".py"
        return self.start("python", "-c", REPLACED, file, *replaced) if replaced else self.start(self.programs + name)

    def server(self, name="action_server", *replaced):
        server = self.program(name, *replaced)
        server.expect("wash_dishes_as waits for goals")
        return server

    def washing_client(self):
        """Start a client of a long goal and wait for its second bowl. -> Process"""
        client = self.start(self.programs + "action_client", "60")
        client.expect("bowl-1")
        return client

    def do(self, what):
        """Let a small client do something (str, Python). Returns the lines (list of str) that it prints."""
        client = self.start("python", "-c", CLIENT + what)
        assert client.wait() == 0, str(client)
        return client.stdout.splitlines()


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    python = find_python("3.12") or pytest.skip("this needs a Python 3.12, as the wheels of ROS 2 Jazzy do")
    home = tmp_path_factory.mktemp("ros2")
    try:
        # A network and a shared memory of their own: nothing else is reached, and nothing stays of what is killed.
        with Namespaces("--net", "--mount") as namespaces:
            run(*namespaces.enter, "sh", "-c", "ip link set lo up && mount -t tmpfs tmpfs /dev/shm")
            yield Ros2(home, python, namespaces.enter)
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
    shown = sum((step.shown for step in itertools.takewhile(lambda step: not step.typed, steps)), next(steps).shown)
    came = client.stdout + client.stderr + "[ros2run]: Process exited with failure %d\n" % status * (status > 0)
    assert re.fullmatch("".join(map(pattern_of, shown)), came), "expected %s of %s" % (shown, client)


def test_goals_end_as_the_page_shows(ros2):
    server = ros2.server()
    for number, status in ("3", 0), ("-3", 1):
        client = ros2.start(ros2.programs + "action_client", number)
        check_output(client, status, "ros2 run dishes action_client " + number)
    server.expect(r"ERROR.* number_of_minutes is -3, must be 0 or more")


def test_goals_in_all_threads_hold_up_a_cancel(ros2):
    ros2.server()
    assert ros2.do("goals = [send(3) for _ in range(8)]; begun = time.monotonic(); cancel(goals[7].goal_id.uuid); "
                   "print(time.monotonic() - begun > 1)")[1:] == ["True"]


def test_short_server_gives_no_outcome_at_ctrl_c(ros2):
    server, client = ros2.server(), ros2.washing_client()
    server.signal(signal.SIGINT)
    assert client.wait() == 1 and client.stderr == "the server is gone\n", str(client)


def test_bare_return_ends_the_server(ros2):
    server = ros2.server("action_server", "return result  #", "return  #")
    ros2.start(ros2.programs + "action_client", "-3")
    assert server.wait() == -signal.SIGABRT and "Assertion" in server.stderr, str(server)


def test_refused_cancel_is_listed_and_the_next_goal_not_asked(ros2):
    ros2.server("action_server", "return CancelResponse.ACCEPT", "self.asked = getattr(self, 'asked', 0) + 1\n"
                "        return CancelResponse.REJECT if self.asked == 1 else CancelResponse.ACCEPT")
    assert ros2.do("goals = [send(4) for _ in range(3)]; cancel(); print(*map(outcome, goals))") == ["0 2", "4 4 5"]


def test_cancel_that_stops_no_goal_says_why(ros2):
    ros2.server()
    assert ros2.do("""
cancel(); cancel([1] * 16)
goal = send(5); cancel(goal.goal_id.uuid)
cancel(goal.goal_id.uuid); cancel()  # it is being cancelled
outcome(goal); cancel(goal.goal_id.uuid)""") == ["0 0", "2 0", "0 1", "3 0", "0 0", "3 0"]


@CLIENTS
def test_client_ends_when_a_new_server_does_not_know_its_goal(ros2, name):
    server = ros2.server()
    client = ros2.program(name, "+ 20", "* 0 + 9")
    client.expect("bowl-0")
    os.kill(server.usage.pid, signal.SIGKILL)
    ros2.server()
    # Mostly at its limit: it still sees a server. Sometimes it learns sooner that its own is gone.
    assert client.wait(30) == 1 and re.search("goal may go on|server is gone", client.stderr), str(client)


@pytest.mark.parametrize("server", ["action_server", "single_goal_server"])
def test_cancel_in_the_last_bowl_is_accepted_in_vain(ros2, server):
    ros2.server(server)
    assert ros2.do("goal = send(1); time.sleep(0.3); cancel(); print(outcome(goal))") == ["0 1", "4"]


def test_ctrl_c_in_the_client_cancels_its_goal(ros2):
    ros2.server()
    client = ros2.washing_client()
    client.signal(signal.SIGINT)
    check_output(client, 1, "ros2 run dishes action_client 60")


@CLIENTS
def test_ctrl_c_before_the_answer_cancels_the_goal(ros2, name):
    server = ros2.server("single_goal_server", "wanted =", "print('asked', flush=True); time.sleep(2); wanted =")
    client = ros2.program(name)
    server.expect("asked")
    client.signal(signal.SIGINT)
    client.wait()
    assert re.search(r"CANCELED|done: status 5, \[('bowl-0')?\]", client.stdout + client.stderr), str(client)


@CLIENTS
@pytest.mark.parametrize("presses, status", [(1, 1), (2, -signal.SIGINT)])
def test_ctrl_c_with_refused_cancel_ends_the_client_alone(ros2, name, presses, status):
    refused = ("self.number = getattr(self, 'number', 0) + 1\n"
               "        return CancelResponse.REJECT if self.number < 3 else CancelResponse.ACCEPT")
    ros2.server("single_goal_server", "return CancelResponse.ACCEPT", refused)
    client = ros2.start(ros2.programs + name, "60")  # busy_client sends a cancel of its own
    for number in range(presses):
        client.expect("bowl-%d" % number)
        client.signal(signal.SIGINT)
    assert client.wait(8) == status and ("may go on" in client.stderr) == (presses == 1), str(client)
    assert "0 1" in ros2.do("cancel(); cancel()"), "expected the goal to go on"


def test_ten_goals_end_soon_and_one_washes_at_a_time(ros2):
    ros2.server("single_goal_server")
    lines = ros2.do("""
bowls, ends, answers = [], {}, []
for number in range(10):
    answers.append(client.send_goal_async(WashTheDishes.Goal(number_of_minutes=4), feedback_callback=
                   lambda _, number=number: bowls.append((time.monotonic(), number))))
    time.sleep(0.02)
results = [value(answer).get_result_async() for answer in answers]
for number, result in enumerate(results):
    result.add_done_callback(lambda _, number=number: ends.update({number: time.monotonic()}))
print(*[value(result).status for result in results])
newest_start = min(begun for begun, number in bowls if number == 9)
print(max(ends[number] for number in range(9)) - newest_start < 2)
print(max(ends[number] for number in range(1, 9)) < newest_start)  # those that only waited
print(min(later - sooner for (sooner, _), (later, _) in zip(bowls, bowls[1:])) > 0.5)
""")
    assert lines == ["6 " * 9 + "4", "True", "True", "True"], lines


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("seconds", [1, 4])  # a bowl takes; the server spins for 2 s more
def test_server_aborts_its_goal_on_a_signal(ros2, number, seconds):
    server = ros2.server("single_goal_server", "seconds=1", "seconds=%d" % seconds)
    client = ros2.washing_client()
    server.signal(number)
    assert client.wait() == 1 and client.stderr == "ABORTED\n", str(client)
    feedback, result = [re.findall(r"bowl-\d+", part) for part in client.stdout.split("The result is: ")]
    assert feedback == result == bowls(len(result)) and len(result) >= 2, str(client)
    assert server.wait() == 0 and "Traceback" not in server.stderr, str(server)


def test_second_ctrl_c_ends_the_server_at_once(ros2):
    server = ros2.server("single_goal_server", "seconds=1", "seconds=9")
    ros2.start(ros2.programs + "action_client").expect("bowl-0")
    server.signal(signal.SIGINT)
    time.sleep(3)
    server.signal(signal.SIGINT)
    assert server.wait(3) == -signal.SIGINT, str(server)


def test_goal_after_ctrl_c_is_rejected(ros2):
    server = ros2.server("single_goal_server")
    assert ros2.do("print(send(0).accepted); os.kill(%d, signal.SIGINT); time.sleep(0.4); print(send(0).accepted)"
                   % server.usage.pid) == ["True", "False"]


def test_busy_client_counts_and_cancels(ros2):
    ros2.server("single_goal_server")
    check_output(ros2.program("busy_client"), 0, "ros2 run dishes busy_client")


def test_done_callbacks_work_in_a_node_that_spins(ros2):
    ros2.server()
    ros2.program("busy_client", "node.send_goal(60)", "node.create_timer(0.5, lambda: node.send_goal(1)); "
                 "rclpy.spin(node)").expect("done: status 4")


@pytest.mark.parametrize("call", ["value(client.send_goal_async(goal))", "client.send_goal(goal)"])
def test_waiting_in_a_callback_of_a_spinning_node_hangs(ros2, call):
    ros2.server()
    program = ros2.start("python", "-uc", CLIENT + "goal = WashTheDishes.Goal()\nnode.create_timer(0.1, lambda: ["
                         "print('asked'), %s, print('answered')])\nrclpy.spin(node)" % call)
    program.expect("asked")
    time.sleep(4)
    assert program.stdout == "asked\n" and program.running(), str(program)
