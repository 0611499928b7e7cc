# SPDX-License-Identifier: BSD-3-Clause
"""A rate for the work on a goal: its sleep() ends at once when the goal should stop.

Undocumented members of rospy that are used:
* rospy.rostime.get_rostime_cond(), a condition that each message of /clock notifies, since no other wait on the ROS
  clock can be ended by another thread; rospy.rostime.is_wallclock().
* last_time and sleep_dur of rospy.Rate, which sleep() advances as rospy's own does.
"""
from __future__ import annotations

import threading
from typing import Any, Callable

import rospy

_wakes = 0  # calls of wake()


class Rate(rospy.Rate):
    """A rospy.Rate whose sleep() ends early when the goal should stop.

    hz: 1/s, on the ROS clock.
    request: called when sleep() begins and after each wake(), with no lock held. Returns None, or an object that
        identifies the request to stop, the same one for the same request.
    answered: its attribute `request` is what was answered last in each thread, so that a loop that makes a rate in each
        turn keeps its pace.
    """

    def __init__(self, hz: float, request: Callable[[], Any], answered: threading.local) -> None:
        super().__init__(hz)
        self.last_time: rospy.Time
        self._request, self._answered = request, answered

    def sleep(self) -> bool:
        """Sleep until the end of the period. A late call does what rospy.Rate does. If the clock is set back, a new
        period begins.

        Returns True at the end of the period, False when the goal should stop: at once the first time for a request,
        in this thread, then at the end of each period, so that a loop that goes on keeps its pace. Raises
        rospy.ROSInterruptException if the node was shut down and time is simulated, as rospy.Rate does.
        """
        clock = rospy.rostime.get_rostime_cond()
        called = rospy.get_rostime()
        while True:
            seen = _wakes
            request = self._request()
            if request is not None and request is not getattr(self._answered, "request", None):
                self._answered.request = request
                return False
            with clock:
                now = rospy.get_rostime()
                called = min(called, now)  # the clock may have been set back
                if self.last_time.is_zero():  # the rate was made before simulated time began
                    self.last_time = now
                left = self.remaining()
                if left <= rospy.Duration():
                    self.last_time += self.sleep_dur
                    if called - self.last_time > self.sleep_dur * 2:  # too late to catch up
                        self.last_time = called
                    return request is None
                if seen == _wakes:
                    if rospy.rostime.is_wallclock():
                        clock.wait(left.to_sec())
                    elif request is None:
                        clock.wait()
                    else:  # no /clock arrives after a shutdown
                        if rospy.is_shutdown():
                            raise rospy.ROSInterruptException("ROS shutdown request")
                        clock.wait(0.5)


def wake() -> None:
    """Make each sleeping Rate check again whether to stop."""
    global _wakes
    clock = rospy.rostime.get_rostime_cond()
    with clock:
        _wakes += 1
        clock.notify_all()
