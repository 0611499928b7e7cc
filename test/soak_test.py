#!/usr/bin/python3
"""The soak's short form; test/soak without arguments is the long one."""
import os
import unittest

import rostest
from harness import Process


class Soak(unittest.TestCase):
    def test_short_soak(self):
        with Process([os.path.join(os.path.dirname(os.path.abspath(__file__)), "soak"), "--goals", "300"]) as soak:
            self.assertEqual(soak.wait(120), 0, soak)
            self.assertIn("passed", soak.stdout, soak)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "soak", Soak)
