"""What the action clients in scripts/ print."""
import re

# Harmless lines that a busy machine adds, as a regular expression: an error that actionlib's client logs when an answer
# comes before its send_goal has returned (ros/actionlib #206), and rospy's warning when a peer connects twice.
NOISE = (r"\[ERROR\] .*: Got a transition callback on .*\n"
         r"|\[WARN\] .*: Inbound TCP/IP connection failed: .*\n")


def bowls(count):
    """Returns the names (list of str) of the first bowls."""
    return ["bowl-%d" % i for i in range(count)]


def printed_bowls(client):
    """Returns the bowls that a client (Process) has printed as feedback, and those of its result or None."""
    feedback, _, result = client.stdout.partition("The result is: ")
    named = [line.split('"')[1] for line in feedback.splitlines() if "last_dish_washed" in line]
    return named, [line[4:] for line in result.splitlines() if line.startswith("  - ")] if result else None


def without_noise(text):
    """Returns the output (str) of a client without the lines that a busy machine adds."""
    return re.sub(NOISE, "", text)


def check_client(client, status, count):
    """Wait for the end of a client (Process). Expect an exit status, and count bowls as feedback and as result."""
    assert client.wait(60) == status, "expected exit status %d of %s" % (status, client)
    assert printed_bowls(client) == (bowls(count), bowls(count)), "expected %d bowls of %s" % (count, client)
