#!/usr/bin/python3
"""The service adds in float32, says so when float32 cannot hold the sum, and goes on."""
import unittest

import rospy
import rostest
from actions_tutorial.srv import AddTwoNumbers


class TestService(unittest.TestCase):

    def test_overflow_is_an_error_reply_and_all_other_sums_are_those_of_float32(self):
        rospy.init_node("service_test")
        rospy.wait_for_service("/add_two_numbers", 30)
        add = rospy.ServiceProxy("/add_two_numbers", AddTwoNumbers)
        for a in (3e38, -3e38):
            with self.assertRaises(rospy.ServiceException) as reply:
                add(a, a)
            for word in ("%g" % a, "%g" % (2 * a), "float32"):
                self.assertIn(word, str(reply.exception))
        for a, b, total in (
                (1.5, 2.25, 3.75), (-1.5, -2.25, -3.75), (-5, 5, 0), (0, 0, 0), (3e38, -3e38, 0),
                (0.1, 0.2, 0.30000001192092896),  # float32 of the sum of both as float32
                (16777216, 1, 16777216),  # float32 has 24 bits
                (float("inf"), 1, float("inf"))):
            self.assertEqual(total, add(a, b).sum, "%r + %r" % (a, b))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "service", TestService)
