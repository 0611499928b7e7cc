#!/usr/bin/python3
"""The soak's short form; tools/soak without arguments is the long one."""
import os
import unittest

import rostest

from processes import PACKAGE, Process


class Soak(unittest.TestCase):
    def test_short_soak(self):
        soak = Process([os.path.join(PACKAGE, "tools", "soak"), "--goals", "300"])
        self.addCleanup(soak.stop)
        self.assertEqual(soak.wait(120), 0, soak)
        self.assertIn("passed", soak.stdout, soak)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "soak", Soak)
