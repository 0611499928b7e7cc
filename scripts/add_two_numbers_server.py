#!/usr/bin/python3
"""The service to compare the action with: one call, one answer, and the caller waits for it."""
import struct

import rospy

from actions_tutorial import steady
from actions_tutorial.srv import AddTwoNumbers, AddTwoNumbersResponse


def add_two_numbers(request):
    """Add request.a and request.b (float32). Raises rospy.ServiceException if float32 cannot hold the sum."""
    total = request.a + request.b
    try:
        struct.pack("<f", total)
    except OverflowError:
        raise rospy.ServiceException(
            "%g + %g is %g, allowed is what float32 holds, up to 3.4e+38" % (request.a, request.b, total))
    return AddTwoNumbersResponse(sum=total)


if __name__ == "__main__":
    try:
        steady.init_node("add_two_numbers_server")
        rospy.Service("add_two_numbers", AddTwoNumbers, add_two_numbers)
        rospy.loginfo("add_two_numbers waits for calls")
        rospy.spin()
    except rospy.ROSException:  # shut down before it was up
        pass
    steady.leave(0)
