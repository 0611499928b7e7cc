"""The pages, their blocks, and what a reader saves."""
import pathlib
import re

from support.processes import PACKAGE

PAGES = ["README.md"] + sorted(str(page.relative_to(PACKAGE)) for page in pathlib.Path(PACKAGE, "doc").rglob("*.md"))
LESSONS = [page for page in PAGES if page.startswith("doc/lessons/")]
EDIT = re.compile("(Save this|Change) .*`~/([^`]*)`:$")  # the line above what a reader saves


def text_of(file):
    return pathlib.Path(PACKAGE, file).read_text(encoding="utf-8")


def blocks_of(page):
    """Yields line number, language, last non-empty line above, and text of each fenced block."""
    text = text_of(page)
    for match in re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.M | re.S):
        above = text[:match.start()].rstrip().rpartition("\n")[2]
        yield text.count("\n", 0, match.start()) + 1, match.group(1), above, match.group(2)


def edited(how, text, change):
    """Returns what a text (str) becomes when it is saved anew, or changed by a diff with … between two places."""
    if how == "Save this":
        return change
    for place in change.split("…\n"):
        old, new = ("".join(re.findall("(?m)^[ %s](.*\n)" % sign, place)) for sign in "-+")
        assert text.count(old) == 1, "this is not there once:\n%s" % old
        text = text.replace(old, new)
    return text
