"""What the tests of the server share: a clock that the test turns by hand, and a probe on the action's five topics."""
import itertools
import threading
import time

import rospy
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from actions_tutorial.msg import WashTheDishesActionFeedback, WashTheDishesActionGoal, WashTheDishesActionResult
from rosgraph_msgs.msg import Clock
from rospy.rostime import get_rostime_cond

ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, RECALLED = (
    GoalStatus.ACTIVE, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED, GoalStatus.RECALLED)
ENDINGS = (PREEMPTED, SUCCEEDED, ABORTED, GoalStatus.REJECTED, RECALLED)
NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}


def bowls(count):
    """The bowls that count seconds of washing name."""
    return ["bowl-%d" % i for i in range(count)]


class Probe:
    """Sends goals and cancels as raw messages, and keeps all that comes back.

    feedback: goal id -> [(bowl, rospy.Time of its header)]; results: goal id -> [WashTheDishesActionResult];
    states: goal id -> [status numbers in the order seen]; status_stamp: rospy.Time of the last status message.
    """

    _numbers = itertools.count()

    def __init__(self):
        self.news = threading.Condition()
        self.feedback, self.results, self.states, self.status_stamp = {}, {}, {}, rospy.Time()
        self.active_at_once = 0  # the most goals that one status message showed as ACTIVE or PREEMPTING
        self._goal = rospy.Publisher("wash_dishes_as/goal", WashTheDishesActionGoal, queue_size=1000)
        self._cancel = rospy.Publisher("wash_dishes_as/cancel", GoalID, queue_size=1000)
        self._subscribers = [
            rospy.Subscriber("wash_dishes_as/feedback", WashTheDishesActionFeedback, self._on_feedback),
            rospy.Subscriber("wash_dishes_as/result", WashTheDishesActionResult, self._on_result),
            rospy.Subscriber("wash_dishes_as/status", GoalStatusArray, self._on_status)]
        self.wait(lambda: all(end.get_num_connections() for end in [self._goal, self._cancel] + self._subscribers),
                  "a server on the five topics of wash_dishes_as")

    def send(self, number_of_minutes, stamp=None, goal_id=None):
        """Send a goal (int; stamp: rospy.Time, now unless given). Returns its id (str)."""
        goal = WashTheDishesActionGoal()
        goal.goal.number_of_minutes = number_of_minutes
        goal.goal_id.id = "%s-%d" % (rospy.get_name(), next(self._numbers)) if goal_id is None else goal_id
        goal.goal_id.stamp = rospy.Time.now() if stamp is None else stamp
        self._goal.publish(goal)
        return goal.goal_id.id

    def cancel(self, goal_id="", stamp=rospy.Time()):
        """Send a cancel: of one goal, of all (no id, no stamp), or of all up to stamp."""
        self._cancel.publish(GoalID(id=goal_id, stamp=stamp))

    def wait(self, condition, what, timeout=20):
        """Wait until condition() is true. AssertionError with what (str) and all that came, after timeout (s)."""
        begun = time.monotonic()
        with self.news:
            while not condition():
                if time.monotonic() - begun > timeout:
                    raise AssertionError("expected %s; not so after %.1f s; came: %s" % (what, timeout, self))
                self.news.wait(0.1)

    def wait_bowls(self, goal_id, count):
        """Wait for count bowls of feedback. Returns [(bowl, rospy.Time)]."""
        self.wait(lambda: len(self.feedback.get(goal_id, [])) >= count, "%d bowls of %s" % (count, goal_id))
        return self.feedback[goal_id]

    def wait_result(self, goal_id):
        """Wait for the goal's ending. Returns its one WashTheDishesActionResult."""
        self.wait(lambda: self.results.get(goal_id), "a result of %s" % goal_id)
        self.wait(lambda: set(self.states.get(goal_id, [])) & set(ENDINGS), "an ending of %s in the status" % goal_id)
        results = self.results[goal_id]
        assert len(results) == 1, "expected one result of %s, came: %s" % (goal_id, self)
        return results[0]

    def bowls_of(self, goal_id):
        """The bowls that feedback has named so far."""
        return [bowl for bowl, _ in self.feedback.get(goal_id, [])]

    def _on_feedback(self, msg):
        with self.news:
            self.feedback.setdefault(msg.status.goal_id.id, []).append(
                (msg.feedback.last_dish_washed, msg.header.stamp))
            self.news.notify_all()

    def _on_result(self, msg):
        with self.news:
            self.results.setdefault(msg.status.goal_id.id, []).append(msg)
            self.news.notify_all()

    def _on_status(self, msg):
        with self.news:
            self.status_stamp = msg.header.stamp
            for status in msg.status_list:
                seen = self.states.setdefault(status.goal_id.id, [])
                if not seen or seen[-1] != status.status:
                    seen.append(status.status)
            self.active_at_once = max(self.active_at_once, sum(
                status.status in (ACTIVE, GoalStatus.PREEMPTING) for status in msg.status_list))
            self.news.notify_all()

    def __str__(self):
        return "; ".join("%s: states %s, bowls %s, results %s" % (
            goal_id, [NAMES[state] for state in states], self.bowls_of(goal_id),
            [(NAMES[r.status.status], r.status.text, r.result.dishes_washed) for r in self.results.get(goal_id, [])])
            for goal_id, states in list(self.states.items())[-5:])


class HandClock:
    """Simulated time that stands still unless the test turns it, so that each figure is exact on any machine."""

    def __init__(self, begin=1000):
        self._publisher = rospy.Publisher("/clock", Clock, queue_size=100, latch=True)
        self.now = rospy.Time(begin)
        self._running = threading.Event()
        self._turns = threading.Lock()
        self.set(self.now)

    def set(self, time):
        """Set the clock to time (rospy.Time), here at once, in the other nodes soon."""
        news = get_rostime_cond()
        with self._turns, news:
            self.now = time
            self._publisher.publish(Clock(clock=time))
            while rospy.Time.now() != time and not rospy.is_shutdown():
                news.wait(0.1)

    def turn(self, seconds, probe=None):
        """Turn the clock on by seconds; with a probe, wait for the server's status of then (0.25 s or more)."""
        self.set(self.now + rospy.Duration.from_sec(seconds))
        if probe:
            probe.wait(lambda: probe.status_stamp >= self.now, "a status of ROS time %.2f" % self.now.to_sec())

    def lead(self, probe):
        """Turn the clock on until the server's status follows it; its timer may have begun after our first turns."""
        begun = self.now
        probe.wait(lambda: self.turn(0.25) or probe.status_stamp > begun, "a status that follows the clock")

    def run(self, factor):
        """Let the clock run, factor times as fast as the wall's, until stop()."""
        self._running.set()
        threading.Thread(target=self._run, args=[factor], daemon=True).start()

    def stop(self):
        self._running.clear()

    def _run(self, factor):
        before = time.monotonic()
        while self._running.is_set():
            time.sleep(0.004)
            wall = time.monotonic()
            self.turn((wall - before) * factor)
            before = wall
