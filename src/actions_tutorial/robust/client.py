"""SimpleActionClient: loses no goal and no answer, notices a lost server, and cancels its goal on shutdown."""
import secrets
import threading
import time
import xmlrpc.client

import actionlib
import rosgraph
import rospy
from actionlib.simple_action_client import SimpleGoalState
from actionlib_msgs.msg import GoalStatus, GoalStatusArray

from . import node, peers, shutdown
from .internals import NO_ANSWER, cannot_start, name_of, need
from .parameters import get_params


class SimpleActionClient(actionlib.SimpleActionClient):
    """Like actionlib.SimpleActionClient; what it adds stands with each method.

    heartbeat_timeout: seconds for which the server may be silent about the goal before the goal is LOST. A server lists
    its goals in its status, five times a second unless its parameter actionlib_status_frequency says otherwise. Only
    time that passes on the ROS clock counts.
    """

    def __init__(self, ns, ActionSpec, *, heartbeat_timeout=5.0):
        try:
            get_params({"actionlib_client_pub_queue_size": (10, None, None),
                        "actionlib_client_sub_queue_size": (-1, None, None)})
            peers.serve_all_peers()
            super().__init__(ns, ActionSpec)
        except (OSError, ValueError) as error:
            raise cannot_start("the client of %s cannot start: %s" % (rospy.resolve_name(ns), error)) from error
        need("actionlib", self, "simple_state", "gh", "done_condition", "action_client", "_handle_transition")
        need("actionlib", self.action_client, "manager", "pub_goal", "pub_cancel", "last_status_msg")
        need("actionlib", self.action_client.manager, "list_mutex", "_generate_id")
        need("actionlib", actionlib.action_client.CommStateMachine, "_mark_as_lost")
        self._heartbeat_timeout = heartbeat_timeout
        self._heard = threading.Event()  # the server has mentioned our goal
        self._why = ""  # the goal has no ending
        self._waiter = threading.Thread()
        self._shutting_down = False
        self._make_ids_unique()
        self._status = rospy.Subscriber(rospy.remap_name(ns) + "/status", GoalStatusArray, self._hear)
        shutdown.at_end(self._cancel_on_shutdown)

    def _make_ids_unique(self):
        """Without it, two clients of one name give the same id while simulated time stands still: the server ignores
        the second goal, and its client waits for ever (actionlib/action_client.py, _generate_id)."""
        generate_id = self.action_client.manager._generate_id

        def generate_unique_id():
            goal_id = generate_id()
            goal_id.id += "-" + secrets.token_hex(4)
            return goal_id

        self.action_client.manager._generate_id = generate_unique_id

    def wait_for_server(self, timeout=rospy.Duration()):
        """Like actionlib's, but timeout (rospy.Duration or s) is real time, and every 5 s it says what it waits for.

        Without it, a simulated clock that stands still stops the time-out, too; and a message sent while a connection
        is being made is lost.
        """
        if not self._waiter.is_alive():
            self._waiter = threading.Thread(target=self._connect, daemon=True)
            self._waiter.start()
        what = "action " + rospy.resolve_name(self.action_client.ns)
        seconds = timeout.to_sec() if isinstance(timeout, rospy.Duration) else timeout
        connected = node.wait_for(what, self._is_connected, seconds)
        self._why = "" if connected else "interrupted while waiting for the %s" % what if rospy.is_shutdown() else \
            "no %s within %g s" % (what, seconds)
        return connected

    def _is_connected(self):
        return not self._waiter.is_alive() and not rospy.is_shutdown()

    def _connect(self):
        """Wait until the library has connected to the server, and the server says that it has connected to us."""
        library = threading.Thread(target=super().wait_for_server, daemon=True)
        library.start()
        while library.is_alive():
            library.join(3)
            if library.is_alive() and self.action_client.last_status_msg:
                self._register_again()
        while not rospy.is_shutdown() and not self._server_is_connected():
            time.sleep(0.02)

    def _register_again(self):
        """Have the master tell the server of us once more. Without it, a server without robust that has dropped our
        connections does not make them again (see connections.py, _OneAtATime)."""
        master = rosgraph.Master(rospy.get_name())
        for publisher in self.action_client.pub_goal, self.action_client.pub_cancel:
            try:
                master.registerPublisher(publisher.resolved_name, publisher.type, rospy.get_node_uri())
            except NO_ANSWER:
                pass  # later, then

    def _server_is_connected(self):
        try:
            server = self.action_client.last_status_msg._connection_header["callerid"]
            uri = rosgraph.Master(rospy.get_name()).lookupNode(server)
            _, _, connections = xmlrpc.client.ServerProxy(uri).getBusInfo(rospy.get_name())
        except NO_ANSWER:
            return True  # it cannot be asked
        topics = rospy.resolve_name(self.action_client.ns)
        connected = {(way, topic) for _, peer, way, _, topic, *_ in connections if peer == rospy.get_name()}
        return {("o", topics + "/result"), ("o", topics + "/feedback")} <= connected

    def send_goal(self, goal, done_cb=None, active_cb=None, feedback_cb=None):
        """Without it, an answer that comes before this returns is dropped as one for another goal."""
        with self.action_client.manager.list_mutex:  # it waits for this
            if self._shutting_down:
                raise cannot_start("the node was shut down before it sent its goal")
            self._heard.clear()
            self._why = ""
            shutdown.unfinished.add(self.action_client)
            super().send_goal(goal, done_cb, active_cb, feedback_cb)
            self._believe_no_older_status(self.gh.comm_state_machine)
        threading.Thread(target=self._watch, args=[self.gh], daemon=True).start()

    def _believe_no_older_status(self, machine):
        """Without it, a goal that is cancelled in its first moment is LOST when a status arrives that was sent before
        the server knew the goal (actionlib/action_client.py, update_status)."""
        self._mentioned = False
        self._mark_as_lost = machine._mark_as_lost
        machine._mark_as_lost = lambda: self._mentioned and self._mark_as_lost()

    def wait_for_result(self, timeout=rospy.Duration()):
        """Like actionlib's; returns False, too, when the server is lost."""
        return super().wait_for_result(timeout) and self.get_state() != GoalStatus.LOST

    def get_goal_status_text(self):
        """The server's words or, if the goal has no ending, why."""
        return self._why or super().get_goal_status_text()

    def get_failure(self):
        """Returns None if the goal SUCCEEDED, else why it did not (str): its state and the server's words, or why it
        was not sent."""
        if not self.gh:
            return self._why
        state = self.get_state()
        if state == GoalStatus.SUCCEEDED:
            return None
        return "goal %s: %s" % (name_of(state), self.get_goal_status_text())

    def _hear(self, status):
        handle = self.gh
        if handle and _id(handle) in [each.goal_id.id for each in status.status_list]:
            self._mentioned = True
            self._heard.set()

    def _watch(self, handle):
        """Without it, a client whose server is gone waits for ever, and a goal that rospy dropped is lost
        (rospy/topics.py, add_connection: when a peer connects twice)."""
        silence, repeat, ros, wall = 0.0, 1.0, rospy.get_time(), time.monotonic()
        while handle is self.gh and self.simple_state != SimpleGoalState.DONE and not rospy.is_shutdown():
            with self.done_condition:
                self.done_condition.wait(0.1)
            ros_before, wall_before, ros, wall = ros, wall, rospy.get_time(), time.monotonic()
            # What counts is time that passed on both clocks, so neither a paused simulation nor a jump of its clock is
            # silence; and no more than 0.5 s at once, for we may have been stopped ourselves.
            silence += max(0.0, min(ros - ros_before, wall - wall_before, 0.5))
            repeat -= wall - wall_before
            if self._heard.is_set():
                self._heard.clear()
                silence = 0.0
            if repeat <= 0 and handle.get_comm_state() == actionlib.CommState.WAITING_FOR_GOAL_ACK:
                repeat = 1.0
                self.action_client.pub_goal.publish(handle.comm_state_machine.action_goal)  # its id makes this harmless
            if silence > self._heartbeat_timeout:
                self._lose(handle, "server lost: silent for %.1f s (heartbeat_timeout is %g s)" % (
                    silence, self._heartbeat_timeout))

    def _lose(self, handle, why):
        machine = handle.comm_state_machine
        with machine.mutex:
            if machine.state != actionlib.CommState.DONE:
                self._why = why
                handle.cancel()  # in case the server is only asleep
                self._mark_as_lost()

    def _handle_transition(self, gh):
        if gh.get_goal_status() == GoalStatus.LOST and not self._why:
            self._why = "the server no longer knows the goal"
        if gh == self.gh and gh.get_goal_status() == GoalStatus.SUCCEEDED:
            shutdown.unfinished.discard(self.action_client)
        super()._handle_transition(gh)

    def _cancel_on_shutdown(self, deadline):
        """Without it, the server works on for nobody."""
        with self.action_client.manager.list_mutex:  # either send_goal is running, or it sends nothing from now on
            self._shutting_down = True
        if self._has_goal():
            self.cancel_goal()
        while self._has_goal() and time.monotonic() < deadline:
            time.sleep(0.01)
        if self._has_goal():
            self._why = "a cancel was sent, no ending came within 1 s"

    def _has_goal(self):
        return self.gh and self.simple_state != SimpleGoalState.DONE


def _id(handle):
    return handle.comm_state_machine.action_goal.goal_id.id
