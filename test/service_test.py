#!/usr/bin/python3
"""The service adds in float32, says so when float32 cannot hold the sum, and goes on."""
import struct
import unittest

import rospy
import rostest
from actions_tutorial.srv import AddTwoNumbers


def float32(number):
    return struct.unpack("<f", struct.pack("<f", number))[0]


class TestService(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("service_test")
        rospy.wait_for_service("/add_two_numbers", 30)
        cls.add = rospy.ServiceProxy("/add_two_numbers", AddTwoNumbers)

    def test_sums(self):
        for a, b, total in (
                (1.5, 2.25, 3.75), (-1.5, -2.25, -3.75), (-5, 5, 0), (0, 0, 0), (3e38, -3e38, 0),
                (0.1, 0.2, float32(float32(0.1) + float32(0.2))),
                (16777216, 1, 16777216),  # float32 has 24 bits
                (float("inf"), 1, float("inf"))):
            self.assertEqual(total, self.add(a, b).sum, "%r + %r" % (a, b))

    def test_overflow_is_an_error_reply_and_the_server_goes_on(self):
        for a in (3e38, -3e38):
            with self.assertRaises(rospy.ServiceException) as reply:
                self.add(a, a)
            for word in ("%g" % a, "%g" % (2 * a), "float32"):
                self.assertIn(word, str(reply.exception))
            self.assertEqual(3.75, self.add(1.5, 2.25).sum)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "service", TestService)
