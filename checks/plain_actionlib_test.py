"""Each test that doc/known_issues.md names fails on plain actionlib, but for those that do so by chance."""
import os
import pathlib
import re

from pages import text_of
from support.processes import PACKAGE

TESTS = pathlib.Path(PACKAGE, "test/robust")


def test_what_the_table_names_fails_on_plain_actionlib(workspace, master):
    rows = re.findall(r"\| ([^|]*) \| [^|]* \| `(test_\w+)` \|$", text_of("doc/known_issues.md"), re.M)
    named, by_chance = ({test for symptom, test in rows if words in symptom} for words in ("", "by chance"))
    files = [file.name for file in TESTS.glob("*_test.py") if named & set(re.findall(r"def (\w+)", file.read_text()))]
    plain = master.start("env", "-C", str(TESTS), "/usr/bin/python3", "-W", "ignore", "-m", "pytest", "-v", "--tb=no",
                         "-p", "no:cacheprovider", "-k", " or ".join(named), *files, ACTIONLIB="plain",
                         PYTHONPATH="%s/test:%s" % (PACKAGE, os.environ["PYTHONPATH"]))
    plain.expect(r"^=+ .*\bfailed\b.* in ", timeout=600)  # some of its threads do not end then
    outcomes = dict(re.findall(r"::(test_\w+) (PASSED|FAILED)", plain.stdout))
    assert named <= set(outcomes), str(plain)
    assert {test for test in named if outcomes[test] == "PASSED"} <= by_chance, str(plain)
