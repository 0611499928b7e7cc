"""The table of doc/known_issues.md names all tests of known_issues_test.py, and each fails on plain actionlib, but for
those that do so by chance."""
import os
import re

from conftest import ROOT

TESTS = os.path.join(ROOT, "test", "robust")


def test_the_table_names_what_fails_on_plain_actionlib(workspace, master):
    with open(os.path.join(ROOT, "doc", "known_issues.md"), encoding="utf-8") as page:
        rows = re.findall(r"\| ([^|]*) \| [^|]* \| `(test_\w+)` \|$", page.read(), re.M)
    plain = master.start("env", "-C", TESTS, "/usr/bin/python3", "-W", "ignore", "-m", "pytest", "-v", "--tb=no",
                         "-p", "no:cacheprovider", "known_issues_test.py", ACTIONLIB="plain")
    plain.expect(r"^=+ .*\bfailed\b.* in ", timeout=600)  # some of its threads do not end then
    outcomes = dict(re.findall(r"::(test_\w+) (PASSED|FAILED)", plain.stdout))
    by_chance = {test for symptom, test in rows if "by chance" in symptom}
    assert set(outcomes) == {test for _, test in rows}, str(plain)
    assert {test for test in outcomes if outcomes[test] == "PASSED"} <= by_chance, str(plain)
