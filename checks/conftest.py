"""What the checks share: a workspace, a bare Debian, and what a check needs (without it, the check is skipped)."""
import os
import shutil
import sys

import pytest

sys.path.insert(0, os.path.realpath(__file__ + "/../../test"))  # where support is
from support.processes import Master, PACKAGE, run  # noqa: E402


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    for name in [name for mark in item.iter_markers("needs") for name in mark.args]:
        if os.geteuid() if name == "root" else not shutil.which(name):
            pytest.skip("this needs %s" % name)


@pytest.fixture(scope="session")
def workspace(tmp_path_factory):
    """A workspace with the package in it, thrown away; what is started afterwards runs as in ./tutorial shell."""
    folder = tmp_path_factory.mktemp("workspace")
    variables = run(PACKAGE + "/tutorial", "shell", "env", "-u", "TUTORIAL_WS", "-u", "ROS_HOSTNAME", "-0",
                    TUTORIAL_WS=str(folder), timeout=600)
    os.environ.clear()
    os.environ.update(pair.split("=", 1) for pair in variables.split("\0")[:-1])
    yield folder
    shutil.rmtree(str(folder))


@pytest.fixture
def master():
    with Master() as master:
        yield master


@pytest.fixture(scope="session")
def debian(tmp_path_factory):
    """Makes the bare system of a suite (str), once. -> pathlib.Path"""
    made = {}

    def make(suite):
        if suite not in made:
            folder = made[suite] = tmp_path_factory.mktemp(suite)
            run("debootstrap", "--variant=minbase", suite, str(folder), timeout=900)
            folder.chmod(0o755)
            shutil.copy("/etc/resolv.conf", str(folder / "etc"))
            (folder / "etc/hosts").write_text("127.0.0.1 localhost\n")
        return made[suite]

    yield make
    for folder in made.values():
        shutil.rmtree(str(folder))
