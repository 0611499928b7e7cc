"""doc/troubleshooting.md quotes tools as they speak: messages that are easy to cause."""
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
    "missing 1 required positional argument": PYTHON % "(lambda number_of_minutes: 0)()",
    "cannot unpack non-iterable": PYTHON % "a, b = 3",
    "cannot assign to expression": PYTHON % "last-dish = 3",
    "'module' object is not callable": PYTHON % "import std_msgs.msg._String as String; String()",
    "has no attribute '_request_class'":
        PYTHON % 'import rospy, rospy.msg; rospy.ServiceProxy("a", rospy.msg)',
    "is not a class": PYTHON % 'import rospy, std_msgs.msg; rospy.Publisher("a", std_msgs.msg)',
    "ROS time moved backwards": PYTHON % 'import rospy; raise rospy.exceptions.ROSTimeMovedBackwardsException(1)',
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
    "missing required attribute": LAUNCH % ('<launch><node pkg="a" name="c" /></launch>', ""),
    "Unknown substitution command": LAUNCH % ('<launch><node pkg="$(finds a)" type="b" name="c" /></launch>', ""),
    "multiple nodes named": LAUNCH % ('<launch>%s</launch>' % (2 * '<node pkg="a" type="b" name="c" />'), ""),
    "Invalid roslaunch XML syntax: [Errno 2]": LAUNCH % ('<launch><include file="/a.launch" /></launch>', ""),
    "unused args […] for include": "echo '<launch />' > g.launch; " + LAUNCH % (
        '<launch><include file="g.launch"><arg name="a" value="" /></include></launch>', ""),
    "ResourceNotFound": "echo '<launch />' > f.test; rostest f.test",
    "input files do not exist": LAUNCH % ("<launch />", "minutes=2"),
    "does not contain a CMakeLists.txt file":
        "mkdir src; cd src; catkin_create_pkg laundry; rm laundry/CMakeLists.txt; cd ..; catkin_make",
    "must be invoked in the root of workspace": "catkin_create_pkg laundry; cd laundry; catkin_make",
    "does not match current PROJECT_NAME": BUILD % CMAKE % ("washing", ""),
    "Could not find a package configuration file provided by":
        BUILD % CMAKE % ("laundry", "find_package(catkin REQUIRED COMPONENTS actionlib_messages)"),
    "Unknown CMake command": BUILD % CMAKE % ("laundry", "add_action_files()"),
    "$'\\r': command not found": r"printf '\r\n' > f; bash f",
    "required file not found": r"printf '#!/usr/bin/bash\r\n' > f; chmod +x f; ./f",
    "cancel: command not found": "cancel",
    "Unable to communicate with master": "ROS_MASTER_URI=http://localhost:1 rostopic list",
}


@pytest.mark.parametrize("words", COMMANDS)
def test_message(words, tmp_path):
    assert "`%s" % words in text_of("doc/troubleshooting.md")
    command = [PACKAGE + "/tutorial", "ros", "exec 2>&1; cd '%s'; %s" % (tmp_path, COMMANDS[words])]
    output = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, timeout=60).stdout
    pattern = re.escape(words).replace("…", ".*").replace(r"\ ", r"\s+")  # CMake breaks lines
    assert re.search(pattern, output), output
