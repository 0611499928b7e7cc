#!/usr/bin/python3
"""The service to compare the action with: one call, one answer, and the caller waits for it."""
import struct

from actions_tutorial import robust  # first, or an early Ctrl-C leaves a traceback
from actions_tutorial.srv import AddTwoNumbers, AddTwoNumbersResponse
import rospy


def add_two_numbers(request):
    """Add request.a and request.b (float32). A sum that float32 cannot hold is an error, whose text the caller gets."""
    total = request.a + request.b
    try:
        struct.pack("<f", total)  # as rospy will, whose error names no number
    except OverflowError:
        raise rospy.ServiceException("%g + %g is %g, must be within ±3.4e+38 (float32)" % (request.a, request.b, total))
    return AddTwoNumbersResponse(sum=total)


if __name__ == "__main__":
    robust.init_node("add_two_numbers_server")
    rospy.Service("add_two_numbers", AddTwoNumbers, add_two_numbers)
    rospy.loginfo("add_two_numbers waits for calls")
    rospy.spin()
