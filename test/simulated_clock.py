"""Simulated time in the test's hand."""
import threading

import rospy
from rosgraph_msgs.msg import Clock

from processes import eventually


class SimulatedClock:
    """A /clock that stands still unless the test turns it or lets it run, so that each figure is exact anywhere.

    now: rospy.Time.
    """

    def __init__(self):
        self._here, self._news = None, threading.Condition()
        self._turns, self._stopped, self._runner = threading.RLock(), threading.Event(), None
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=100, latch=True)
        self._subscriber = rospy.Subscriber("/clock", Clock, self._follow)  # called after rospy's own, which came first
        self.set(rospy.Time(1000))

    def _follow(self, message):
        with self._news:
            self._here = message.clock
            self._news.notify_all()

    def set(self, time):
        """Set the clock to time (rospy.Time), here at once, in the other nodes soon."""
        with self._turns:
            self.now = time
            self._publisher.publish(time)
            eventually(lambda: self._here == time, "a /clock that comes back to us", news=self._news)

    def turn(self, seconds, scene=None):
        """Turn the clock on by seconds; with a scene, wait for the server's status of then (0.25 s or more)."""
        with self._turns:
            self.set(self.now + rospy.Duration.from_sec(seconds))
        if scene:
            scene.wait(lambda: scene.status.header.stamp >= self.now, "a status of %.2f s" % self.now.to_sec())

    def lead(self, scene):
        """Turn the clock on until the server's status follows it; its timer may have begun after our first turns."""
        begun = self.now
        scene.wait(lambda: self.turn(0.25) or scene.status.header.stamp > begun, "a status that follows the clock")
        self.turn(0.25, scene)  # or a goal may overtake the last of those turns, and begin too early

    def run(self, step, pause=0.004):
        """Let the clock go on by step (s) every pause (s of real time) or so, until stop()."""
        def turn():
            while not self._stopped.wait(pause):
                self.turn(step)

        self._stopped.clear()
        self._runner = threading.Thread(target=turn, daemon=True)
        self._runner.start()

    def stop(self):
        self._stopped.set()
        if self._runner:
            self._runner.join()
