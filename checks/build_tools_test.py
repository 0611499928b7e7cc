"""The package built by each build tool that ROS 1 users have, with the system's python3 and with a foreign one first on
the PATH; used from each install space after every source is gone."""
import os
import re
import shutil

import pytest

from conftest import ROOT
from harness import Process, check_client, run

TOOLS = {  # the commands, and the space that they fill
    "catkin_make": (["catkin_make"], "devel"),
    "catkin_make install": (["catkin_make install"], "install"),
    "catkin_make_isolated": (["catkin_make_isolated --install"], "install_isolated"),
    "catkin build": (["catkin config --install", "catkin build --no-status --no-color --verbose"], "install")}
# Debian 13's catkin goes by the second name, all others by the first; CMake is not to complain of the unused one.
FOREIGN = ("--cmake-args -DPYTHON_EXECUTABLE=/usr/bin/python3 -DPython_EXECUTABLE=/usr/bin/python3"
           " --no-warn-unused-cli")
# A terminal that knows one setup.bash, or else no workspace yet: TERMINAL ROOT FIRST-ON-PATH SETUP-OR-NOTHING COMMAND…
TERMINAL = ["bash", "-c", """source "$0/tools/environment.bash"; system_environment; PATH=$1${1:+:}$PATH
setup=${2:-$(opt_ros)}; [[ ! $setup ]] || source_setup "$setup"; exec "${@:3}" """, ROOT]


@pytest.fixture(scope="module", params=["system", "foreign"])
def path(request, tmp_path_factory):
    """What is first on the PATH: a real python3, but one that knows nothing of ROS; or nothing."""
    if request.param == "system":
        return ""
    folder = tmp_path_factory.mktemp("foreign")
    run("/usr/bin/python3", "-m", "venv", "--without-pip", str(folder))
    return str(folder / "bin")


@pytest.mark.parametrize("tool", TOOLS)
def test_what_it_builds_without_a_warning_is_run_by_rosrun_and_roslaunch(tool, path, master, tmp_path):
    commands, space = TOOLS[tool]
    if not shutil.which(tool.split()[0]):
        pytest.skip("this needs %s" % tool.split()[0])
    folder = str(tmp_path)
    shutil.copytree(ROOT, folder + "/src/actions_tutorial", ignore=shutil.ignore_patterns(".git"))
    for command in commands:
        more = FOREIGN if path and command == commands[0] else ""
        build = Process([*TERMINAL, path, "", *(command + " " + more).split()], cwd=folder)
        assert build.wait(300) == 0, str(build)
        # Not ours: line 4 of catkin's own CMakeLists.txt, which newer CMakes find too old; nor what setuptools says, in
        # forms of its own, of setup.py install, which is how catkin installs a Python module.
        said = (build.stdout + build.stderr).replace("Warning at CMakeLists.txt:4 (cmake_minimum_required)", "")
        assert not re.search("CMake (Deprecation )?Warning|WARNING|: warning:", said), str(build)
    for other in set(os.listdir(folder)) - {space} if space != "devel" else ():
        run("rm", "-rf", os.path.join(folder, other))

    terminal = [*TERMINAL, path, os.path.join(folder, space, "setup.bash")]
    messages = run(*terminal, "rosmsg", "list")
    assert len(re.findall("^actions_tutorial/WashTheDishes", messages, re.M)) == 7, messages
    server = master.start(*terminal, "rosrun", "actions_tutorial", "action_server.py")
    check_client(master.start(*terminal, "rosrun", "actions_tutorial", "action_client.py", "_number_of_minutes:=1"),
                 0, 1)
    server.signal(15)
    assert server.wait() == 0, str(server)
    check_client(master.start(*terminal, "roslaunch", "actions_tutorial", "wash_the_dishes.launch",
                              "number_of_minutes:=1"), 0, 1)
    shutil.rmtree(folder)
