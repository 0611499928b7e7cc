"""A simulated clock that the test turns."""
import contextlib
import threading
import time

from rosgraph_msgs.msg import Clock
import rospy

from support.processes import eventually


class SimulatedClock:
    """A /clock that moves only when the test turns it. now: rospy.Time."""

    def __init__(self):
        self._here, self._changed = None, threading.Condition()
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=100, latch=True)
        self._subscriber = rospy.Subscriber("/clock", Clock, self._follow)  # called after rospy's own, which came first
        self.set(rospy.Time(int(time.time() % 1e6) * 1000))  # later than the clock of an earlier test

    def _follow(self, message):
        with self._changed:
            self._here = message.clock
            self._changed.notify_all()

    def set(self, now):
        """Set the clock to now (rospy.Time): in this process at once, in other nodes soon."""
        self.now = now
        self._publisher.publish(now)
        eventually(lambda: self._here == now, "a /clock that comes back", changed=self._changed)

    def turn(self, seconds, client=None):
        """Turn the clock on by seconds. client: a RawClient, to wait for the server's next status (0.25 s or more)."""
        self.set(self.now + rospy.Duration.from_sec(seconds))
        if client:
            begun = self.now
            with contextlib.suppress(AssertionError):
                return client.wait(lambda: client.status.header.stamp == begun, "a status", timeout=5)
            # rospy.Rate may add the rest of its period to a clock that was turned meanwhile. Its status comes later.
            self.set(self.now + rospy.Duration.from_sec(0.2))
            client.wait(lambda: client.status.header.stamp > begun, "a status after %.2f s" % begun.to_sec())

    def turn_until_status_follows(self, client):
        """Turn the clock on until the server's status follows it, which may have missed some turns."""
        begun = self.now
        client.wait(lambda: self.turn(0.25) or begun < client.status.header.stamp <= self.now,
                    "a status that follows the clock")
        self.turn(0.25, client)  # or a goal may overtake the last of those turns
