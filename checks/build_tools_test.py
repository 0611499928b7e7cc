"""The package built by each build tool of ROS 1, with the system's python3 first on the PATH or a foreign one; and used
from the install space after the sources are gone."""
import os
import re
import shutil

import pytest

from conftest import ROOT
from support.printed import bowls, check_client, printed_bowls
from support.processes import Process, run

TOOLS = {  # the commands, and the space that they fill
    "catkin_make": (["catkin_make"], "devel"),
    "catkin_make install": (["catkin_make install"], "install"),
    "catkin_make_isolated": (["catkin_make_isolated --install"], "install_isolated"),
    "catkin build": (["catkin config --install", "catkin build --no-status --no-color --verbose"], "install")}
SYSTEM = "/usr/bin:/bin"
# Debian 13's catkin goes by the second name, all others by the first; CMake is not to complain of the unused one.
FOREIGN = ("--cmake-args -DPYTHON_EXECUTABLE=/usr/bin/python3 -DPython_EXECUTABLE=/usr/bin/python3"
           " --no-warn-unused-cli")
# A terminal of somebody who has no workspace, or one: TERMINAL PATH SETUP-OR-NOTHING COMMAND…
TERMINAL = ["env", "-u", "CMAKE_PREFIX_PATH", "-u", "PYTHONPATH", "-u", "ROS_PACKAGE_PATH",
            "CMAKE_POLICY_VERSION_MINIMUM=3.5", "bash", "-c",
            """PATH=$0 setup=$1; shift; for setup in $setup /opt/ros/{noetic,one}/setup.bash; do
            if [[ -f $setup ]]; then command=("$@"); set --; source "$setup"; set -- "${command[@]}"; break; fi
            done; exec "$@" """]


@pytest.fixture(scope="module", params=["system", "foreign"])
def path(request, tmp_path_factory):
    """A PATH whose first python3 is the system's, or one that knows nothing of ROS."""
    if request.param == "system":
        return SYSTEM
    folder = tmp_path_factory.mktemp("foreign")
    run("/usr/bin/python3", "-m", "venv", "--without-pip", str(folder))
    return "%s/bin:%s" % (folder, SYSTEM)


@pytest.mark.parametrize("tool", TOOLS)
def test_it_builds_without_a_warning_and_runs(tool, path, master, tmp_path):
    commands, space = TOOLS[tool]
    if not shutil.which(tool.split()[0]):
        pytest.skip("this needs %s" % tool.split()[0])
    folder = str(tmp_path)
    shutil.copytree(ROOT, folder + "/src/actions_tutorial", ignore=shutil.ignore_patterns(".git"))
    for command in commands:
        more = FOREIGN if "foreign" in path and command == commands[0] else ""
        build = Process([*TERMINAL, path, "", *(command + " " + more).split()], cwd=folder)
        assert build.wait(300) == 0, str(build)
        # Not ours: line 4 of catkin's own CMakeLists.txt, which newer CMakes find too old; nor what setuptools says, in
        # forms of its own, of setup.py install, which is how catkin installs a Python module.
        output = (build.stdout + build.stderr).replace("Warning at CMakeLists.txt:4 (cmake_minimum_required)", "")
        assert not re.search("CMake (Deprecation )?Warning|WARNING|: warning:", output), str(build)
    for other in set(os.listdir(folder)) - {space} if space != "devel" else ():
        run("rm", "-rf", os.path.join(folder, other))

    # An installed node runs with the python3 that is first on the PATH, as in every ROS package.
    terminal = [*TERMINAL, path if space == "devel" else SYSTEM, os.path.join(folder, space, "setup.bash")]
    messages = run(*terminal, "rosmsg", "list")
    assert len(re.findall("^actions_tutorial/WashTheDishes", messages, re.M)) == 7, messages
    server = master.start(*terminal, "rosrun", "actions_tutorial", "action_server.py")
    client = master.start(*terminal, "rosrun", "actions_tutorial", "action_client.py", "1")
    # Its result only: actionlib's client may miss the first feedback on a busy machine.
    assert (client.wait(), printed_bowls(client)[1]) == (0, bowls(1)), str(client)
    server.signal(2)
    server.wait()
    check_client(master.start(*terminal, "roslaunch", "actions_tutorial", "wash_the_dishes.launch",
                              "number_of_minutes:=1", "robust:=true"), 0, 1)
