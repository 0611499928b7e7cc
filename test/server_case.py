"""The base of the tests of the server: a node, the probe, and a clock in the test's hand."""
import unittest

import rospy

from probe import HandClock, Probe


class ServerCase(unittest.TestCase):
    """Each test finds a server with nothing to do, one second after whatever was before."""

    @classmethod
    def setUpClass(cls):
        rospy.init_node("test_node", anonymous=True)
        cls.clock = HandClock()
        cls.probe = Probe()
        cls.clock.lead(cls.probe)

    def setUp(self):
        self.clock.stop()
        for goal_id in set(self.probe.states) - set(self.probe.results) - {"nobody's"}:  # that one is a cancel's alone
            self.probe.cancel(goal_id)
            self.probe.wait_result(goal_id)
        self.clock.turn(1, self.probe)
        self.probe.active_at_once = 0

    def wash(self, goal_id, count):
        """Turn the clock on second by second, until the goal has named count bowls in all."""
        for already in range(1, count + 1):
            if already > 1:
                self.clock.turn(1, self.probe)
            self.probe.wait_bowls(goal_id, already)

    def check_ending(self, goal_id, state, washed):
        """Expect one result, with that state (int) and those bowls ([str]), and feedback that named the same."""
        result = self.probe.wait_result(goal_id)
        self.assertEqual((state, washed), (result.status.status, result.result.dishes_washed), str(self.probe))
        self.probe.wait(lambda: self.probe.bowls_of(goal_id) == washed, "feedback of %s for %s" % (washed, goal_id))
        return result
