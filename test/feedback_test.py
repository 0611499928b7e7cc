#!/usr/bin/python3
"""Feedback names each bowl, in order, once, in the second in which it is washed."""
import rostest
import rospy

from probe import bowls
from server_case import ServerCase


class TestFeedback(ServerCase):

    def test_bowls_are_counted_from_0_in_order_and_once(self):
        goal_id = self.probe.send(12)
        self.wash(goal_id, 12)
        self.clock.turn(1, self.probe)
        self.probe.wait_result(goal_id)
        self.assertEqual(bowls(12), self.probe.bowls_of(goal_id))

    def test_each_bowl_has_its_second_without_drift(self):
        begun = self.clock.now
        goal_id = self.probe.send(60)
        self.wash(goal_id, 60)
        seconds = [(stamp - begun).to_sec() for _, stamp in self.probe.feedback[goal_id]]
        self.assertEqual([float(i) for i in range(60)], seconds, "seconds of the bowls on the ROS clock")

    def test_no_bowl_comes_before_its_second(self):
        goal_id = self.probe.send(3)
        self.probe.wait_bowls(goal_id, 1)
        self.clock.turn(0.999, self.probe)
        self.probe.send(0, stamp=rospy.Time(1))  # refused for its stamp, and answered after all that was due
        self.assertEqual(bowls(1), self.probe.bowls_of(goal_id))
        self.clock.turn(0.001)
        self.probe.wait_bowls(goal_id, 2)

    def test_a_late_server_catches_up_with_the_schedule(self):
        begun = self.clock.now
        goal_id = self.probe.send(8)
        self.probe.wait_bowls(goal_id, 1)
        self.clock.turn(3.5, self.probe)  # as if the machine had been busy
        self.probe.wait_bowls(goal_id, 4)
        self.clock.turn(0.5)
        _, stamp = self.probe.wait_bowls(goal_id, 5)[4]
        self.assertEqual(4.0, (stamp - begun).to_sec(), "second of bowl-4")

    def test_feedback_belongs_to_its_goal_alone(self):
        first = self.probe.send(5)
        self.wash(first, 2)
        second = self.probe.send(2)
        self.wash(second, 2)
        self.clock.turn(1, self.probe)
        self.probe.wait_result(second)
        self.assertEqual((bowls(2), bowls(2)), (self.probe.bowls_of(first), self.probe.bowls_of(second)))


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "feedback", TestFeedback)
