"""Clients that are not this package's: C++ and axclient.py. (rostopic and rosbag are in doc/recording.md.)"""
import os
import re

import pytest

from support.printed import bowls
from support.processes import eventually, run

HERE = os.path.dirname(os.path.realpath(__file__))
# axclient.py: its window's size, and its parts' places in it, pixels from the top
WIDTH, HEIGHT = 420, 480
GOAL, FEEDBACK, RESULT, SEND = 60, 190, 320, 395


@pytest.fixture
def served(workspace, master):
    """A master with a server on it."""
    master.node("robust_action_server.py")
    return master


@pytest.fixture(scope="module")
def cpp_client(workspace):
    for arguments in ["-S", os.path.join(HERE, "cpp_client"), "-B", workspace / "cpp"], ["--build", workspace / "cpp"]:
        run("cmake", *map(str, arguments))
    return str(workspace / "cpp" / "cpp_client")


@pytest.mark.needs("cmake")
@pytest.mark.parametrize("arguments, state", [(["2"], "SUCCEEDED"), (["60", "2"], "PREEMPTED")])
def test_cpp_client_gets_feedback_and_result(cpp_client, served, arguments, state):
    assert run(cpp_client, *arguments, **served.env) == (
        "feedback bowl-0\nfeedback bowl-1\n%s bowl-0 bowl-1\n" % state)


@pytest.mark.needs("Xvfb", "xdotool", "xclip")
def test_axclient_sends_a_goal_and_shows_the_result(served):
    screen = served.start("Xvfb", "-displayfd", "1", "-screen", "0", "%dx%dx24" % (WIDTH, HEIGHT), "-nolisten", "tcp")
    display = {"DISPLAY": ":" + screen.expect(r"^(\d+)$").group(1)}
    gui = served.start("rosrun", "actionlib_tools", "axclient.py", "/wash_dishes_as", **display)

    def xdotool(*words):
        return run("xdotool", *map(str, words), **display)

    def click(y, *words):
        xdotool("mousemove", "--window", window, WIDTH // 2, y, "click", 1, *words)

    def text_of_box(y):
        click(y, "key", "ctrl+a", "ctrl+c", "End")
        return run("xclip", "-o", "-selection", "clipboard", **display)

    window = xdotool("search", "--sync", "--onlyvisible", "--name", "GUI Client").split()[0]
    xdotool("windowsize", "--sync", window, WIDTH, HEIGHT)
    eventually(lambda: re.search(r"topic: /wash_dishes_as/result\n +\* to: /axclient",
                                 run("rosnode", "info", "/robust_action_server", **served.env)), "it connected", gui)
    click(GOAL, "key", "ctrl+a", "type", "number_of_minutes: 3")
    eventually(lambda: text_of_box(GOAL).strip() == "number_of_minutes: 3", "the goal in its box", gui)
    click(SEND)
    # First the feedback: of a box that is empty nothing is copied, and what was copied last comes again.
    eventually(lambda: "bowl-2" in text_of_box(FEEDBACK), "the last bowl in the feedback's box", gui)
    eventually(lambda: re.findall(r"bowl-\d+", text_of_box(RESULT)) == bowls(3), "the bowls in the result's box", gui)
