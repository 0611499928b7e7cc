"""A bare Debian needs nothing but its base system for ./tutorial, which keeps every promise, as root and with sudo."""
import os
import re
import subprocess

import pytest

from conftest import ROOT, Machine
from harness import Process, check_client, check_seconds, run

pytestmark = pytest.mark.needs("root", "debootstrap", "ip", "nsenter", "ss")


@pytest.fixture(scope="module", ids="-".join, params=[
    ("bookworm", "learner"), ("trixie", "root"), ("bullseye", "root"), ("sid", "root")])
def machine(request, debian):
    suite, user = request.param
    checkout = "/srv" if user == "root" else "/home/learner/my tutorials"
    with Machine(debian(suite), user, checkout + "/actions_tutorial") as machine:
        if user == "learner":
            machine.let_sudo()
        yield machine


def megabytes(machine):
    return int(run("du", "-s", "--one-file-system", "--block-size=MB", str(machine.path)).split("MB")[0])


def others_files(machine):
    """Everything where packages put nothing: lines with checksum and path."""
    return set(machine.run("find", *"/home /opt /root /srv /tmp /var/tmp -type f -exec sha256sum {} +".split(),
                           user="root").stdout.splitlines())


@pytest.fixture(scope="module")
def before(machine):
    return others_files(machine), megabytes(machine)


@pytest.fixture(scope="module")
def demo(machine, before):
    """The first call. -> Process"""
    demo = machine.start(machine.tutorial, "demo", stderr=subprocess.STDOUT)
    demo.wait(900)
    demo.added = megabytes(machine) - before[1]
    print(demo)
    return demo


@pytest.fixture(scope="module")
def offline(machine, demo):
    """A later call, without network, apt-get and cmake. -> Process"""
    with machine.changed("/usr/bin/apt-get"), machine.changed("/usr/bin/cmake"), machine.offline():
        demo = machine.start(machine.tutorial, "demo", stderr=subprocess.STDOUT)
        demo.expect("bowl-2")
        inside = demo.usage.children()[0].pid
        demo.ports = Process(["nsenter", "--net", "--target", str(inside), "ss", "-ltnpH"])
        demo.ports.wait()
        demo.wait()
    print(demo, demo.ports, sep="\n")
    return demo


def first_bowl(demo):
    return next(second for second, _, line in demo.lines if "Feedback received" in line)


def test_the_demo_washes_seven_bowls_one_a_second(demo):
    check_client(demo, 0, 7)
    check_seconds(demo, within=0.3)


def test_it_takes_three_minutes_and_1200_megabytes_at_most_and_is_never_silent_for_ten_seconds(demo):
    seconds = [0] + [second for second, _, _ in demo.lines]
    assert first_bowl(demo) < 180
    assert max(after - before for before, after in zip(seconds, seconds[1:])) < 10, str(demo)
    assert 0 < demo.added < 1200


def test_the_next_call_installs_and_builds_nothing(machine, demo):
    assert machine.run(machine.tutorial, "shell", "true").lines == []


def test_all_tests_pass(machine, demo):
    # Root types the pages, too.
    names = [] if machine.user == "root" else sorted(
        name for name in os.listdir(os.path.join(ROOT, "test")) if name.endswith(".test"))
    tests = machine.start(machine.tutorial, "test", *names)
    status = tests.wait(1500)
    said = [line for _, _, line in tests.lines if not re.search(r"\]\[passed\]| PASSED", line)]
    assert status == 0 and re.fullmatch("[1-9][0-9]* passed, 0 failed", said[-1]), "\n".join(said)


def test_the_demo_without_network_apt_and_cmake_washes_seven_bowls_within_ten_seconds(offline):
    check_client(offline, 0, 7)
    assert first_bowl(offline) < 10
    # It says little, and the bowls last.
    assert len(offline.lines) <= 20 and "\x1b[31m" not in offline.stdout
    assert any("- bowl-6" in line for _, _, line in offline.lines[-2:])


def test_it_listens_on_loopback_only(offline):
    # rosout, which is not ours, does not.
    ports = [line.split() for line in offline.ports.stdout.splitlines() if '"rosout"' not in line]
    assert len(ports) >= 4 and all(re.match(r"127\.0\.0\.1:|\[::1\]:", port[3]) for port in ports)


def test_clean_leaves_nothing_but_the_packages(machine, before, demo):
    machine.run(machine.tutorial, "clean")
    assert others_files(machine) ^ before[0] == set()
