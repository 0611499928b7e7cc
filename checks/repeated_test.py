"""All tests, but for the pages, again and again: pytest-3 checks -k repeated --runs 20 --busy 4"""
import os

import pytest

from conftest import ROOT
from processes import Group, run


def pytest_generate_tests(metafunc):
    runs = range(metafunc.config.getoption("runs"))
    metafunc.parametrize("number", runs or [pytest.param(0, marks=pytest.mark.skip(reason="this needs --runs"))])


@pytest.fixture(scope="module")
def busy(request):
    """Processes that keep the cores busy."""
    with Group() as group:
        for _ in range(request.config.getoption("busy")):
            group.start("sh", "-c", "while :; do :; done")
        yield


def test_all_tests_pass(number, busy):
    # Named, so that no page is typed
    tests = [name for name in os.listdir(os.path.join(ROOT, "test")) if name.endswith(".test")]
    run(os.path.join(ROOT, "tutorial"), "test", *tests, timeout=1800)
