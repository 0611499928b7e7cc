"""A rate whose sleep() a stop ends."""
import rospy

from .libraries import need


class Rate(rospy.Rate):
    """Like rospy.Rate; stop_requested() tells whether to stop, and wake() makes sleep() look."""

    def __init__(self, hz, stop_requested):
        super().__init__(hz)
        need("rospy", self, "last_time", "sleep_dur")
        need("rospy", rospy.rostime, "is_wallclock")
        _clock()
        self.stop_requested = stop_requested

    def sleep(self):
        """Returns True at the end of the period, False at once when a stop is asked for.

        Late, or after a jump of the clock, it does what rospy.Rate does. Without it, a stop waits for the end of the
        period (rospy/timer.py, sleep).
        """
        called, clock = rospy.Time.now(), _clock()
        with clock:
            while not self.stop_requested():
                if self.last_time.is_zero():  # the simulated clock had not begun
                    self.last_time = rospy.Time.now()
                left = self.remaining()  # a whole period again if the clock was set back
                if left <= rospy.Duration() and not self.last_time.is_zero():
                    self.last_time += self.sleep_dur
                    if called - self.last_time > self.sleep_dur * 2:  # too late to catch up: start afresh
                        self.last_time = called
                    return True
                clock.wait(left.to_sec() if rospy.rostime.is_wallclock() else None)
        return False


def wake():
    """Make each Rate that sleeps look whether to stop."""
    clock = _clock()
    with clock:
        clock.notify_all()


def _clock():
    """Returns the condition that rospy notifies at each message of /clock, and wake() at each request to stop: an exact
    wait in real and in simulated time, and no polling."""
    need("rospy", rospy.rostime, "get_rostime_cond")
    return rospy.rostime.get_rostime_cond()
