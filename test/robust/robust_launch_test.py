#!/usr/bin/env python3
"""launch/wash_the_dishes.launch with robust:=true."""
import rostest

from launch_test import LaunchTest


class TestRobustLaunch(LaunchTest):

    def test_robust_starts_the_nodes_on_robust(self):
        launch = self.launch("robust:=true", "number_of_minutes:=1")
        self.check_bowls(launch, 1)
        self.check_nodes(launch, "robust_action_server", "robust_action_client")
        self.launch("--ros-args").expect(r'robust \(default "false"\): true starts the two nodes on robust')

    def test_client_false_starts_the_server_alone(self):
        self.check_server_alone(self.launch("robust:=true", "client:=false"), "robust_action_server")

    def test_failing_client_ends_the_launch(self):
        launch = self.launch("robust:=true", "number_of_minutes:=-3")
        self.check_end(launch)
        launch.expect("ABORTED: number_of_minutes is -3, must be 0 or more")


if __name__ == "__main__":
    rostest.rosrun("actions_tutorial", "robust_launch", TestRobustLaunch)
