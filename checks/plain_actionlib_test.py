"""Each test that the table of doc/known_issues.md names fails on plain actionlib."""
import pathlib
import re

from pages import text_of
import pytest
from support.processes import PACKAGE, run

TESTS = pathlib.Path(PACKAGE, "test/robust")


@pytest.mark.parametrize("test", sorted(set(re.findall(r"`(test_\w+)` \|$", text_of("doc/known_issues.md"), re.M))))
def test_row_fails_on_plain_actionlib(workspace, master, test):
    file, = [file for file in TESTS.glob("*_test.py") if re.search(rf"def {test}\(", file.read_text(encoding="utf-8"))]
    if file.name == "simulated_time_test.py":
        run("rosparam", "set", "/use_sim_time", "true", **master.env)
    plain = master.start("env", "-C", str(TESTS.parent), "/usr/bin/python3", "-W", "ignore", "-m", "unittest",
                         "-k", test, f"robust/{file.name}", ACTIONLIB="plain")
    plain.expect(r"^(FAILED|OK)", timeout=200)  # some of its threads do not end then
    assert re.search(rf"^(FAIL|ERROR): {test} (.*\n)+?.*, in {test}\n", plain.stderr, re.M), str(plain)
