"""What the tests of faults share: a scene, which is a server and its clients in a namespace of their own."""
import functools
import os
import threading
import time
import unittest
import xmlrpc.client

import rosgraph
import rosnode
import rospy
from actionlib_msgs.msg import GoalID, GoalStatusArray
from actions_tutorial.msg import WashTheDishesActionFeedback, WashTheDishesActionGoal, WashTheDishesActionResult
from harness import Master, eventually

# s that a bound of the contract is exceeded by at most, because the clock here runs while a loaded machine starts
# other interpreters on the same cores; a node that is really late hangs for ever, or is late by its own time-outs.
SLACK = 4

STATE = {"RECALLED": 8, "REJECTED": 5, "ABORTED": 4, "SUCCEEDED": 3, "PREEMPTED": 2}


def concurrently(case, at_once=4):
    """Class decorator: run a TestCase's tests side by side, as they mostly wait; each still has its own outcome.

    The first of them starts them all. For tests that need no set-up nor clean-up methods.
    """
    slots, runs = threading.Semaphore(at_once), {}

    class Run(threading.Thread):
        def __init__(self, name, test):
            super().__init__(name=name, daemon=True)
            self.test, self.error = test, None

        def run(self):
            with slots:
                try:
                    self.test(case(self.name))
                except BaseException as error:
                    self.error = error

    def outcome(name, test):
        @functools.wraps(test)
        def joined(self):
            if not runs:
                runs.update((name, Run(name, test)) for name, test in tests.items())
                for run in runs.values():
                    run.start()
            runs[name].join()
            if runs[name].error:
                raise runs[name].error
        return joined

    tests = {name: test for name, test in vars(case).items() if name.startswith("test_")}
    for name, test in tests.items():
        setattr(case, name, outcome(name, test))
    return case


def watch(master):
    """Become a node of this master (Master), so that scenes see messages."""
    os.environ.update(master.env)
    rospy.init_node("watcher", disable_signals=True)


def kill_node(name):
    """What `rosnode kill` does, without the second that its start takes."""
    rosnode.kill_nodes([name])


def bowls(count):
    return ["bowl-%d" % number for number in range(count)]


def printed_bowls(client):
    """Returns the bowls (list of str) that a client (Process) printed as feedback, and those of its result or None."""
    feedback, _, result = client.stdout.partition("The result is: ")
    named = [line.split('"')[1] for line in feedback.splitlines() if "last_dish_washed" in line]
    return named, [line[4:] for line in result.splitlines() if line.startswith("  - ")] if result else None


def assert_partial(case, client, at_least):
    """A client (Process) has printed at_least bowls, in order, once each, and a result with the same. The last feedback
    may be missing: it has a connection of its own, on which the result may overtake it."""
    named, result = printed_bowls(client)
    case.assertIsNotNone(result, "expected a result from %s" % client)
    case.assertEqual((named, result), (bowls(len(named)), bowls(len(result))), client)
    case.assertLessEqual(at_least, len(named), client)
    case.assertIn(len(result) - len(named), (0, 1), client)


class FaultCase(unittest.TestCase):
    """Tests on one master of their own (Master), each in a scene of its own."""

    @classmethod
    def setUpClass(cls):
        cls.master = Master()
        watch(cls.master)

    @classmethod
    def tearDownClass(cls):
        cls.master.stop()


class Scene:
    """A namespace on a master (Master), with what is said in it: lists of (monotonic seconds, message)."""

    def __init__(self, master, name):
        self.master, self.namespace, self.processes = master, "/" + name, []
        self.results, self.feedback, self.cancels = [], [], []
        action = self.namespace + "/wash_dishes_as/"
        self._subscribers = [
            rospy.Subscriber(action + topic, kind, lambda message, said=said: said.append((time.monotonic(), message)))
            for topic, kind, said in (("result", WashTheDishesActionResult, self.results),
                                      ("feedback", WashTheDishesActionFeedback, self.feedback),
                                      ("cancel", GoalID, self.cancels))]
        self.ended = {}  # goal id: ending (int), as the status tells, too
        self._subscribers.append(rospy.Subscriber(action + "status", GoalStatusArray, self._note_endings))
        self.goal = rospy.Publisher(action + "goal", WashTheDishesActionGoal, queue_size=1000)
        self.cancel = rospy.Publisher(action + "cancel", GoalID, queue_size=1000)

    def _note_endings(self, message):
        self.ended.update({status.goal_id.id: status.status for status in message.status_list
                           if status.status in STATE.values()})

    def start(self, *command, **env):
        self.processes.append(self.master.process(*command, ROS_NAMESPACE=self.namespace, **env))
        return self.processes[-1]

    def start_server(self, *arguments, **env):
        return self.start("rosrun", "actions_tutorial", "action_server.py", *arguments, **env)

    def server(self, *arguments, **env):
        """Start a server, and wait until messages go both ways. Returns the Process."""
        server = self.start_server(*arguments, **env)
        eventually(self.connected, "a server, from %s" % server)
        return server

    def connected(self):
        """Goals and cancels reach the server, and endings and feedback us, as the server tells: a subscriber counts a
        connection before it is one."""
        try:
            uri = self.master.api.lookupNode(self.namespace + "/action_server")
            _, _, connections = xmlrpc.client.ServerProxy(uri).getBusInfo("/watcher")
        except (rosgraph.MasterError, OSError):
            return False
        me = rospy.get_name()
        heard = {topic.rpartition("/")[2] for _, to, way, _, topic, *_ in connections if (to, way) == (me, "o")}
        return {"result", "feedback"} <= heard and self.goal.get_num_connections() and self.cancel.get_num_connections()

    def client(self, minutes, *arguments, **env):
        """Start a client with this goal, by default one that does not fear a slow machine. Returns the Process."""
        return self.start("rosrun", "actions_tutorial", "action_client.py", "_number_of_minutes:=%d" % minutes,
                          *(arguments or ["_heartbeat_timeout:=20"]), **env)

    def send(self, minutes, goal_id="", stamp=None):
        """Send a goal as `rostopic pub` does."""
        goal = WashTheDishesActionGoal(goal_id=GoalID(id=goal_id, stamp=stamp or rospy.Time()))
        goal.goal.number_of_minutes = minutes
        self.goal.publish(goal)

    def ending(self, goal_id=None, number=0):
        """Wait for the ending with this number, of the goal with this id if given. -> (monotonic seconds, message)"""
        def ending():
            endings = [result for result in self.results if goal_id in (None, result[1].status.goal_id.id)]
            return endings[number:number + 1]
        return eventually(ending, "ending %d of goal %s in %s" % (number, goal_id, self.namespace))[0]

    def serves(self, goal_id="next"):
        """Wait until the server has washed one more bowl."""
        self.send(1, goal_id)
        result = self.ending(goal_id)[1]
        assert (result.status.status, result.result.dishes_washed) == (STATE["SUCCEEDED"], bowls(1)), \
            "expected that one bowl is washed, came:\n%s" % result

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.processes:
            process.stop()
        for one in self._subscribers + [self.goal, self.cancel]:
            one.unregister()
