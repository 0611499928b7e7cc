#!/usr/bin/python3
"""No place for the log, or no right to write one: the nodes run, or say in one line what is wrong."""
import os
import stat
import subprocess
import unittest

import rostest

from scenes import check_quiet, concurrently
from processes import Master, check_client


@concurrently(Master)
class LogFaults(unittest.TestCase):

    def washes(self, master, *prefix, words=None, **env):
        """Server and client do their work, and say the words (str) in one line each. prefix: of their command."""
        command = [*prefix, "rosrun", "actions_tutorial"]
        server = master.start(*command, "action_server.py", **env)
        client = master.start(*command, "action_client.py", "_number_of_minutes:=2", "_heartbeat_timeout:=20", **env)
        check_client(client, 0, 2)
        self.assertTrue(server.running(), server)
        check_quiet(client, server)
        for node in client, server:
            self.assertTrue(words is None or node.stderr.count(words) == 1, "expected one '%s' of %s" % (words, node))

    def test_disk_of_the_log_full(self, master):
        # In a mount namespace of each node's own, so that it goes with the node.
        inside = ["unshare", "--mount"] + ([] if os.geteuid() == 0 else ["--map-root-user"])
        if subprocess.call(inside + ["mount", "-t", "tmpfs", "tmpfs", "/mnt"], stderr=subprocess.DEVNULL):
            self.skipTest("needs the right to mount a small tmpfs: root, or user namespaces")
        full = 'mount -t tmpfs -o size=64k tmpfs "$ROS_LOG_DIR" && cat /dev/zero > "$ROS_LOG_DIR/zero"; exec "$@"'
        self.washes(master, *inside, "sh", "-c", full, "sh", words="cannot log to")

    def test_device_of_the_log_full(self, master):
        for node in "action_server", "action_client":
            os.symlink("/dev/full", os.path.join(master.env["ROS_LOG_DIR"], node + ".log"))
        self.washes(master)

    def test_ros_home_not_writable(self, master):
        home = os.path.join(master.home, "in a file")  # nobody can write there, not even root
        with open(home, "w"):
            os.chmod(home, stat.S_IRUSR)
        self.washes(master, words="cannot create log directory", ROS_HOME=home,
                    ROS_LOG_DIR=os.path.join(home, "log"))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "log_faults", LogFaults)
