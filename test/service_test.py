#!/usr/bin/env python3
"""The service, to compare with the action."""
import unittest

from actions_tutorial.srv import AddTwoNumbers
from parameterized import parameterized
import rospy
import rosservice
import rostest

from support.processes import Group


class TestService(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        rospy.init_node("service_test")
        cls.add_two_numbers = rospy.ServiceProxy("add_two_numbers", AddTwoNumbers)
        cls.add_two_numbers.wait_for_service(10)

    @parameterized.expand([
        ("positive", 1.5, 2.25, 3.75), ("negative", 1.5, -2.25, -0.75), ("many_decimals", 1.5, 2**-20, 1.5 + 2**-20),
        ("large", 1e30, 0, 1.0000000150474662e+30), ("small", 2**-24, 2**-24, 2**-23)])
    def test_sum(self, _, a, b, total):
        self.assertEqual(total, self.add_two_numbers(a, b).sum)

    def test_server_goes_on_after_a_sum_that_float32_cannot_hold(self):
        with self.assertRaises(rospy.ServiceException):
            self.add_two_numbers(3e38, 3e38)
        self.assertEqual(3, self.add_two_numbers(1, 2).sum)

    def test_node_in_a_namespace(self):
        with Group() as group:
            server = group.node("add_two_numbers_server.py", ROS_NAMESPACE="/shop", PYTHONUNBUFFERED="1")
            server.expect("add_two_numbers waits for calls")
            self.assertEqual("/shop/add_two_numbers_server",
                             rosservice.get_service_node("/shop/add_two_numbers"))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "service", TestService)
