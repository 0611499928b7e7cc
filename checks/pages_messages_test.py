"""doc/troubleshooting.md quotes tools as they speak: messages that are cheap to cause."""
import re
import subprocess

import pytest

from pages import text_of
from support.processes import PACKAGE

PYTHON = "python3 -c '%s'"
LAUNCH = "printf '%s' > f.launch; roslaunch f.launch %s"
FIELD = PYTHON % 'import genmsg; genmsg.msg_loader.load_msg_from_string(genmsg.MsgContext(), "%s", "a/B")'
BUILD = "mkdir src; cd src; catkin_create_pkg laundry; printf '%s' > laundry/CMakeLists.txt; cd ..; catkin_make"
CMAKE = "cmake_minimum_required(VERSION 3.10)\\nproject(%s)\\nfind_package(catkin REQUIRED)\\n%s\\ncatkin_package()\\n"
COMMANDS = {  # by the message that each of them causes
    "package '…' not found": "rosrun laundry laundry_server.py",
    "Couldn't find executable named": "rosrun rospy nothing.py",
    "setup.bash: No such file or directory": "source devel/setup.bash",
    "No module named '…'": PYTHON % "import laundry",
    "Type is not an action spec": PYTHON % 'import actionlib, rospy; actionlib.ActionClient("a", rospy.Header)',
    "time is not initialized": PYTHON % "import rospy; rospy.Time.now()",
    "takes 1 positional argument but 2 were given": PYTHON % "(lambda msg: 0)(3, None)",
    "Missing parentheses in call to 'print'": PYTHON % "print 1",
    "name '…' is not defined": PYTHON % "xrange",
    "must be an integer type": PYTHON % "import io, std_msgs.msg as m; m.Int32(0.5).serialize(io.BytesIO())",
    "Invalid declaration": FIELD % "int32",
    "is not a legal message field name": FIELD % "int32 number-of",
    "no such option: -1": "rosservice call /a -1 2",
    "Invalid roslaunch XML syntax": LAUNCH % ("<launch>", ""),
    "requires the '…' arg to be set":
        LAUNCH % ('<launch><arg name="a" /><param name="b" value="$(arg a)" /></launch>', ""),
    "input files do not exist": LAUNCH % ("<launch />", "minutes=2"),
    "must be invoked in the root of workspace": "catkin_create_pkg laundry; cd laundry; catkin_make",
    "does not match current PROJECT_NAME": BUILD % CMAKE % ("washing", ""),
    "Unknown CMake command": BUILD % CMAKE % ("laundry", "add_action_files()"),
    "Unable to communicate with master": "ROS_MASTER_URI=http://localhost:1 rostopic list",
}


@pytest.mark.parametrize("words", COMMANDS)
def test_message(words, tmp_path):
    assert "`%s" % words in text_of("doc/troubleshooting.md")
    command = [PACKAGE + "/tutorial", "ros", "exec 2>&1; cd '%s'; %s" % (tmp_path, COMMANDS[words])]
    output = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, timeout=60).stdout
    pattern = re.escape(words).replace("…", ".*").replace(r"\ ", r"\s+")  # CMake breaks lines
    assert re.search(pattern, output), output
