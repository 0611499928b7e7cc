"""A bare Debian needs nothing but its base system for ./tutorial, as root and with sudo."""
import re
import subprocess

import pytest

from conftest import Machine
from support.printed import bowls, printed_bowls

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter")


@pytest.fixture(scope="module", ids="-".join, params=[
    ("bookworm", "learner"), ("trixie", "root"), ("sid", "root")])
def machine(request, debian):
    suite, user = request.param
    checkout = "/srv" if user == "root" else "/home/learner/my tutorials"
    with Machine(debian(suite), user, checkout + "/actions_tutorial") as machine:
        if user == "learner":
            machine.let_sudo()
        yield machine


def files_of_users(machine):
    """Everything where packages put nothing: lines with checksum and path."""
    return set(machine.run("find", *"/home /opt /root /srv /tmp /var/tmp -type f -exec sha256sum {} +".split(),
                           user="root").stdout.splitlines())


@pytest.fixture(scope="module")
def before(machine):
    return files_of_users(machine)


@pytest.fixture(scope="module")
def demo(machine, before):
    """The first call. -> Process"""
    demo = machine.start(machine.tutorial, "demo", stderr=subprocess.STDOUT)
    demo.wait(900)
    print(demo)  # shown with a failure
    return demo


def check_demo(demo):
    assert demo.wait() == 0 and printed_bowls(demo)[1] == bowls(7), str(demo)
    # actionlib's client may miss the first on a busy machine.
    assert printed_bowls(demo)[0] in (bowls(7), bowls(7)[1:]), str(demo)


def test_the_first_demo_washes_seven_bowls(demo):
    check_demo(demo)


def test_the_next_demo_needs_no_network_apt_or_cmake(machine, demo):
    with machine.changed("/usr/bin/apt-get"), machine.changed("/usr/bin/cmake"), machine.offline():
        again = machine.run(machine.tutorial, "demo", stderr=subprocess.STDOUT)
    check_demo(again)
    assert again.lines[-1][0] < 20 and again.stdout.count("\n") <= 20, str(again)


def test_all_tests_pass_and_pages_are_typed(machine, demo):
    tests = machine.start(machine.tutorial, "test")
    status = tests.wait(1500)
    shown = [line for _, _, line in tests.lines if not re.search(r"\]\[passed\]| PASSED", line)]
    assert status == 0 and re.fullmatch(r"[1-9]\d* passed, 0 failed(, \d+ skipped)?", shown[-1]), "\n".join(shown)


def test_clean_leaves_nothing_but_the_packages(machine, before, demo):
    machine.run(machine.tutorial, "clean")
    assert files_of_users(machine) == before
