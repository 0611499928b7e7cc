"""Counts the tests in the JUnit files below a folder, the argument, and shows what those that failed had to say. Exit
status 1 if one failed or none passed."""
import pathlib
import sys
import xml.etree.ElementTree


def main(folder):
    passed = failed = skipped = 0
    for file in sorted(pathlib.Path(folder).rglob("*.xml")):
        for case in xml.etree.ElementTree.parse(str(file)).iter("testcase"):
            problems = case.findall("failure") + case.findall("error")
            failed += bool(problems)
            skipped += case.find("skipped") is not None
            # A .test as a whole, rostest-NAME.xml, counts only if it broke off.
            passed += not (problems or case.find("skipped") is not None or file.name.startswith("rostest-"))
            for problem in problems:
                print("%s\n%s\n" % (case.get("name"), problem.text or problem.get("message")))
    print("%d passed, %d failed%s" % (passed, failed, ", %d skipped" % skipped if skipped else ""))
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
