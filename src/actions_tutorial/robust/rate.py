# SPDX-License-Identifier: BSD-3-Clause
"""A rate whose sleep() a stop ends."""
from __future__ import annotations

from typing import Callable

import rospy

_wakes = 0  # calls of wake()


class Rate(rospy.Rate):
    """Like rospy.Rate, and sleep() ends early as soon as stop_requested() (bool) is true; wake() makes it look.

    It waits on the condition that rospy notifies at each message of /clock and wake() at each request to stop, so the
    wait is exact in real and in simulated time, without polling. That lock is the innermost: with it held, nothing else
    is locked, and stop_requested() is called without it, for a subclass may lock something there.
    """

    def __init__(self, hz: float, stop_requested: Callable[[], bool]) -> None:
        super().__init__(hz)
        self.last_time: rospy.Time
        self._stop_requested = stop_requested

    def sleep(self) -> bool:
        """Sleeps until the end of the period, on the ROS clock. Returns True then, and False at once when a stop is
        asked for. Late, or after the clock has jumped ahead, it does what rospy.Rate does; when that is set back, it
        begins a whole period, where rospy.Rate raises."""
        called, clock = rospy.Time.now(), rospy.rostime.get_rostime_cond()
        while True:
            wakes = _wakes
            if self._stop_requested():  # without the lock: a program that overrides it may take one of its own
                return False
            with clock:
                if self.last_time.is_zero():  # the simulated clock had not begun
                    self.last_time = rospy.Time.now()
                left = self.remaining()  # a whole period again if the clock was set back
                if left <= rospy.Duration():
                    self.last_time += self.sleep_dur
                    called = min(called, rospy.Time.now())  # the clock may have been set back since
                    if called - self.last_time > self.sleep_dur * 2:  # too late to catch up: start afresh
                        self.last_time = called
                    return True
                if wakes == _wakes:
                    clock.wait(left.to_sec() if rospy.rostime.is_wallclock() else None)


def wake():
    """Make each Rate that sleeps look whether to stop."""
    global _wakes
    clock = rospy.rostime.get_rostime_cond()
    _wakes += 1  # without the lock: a signal handler of rospy's may hold it that waits for this
    if clock.acquire(timeout=0.1):
        clock.notify_all()
        clock.release()
