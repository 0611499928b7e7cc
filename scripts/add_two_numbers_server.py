#!/usr/bin/env python3
"""A service to compare with the action: one request, one response, and the caller waits for it."""
from actions_tutorial.srv import AddTwoNumbers, AddTwoNumbersResponse
import rospy


def add_two_numbers(request):
    """Returns the sum of request.a and request.b (float32)."""
    return AddTwoNumbersResponse(sum=request.a + request.b)


if __name__ == "__main__":
    rospy.init_node("add_two_numbers_server")
    rospy.Service("add_two_numbers", AddTwoNumbers, add_two_numbers)
    rospy.loginfo("add_two_numbers waits for calls")
    rospy.spin()
