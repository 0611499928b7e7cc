"""A ROS in /opt/ros/noetic that no package has installed: Debian's own, moved there. Another roscore is in /usr/bin."""
import subprocess

import pytest

from machines import Machine
from support.printed import bowls, printed_bowls

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")
MOVE = r"""
set -e -o pipefail
mkdir -p /overlay/src && cd /overlay
catkin_make -DCMAKE_INSTALL_PREFIX=/opt/ros/noetic install  # for the setup.bash
cd /usr
dpkg-query -W -f '${source:Package} ${Package}\n' | sed -n '/^ros-\(catkin-pkg\|rospkg\) /d; s/^ros-[a-z-]* //p' |
    xargs dpkg -L | sed -n 's,^/usr/,,p' | sort -u | while read -r f; do [[ -d $f ]] || echo "$f"; done > /files
tar -cT /files | tar -xC /opt/ros/noetic
xargs rm < /files
printf '#!/bin/sh\necho another\n' | install /dev/stdin /usr/bin/roscore
cd /opt/ros/noetic
find -name '*.cmake' -exec sed -i 's,\([ ("]\)/usr\b,\1/opt/ros/noetic,g' {} +
cd share && mkdir actionlib
sed s/std_msgs/actionlib/ std_msgs/package.xml > actionlib/package.xml  # Debian's has none
source /opt/ros/noetic/setup.bash
rm -r /overlay/[bd]*
catkin_make -C /overlay
"""
TYPE = "type -a roscore | head -n 1"
SOURCE = "source /overlay/devel/setup.bash\n"


@pytest.fixture(scope="module")
def machine(debian):
    with Machine(debian("bookworm")) as machine:
        machine.run(machine.tutorial, "ros", "bash", "-c", MOVE)
        yield machine


def test_demo_and_tests_run_without_a_package_of_noetic(machine):
    assert printed_bowls(machine.run(machine.tutorial, "demo", "1"))[1] == bowls(1)
    machine.run(machine.tutorial, "test", "service")


def test_only_what_is_missing_is_asked_for(machine):
    with machine.changed("/opt/ros/noetic/share/message_runtime/package.xml"):
        process = machine.run(machine.tutorial, "ros", "true", status=1)
    assert "does not know ros-noetic-message-runtime ," in process.stderr, str(process)


def test_command_finds_the_roscore_of_the_sourced_ros(machine):
    process = machine.run("bash", "-c", SOURCE + machine.tutorial + " ros '%s'" % TYPE)
    assert process.stdout == "roscore is /opt/ros/noetic/bin/roscore\n", str(process)


def test_shell_finds_the_roscore_of_the_ros_in_bashrc(machine):
    with machine.changed("/root/.bashrc", lambda text: text + SOURCE):
        shell = machine.start(machine.tutorial, "ros", terminal=True, stdin=subprocess.PIPE)
        shell.type(TYPE + "\nexit\n")
        shell.expect("^roscore is /opt/ros/noetic/bin/roscore")
        shell.wait()
