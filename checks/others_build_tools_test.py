"""The package built by each build tool of ROS 1, with the system's python3 first on the PATH or a foreign one; and used
from the install space after the sources are gone. With the Python of ROS Noetic, 3.8, all rostests."""
import os
import pathlib
import re
import shutil

import pytest

from count_results import main as count_results
from machines import copy_package, find_python
from support.printed import bowls, printed_bowls
from support.processes import PACKAGE, Process, run

SYSTEM = "/usr/bin:/bin"
# Debian 13's catkin goes by the second name, all others by the first; CMake should not complain about the unused one.
FOREIGN = ("--cmake-args -DPYTHON_EXECUTABLE=/usr/bin/python3 -DPython_EXECUTABLE=/usr/bin/python3"
           " --no-warn-unused-cli")


@pytest.fixture(scope="module", params=["system", "foreign"])
def path(request, tmp_path_factory):
    """A PATH whose first python3 is the system's, or one that knows nothing of ROS."""
    if request.param == "system":
        return SYSTEM
    folder = tmp_path_factory.mktemp("foreign")
    run("/usr/bin/python3", "-m", "venv", "--without-pip", str(folder))
    return "%s/bin:%s" % (folder, SYSTEM)


def terminal(path, setup="/dev/null"):
    """Returns the command (list of str) that runs another one in a terminal with a PATH, which knows no workspace but
    that of a setup.bash (its path, str)."""
    return ["env", "-u", "CMAKE_PREFIX_PATH", "-u", "PYTHONPATH", "-u", "ROS_PACKAGE_PATH", "PATH=" + path,
            "CMAKE_POLICY_VERSION_MINIMUM=3.5", "bash", "-c", 'source "$0" "" && exec "$@"', setup]


@pytest.mark.parametrize("space, commands", [
    ("devel", ["catkin_make"]),
    ("install", ["catkin_make install"]),
    ("install_isolated", ["catkin_make_isolated --install"]),
    ("install", ["catkin config --install", "catkin build --no-status --no-color --verbose"])],
    ids=["catkin_make", "catkin_make install", "catkin_make_isolated", "catkin build"])
def test_it_builds_without_a_warning_and_runs(space, commands, path, master, tmp_path):
    if not shutil.which(commands[0].split()[0]):
        pytest.skip("this needs " + commands[0].split()[0])
    copy_package(tmp_path / "src/actions_tutorial")
    for command in commands:
        more = FOREIGN if path != SYSTEM and command == commands[0] else ""
        build = Process([*terminal(path), *(command + " " + more).split()], cwd=str(tmp_path))
        assert build.wait(300) == 0, str(build)
        # Not ours: line 4 of catkin's own CMakeLists.txt, which newer CMakes find too old; nor what setuptools says, in
        # forms of its own, of setup.py install, which is how catkin installs a Python module.
        output = (build.stdout + build.stderr).replace("Warning at CMakeLists.txt:4 (cmake_minimum_required)", "")
        assert not re.search("CMake (Deprecation )?Warning|WARNING|: warning:", output), str(build)
    if space != "devel":
        for other in set(os.listdir(str(tmp_path))) - {space}:
            run("rm", "-rf", str(tmp_path / other))

    # An installed node runs with the python3 that is first on the PATH, as in every ROS package.
    user = terminal(path if space == "devel" else SYSTEM, str(tmp_path / space / "setup.bash"))
    messages = run(*user, "rosmsg", "list")
    assert len(re.findall("^actions_tutorial/WashTheDishes", messages, re.M)) == 7, messages
    for robust in "false", "true":
        client = master.start(*user, "roslaunch", "actions_tutorial", "wash_the_dishes.launch", "number_of_minutes:=1",
                              "robust:=" + robust)
        # The result only: actionlib's client may miss the first feedback on a busy machine.
        assert (client.wait(), printed_bowls(client)[1]) == (0, bowls(1)), str(client)


def test_rostests_pass_on_python_3_8(tmp_path):
    python = find_python("3.8") or pytest.skip("this needs a Python 3.8")
    run(python, "-m", "venv", str(tmp_path / "venv"), PYTHONPATH="")
    python = str(tmp_path / "venv/bin/python3")
    # Debian's rospy goes by these, which are not all Python.
    run(python, "-m", "pip", "install", "-q", "netifaces", "numpy", "psutil", "PyYAML", PYTHONPATH="", timeout=300)
    (tmp_path / "venv/lib/python3.8/site-packages/debian.pth").write_text("/usr/lib/python3/dist-packages\n")
    copy_package(tmp_path / "src/actions_tutorial")
    run(*terminal("%s/venv/bin:%s" % (tmp_path, SYSTEM)), "catkin_make", "-C", str(tmp_path), "-DPYTHON_EXECUTABLE=" +
        python, "-DCATKIN_ENABLE_TESTING=ON", "-j2", "run_tests", timeout=1200, ROS_HOME=str(tmp_path / "home"),
        ROS_HOSTNAME="localhost")
    assert count_results(str(tmp_path / "build/test_results")) == 0


def test_tutorial_installs_what_package_xml_names():
    named, installed = (
        set(re.findall(words, pathlib.Path(PACKAGE, file).read_text(encoding="utf-8"))) for file, words in (
            ("package.xml", "<test_depend>(python3-.*)</"), ("tutorial", r"python3-[\w-]+")))
    assert named <= installed
