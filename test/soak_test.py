#!/usr/bin/python3
"""The soak's short form; tools/soak without arguments is the long one."""
import os
import unittest

import rostest

from processes import Process


class Soak(unittest.TestCase):
    def test_short_soak(self):
        tool = os.path.join(os.path.dirname(os.path.realpath(__file__)), "..", "tools", "soak")
        soak = Process([tool, "--goals", "300"])
        self.addCleanup(soak.stop)
        self.assertEqual(soak.wait(120), 0, soak)
        self.assertIn("passed", soak.stdout, soak)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "soak", Soak)
