"""A bare Debian needs nothing but its base system for ./tutorial, as root and with sudo."""
import re
import subprocess

import pytest

from machines import Machine
from support.printed import bowls, printed_bowls

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")


@pytest.fixture(scope="module", ids="-".join, params=[("bookworm", "learner"), ("trixie", "root"), ("sid", "root")])
def machine(request, debian):
    suite, user = request.param
    checkout = "/srv" if user == "root" else "/home/learner/my tutorials"
    with Machine(debian(suite), user, checkout + "/actions_tutorial") as machine:
        if user == "learner":
            machine.let_sudo()
        machine.at_first = files_of_users(machine)
        yield machine


def files_of_users(machine):
    """Everything where packages put nothing: lines with checksum and path."""
    return set(machine.run("find", *"/home /opt /root /srv /tmp /var/tmp -type f -exec sha256sum {} +".split(),
                           user="root").stdout.splitlines())


def washes_seven_bowls(machine, **options):
    """-> Process, the demo"""
    demo = machine.run(machine.tutorial, "demo", stderr=subprocess.STDOUT, **options)
    # The result only: actionlib's client may miss the first feedback on a busy machine.
    assert printed_bowls(demo)[1] == bowls(7), str(demo)
    return demo


def test_the_first_demo_washes_seven_bowls(machine):
    washes_seven_bowls(machine)


def test_the_next_demo_needs_no_network_apt_or_cmake(machine):
    machine.run(machine.tutorial, "shell", "true")  # if only this test runs
    with machine.changed("/usr/bin/apt-get"), machine.changed("/usr/bin/cmake"):
        demo = washes_seven_bowls(machine, offline=True)
    assert demo.lines[-1][0] < 20 and len(demo.lines) <= 20, str(demo)


def test_every_test_passes_with_the_pages_typed(machine):
    tests = machine.start(machine.tutorial, "test")
    status = tests.wait(1500)
    shown = [line for _, _, line in tests.lines if not re.search(r"\]\[passed\]| PASSED", line)]
    assert status == 0 and re.fullmatch(r"[1-9]\d* passed, 0 failed(, \d+ skipped)?", shown[-1]), "\n".join(shown)


def test_clean_leaves_nothing_but_the_packages(machine):
    machine.run(machine.tutorial, "clean")
    assert files_of_users(machine) == machine.at_first
