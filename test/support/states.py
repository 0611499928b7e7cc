"""The states of a goal: the numbers of GoalStatus, and their names."""
from actionlib_msgs.msg import GoalStatus

PENDING, ACTIVE, PREEMPTED, SUCCEEDED, ABORTED, RECALLED, PREEMPTING = (
    GoalStatus.PENDING, GoalStatus.ACTIVE, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED, GoalStatus.ABORTED,
    GoalStatus.RECALLED, GoalStatus.PREEMPTING)
TERMINAL = {PREEMPTED, SUCCEEDED, ABORTED, RECALLED, GoalStatus.REJECTED}
NAMES = {value: name for name, value in vars(GoalStatus).items() if name.isupper()}
