#!/usr/bin/python3
"""The life of a goal: accepted, washed with a bowl of feedback each second, and ended once with what was washed."""
import rospy
import rostest
from actions_tutorial import robust
from actions_tutorial.msg import WashTheDishesAction, WashTheDishesGoal

from raw_client import ABORTED, ACTIVE, PREEMPTED, RECALLED, SUCCEEDED
from scenes import ServerCase
from processes import bowls, eventually


class TestGoal(ServerCase):

    def test_no_minutes_succeed_at_once_with_no_bowls(self):
        self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])

    def test_minutes_are_as_many_bowls_in_order_and_once(self):
        for minutes in (1, 12):
            self.finish(self.wash(minutes, 1), minutes)

    def test_each_bowl_and_the_result_have_their_second_without_drift(self):
        begun = self.clock.now
        goal_id = self.wash(60, 1)
        result = self.finish(goal_id, 60)
        seconds = [(message.header.stamp - begun).to_sec() for message in self.scene.feedback[goal_id] + [result]]
        self.assertEqual([float(i) for i in range(61)], seconds, "seconds of bowls and result on the ROS clock")

    def test_no_bowl_comes_before_its_second(self):
        goal_id = self.scene.send(3)
        self.scene.wait_bowls(goal_id, 1)
        self.clock.turn(0.999, self.scene)
        self.scene.send(0, stamp=rospy.Time(1))  # refused for its stamp, and answered after all that was due
        self.assertEqual(bowls(1), self.scene.bowls_of(goal_id))
        self.clock.turn(0.001)
        self.scene.wait_bowls(goal_id, 2)
        self.finish(goal_id, 3)

    def late(self, seconds):
        """A goal of 8 minutes during whose first bowl a machine is busy for so long (s). Returns its id."""
        goal_id = self.wash(8, 1)
        # The last that the server does before it sleeps; the status that follows gives it the time.
        self.server.expect("goal accepted: number_of_minutes 8")
        self.clock.turn(0.25, self.scene)
        self.clock.turn(seconds - 0.25, self.scene)
        self.scene.wait_bowls(goal_id, 3)
        return goal_id

    def test_a_little_late_server_catches_up_with_the_schedule(self):
        begun = self.clock.now
        goal_id = self.late(2.5)
        self.clock.turn(0.5, self.scene)
        message = self.scene.wait_bowls(goal_id, 4)[3]
        self.assertEqual(3, (message.header.stamp - begun).to_sec(), "second of bowl-3")
        self.finish(goal_id, 8)

    def test_a_very_late_server_begins_its_schedule_anew_without_a_burst_of_bowls(self):
        begun = self.clock.now
        result = self.finish(self.late(100.5), 8)
        # As rospy.Rate does: bowl-1 is over, bowl-2 is late, and from there on each has its second.
        self.assertEqual(100.5 + 6, (result.header.stamp - begun).to_sec(), "second of the result")

    def test_states_are_active_then_succeeded(self):
        goal_id = self.wash(1, 1)
        self.finish(goal_id, 1)
        states = [state for state in self.scene.states[goal_id] if state != 0]  # PENDING may be too short to be seen
        self.assertEqual([ACTIVE, SUCCEEDED], states, str(self.scene))

    def test_negative_minutes_are_aborted_with_the_reason(self):
        for minutes in (-1, -3, -2**31):
            result = self.scene.check_ending(self.scene.send(minutes), ABORTED, [])
            self.assertIn(str(minutes), result.status.text)
            self.assertIn("0 or more", result.status.text)

    def test_goal_without_id_and_stamp_is_served(self):
        known = set(self.scene.states)
        self.scene.send(1, stamp=rospy.Time(), goal_id="")
        self.scene.wait(lambda: set(self.scene.feedback) - known, "feedback of a goal with an id of the server's")
        goal_id, = set(self.scene.feedback) - known
        self.finish(goal_id, 1)

    def test_stamp_of_the_future_or_past_shuts_nobody_out(self):
        for stamp in (rospy.Time(4000000000), rospy.Time(1)):
            self.scene.check_ending(self.scene.send(0, stamp=stamp), SUCCEEDED, [])
            self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])

    def test_repeated_id_is_not_washed_twice_and_warned_of(self):
        goal_id = self.wash(5, 1)
        for ignored in (1, 2):  # that of an active goal, that of an ended one
            self.scene.send(5, goal_id)
            self.scene.check_ending(self.scene.send(0), SUCCEEDED, [])  # the topic keeps its order: the repeat was read
            self.scene.check_ending(goal_id, PREEMPTED, bowls(1))
            server = self.scene.processes[0]
            eventually(lambda: server.stderr.count("ignored") == ignored, "a line on the repeat %d" % ignored, server)

    def test_goal_with_an_id_of_a_megabyte(self):
        self.scene.check_ending(self.scene.send(0, "long " * 200000), SUCCEEDED, [])

    def test_nothing_of_an_earlier_goal_is_left_and_no_result_is_changed_by_a_later_one(self):
        goals = []
        for minutes, washed, state in ((4, 3, PREEMPTED), (2, 1, PREEMPTED), (-3, 0, ABORTED), (0, 0, SUCCEEDED)):
            goals.append((self.wash(minutes, washed), state, bowls(washed)))
            if state == PREEMPTED:
                self.scene.cancel(goals[-1][0])
            self.scene.check_ending(*goals[-1])
        for goal in goals:
            self.scene.check_ending(*goal)

    def test_each_of_two_clients_sees_its_own_goal(self):
        clients, seen, done = {}, {"first": [], "second": []}, {}

        def send(name, minutes):
            clients[name].send_goal(WashTheDishesGoal(number_of_minutes=minutes), feedback_cb=seen[name].append,
                                    done_cb=lambda state, result: done.update({name: result.dishes_washed}))

        for name in seen:
            clients[name] = robust.SimpleActionClient("wash_dishes_as", WashTheDishesAction)
            self.assertTrue(clients[name].wait_for_server(), "no server for the %s client" % name)
        send("first", 2)
        self.scene.wait(lambda: len(seen["first"]) == 1, "a bowl for the first client")
        self.clock.turn(1, self.scene)
        self.scene.wait(lambda: len(seen["first"]) == 2, "two bowls for the first client")
        send("second", 1)
        self.scene.wait(lambda: "first" in done and len(seen["second"]) == 1, "an end, and a bowl for the second")
        self.clock.turn(1, self.scene)
        self.scene.wait(lambda: len(done) == 2, "an end for the second client")
        self.assertEqual({"first": bowls(2), "second": bowls(1)}, done)
        self.assertEqual((2, 1), (len(seen["first"]), len(seen["second"])), "feedback that each client saw")

    def test_burst_ends_every_goal_once_and_washes_the_last(self):
        for count in (20, 500):
            goals, last = [self.scene.send(2) for _ in range(count - 1)], self.wash(2, 1)
            self.finish(last, 2)
            self.assertNotIn(RECALLED, self.scene.states[last])
            for goal_id in goals:
                self.scene.wait(lambda: self.scene.ended(goal_id), "an ending of %s" % goal_id)
                endings = [result.status.status for result in self.scene.results.get(goal_id, [])]
                # Of so many results at once, actionlib drops some: its queue has room for 50.
                self.assertIn(endings, ([PREEMPTED], [RECALLED]) + ([],) * (count > 50), goal_id)
            self.assertLessEqual(self.scene.active_at_once, 1, "goals ACTIVE at once")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "goal", TestGoal)
