"""A client in C++. (rostopic and rosbag are in doc/recording.md.)"""
import pytest

from support.processes import PACKAGE, run


@pytest.fixture(scope="module")
def cpp_client(workspace):
    folder = str(workspace / "cpp")
    run("cmake", "-S", PACKAGE + "/checks/cpp_client", "-B", folder)
    run("cmake", "--build", folder)
    return folder + "/cpp_client"


@pytest.mark.needs("cmake")
@pytest.mark.parametrize("arguments, state", [(["2"], "SUCCEEDED"), (["60", "2"], "PREEMPTED")])
def test_cpp_client_gets_feedback_and_result(cpp_client, master, arguments, state):
    master.node("robust_action_server.py")
    assert run(cpp_client, *arguments, **master.env) == (
        "feedback bowl-0\nfeedback bowl-1\n%s bowl-0 bowl-1\n" % state)
