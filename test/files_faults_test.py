#!/usr/bin/python3
"""No place for the log, or no right to write one: the nodes run, or say in one line what is wrong."""
import os
import stat
import subprocess
import unittest

import rostest
from fault_case import bowls, concurrently, printed_bowls
from harness import Master


@concurrently
class FilesFaults(unittest.TestCase):
    def washes(self, master, *prefix, **env):
        """Server and client do their work. prefix: of their command."""
        node = list(prefix) + ["rosrun", "actions_tutorial"]
        server = master.process(*node, "action_server.py", **env)
        client = master.process(*node, "action_client.py", "_number_of_minutes:=2", "_heartbeat_timeout:=20", **env)
        self.assertEqual(client.wait(), 0, "%s\n%s" % (client, server))
        self.assertEqual(printed_bowls(client), (bowls(2), bowls(2)), client)
        self.assertTrue(server.running(), server)
        return client, server

    def test_disk_of_the_log_full(self):
        # In a mount namespace of each node's own, so that it goes with the node.
        inside = ["unshare", "--mount"] + ([] if os.geteuid() == 0 else ["--map-root-user"])
        if subprocess.call(inside + ["mount", "-t", "tmpfs", "tmpfs", "/mnt"], stderr=subprocess.DEVNULL):
            self.skipTest("needs the right to mount a small tmpfs: root, or user namespaces")
        with Master() as master:
            full = 'mount -t tmpfs -o size=64k tmpfs "$ROS_LOG_DIR" && cat /dev/zero > "$ROS_LOG_DIR/zero"; exec "$@"'
            for node in self.washes(master, *inside, "sh", "-c", full, "sh"):
                self.assertEqual(node.stderr.count("cannot log to"), 1, node)
                self.assertNotIn("Traceback", node.stderr, node)

    def test_device_of_the_log_full(self):
        with Master() as master:
            for node in "action_server", "action_client":
                os.symlink("/dev/full", os.path.join(master.env["ROS_LOG_DIR"], node + ".log"))
            for node in self.washes(master):
                self.assertNotIn("Traceback", node.stderr, node)

    def test_ros_home_not_writable(self):
        with Master() as master:
            home = os.path.join(master.home, "in a file")  # nobody can write there, not even root
            with open(home, "w"):
                os.chmod(home, stat.S_IRUSR)
            for node in self.washes(master, ROS_HOME=home, ROS_LOG_DIR=os.path.join(home, "log")):
                self.assertEqual(node.stderr.count("cannot create log directory"), 1, node)
                self.assertNotIn("Traceback", node.stderr, node)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "files_faults", FilesFaults)
