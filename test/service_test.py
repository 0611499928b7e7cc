#!/usr/bin/env python3
"""The service to compare the action with."""
import unittest

from actions_tutorial.srv import AddTwoNumbers
import rospy
import rostest


class TestService(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("service_test")
        cls.add_two_numbers = rospy.ServiceProxy("add_two_numbers", AddTwoNumbers)
        cls.add_two_numbers.wait_for_service(10)

    def test_sum_of_two_numbers(self):
        self.assertEqual(3.75, self.add_two_numbers(1.5, 2.25).sum)

    def test_sum_with_a_negative_number(self):
        self.assertEqual(-0.75, self.add_two_numbers(1.5, -2.25).sum)

    def test_server_goes_on_after_a_sum_that_float32_cannot_hold(self):
        with self.assertRaises(rospy.ServiceException):
            self.add_two_numbers(3e38, 3e38)
        self.assertEqual(3, self.add_two_numbers(1, 2).sum)


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "service", TestService)
