"""What the pages say, without typing it: links, quotes, states, pictures; and that the action, the service and the
programs of the lessons end as this repository's files.

A block of code is quoted from the file that is linked last in the line above it, or else from the file of the block
before it. "The whole file [NAME](PATH):" is written above a block that has all of it; in others, … on a line stands
for lines left out. pages_typed_test.py tries the blocks that a reader saves.
"""
import difflib
import json
import os
import re
import subprocess

import pytest

from pages import EDIT, LESSONS, PAGES, blocks_of, edited, text_of
from support.processes import PACKAGE, run

PARSE = """
const {JSDOM} = require('jsdom');
global.window = new JSDOM('').window; for (const name of ['document', 'Option']) global[name] = window[name];
import(require.resolve('mermaid').replace(/[^/]*$/, 'mermaid.core.mjs')).then(async ({default: mermaid}) => {
  for (const text of JSON.parse(require('fs').readFileSync(0))) await mermaid.parse(text);
}).catch(error => { console.error(String(error)); process.exit(1); });
"""


def anchors_of(page):
    """Returns the anchors (list of str) of a page's headings, by GitHub's rules."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.M | re.S)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
            for heading in re.findall(r"^#+ (.*)$", text, re.M)]


@pytest.mark.parametrize("page", PAGES + ["CONTRIBUTING.md"])
def test_links(page):
    """A link leads to a file, to a heading, or to another site."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.M | re.S)
    for picture, label, target in re.findall(r"(!?)\[([^]]*)\]\(([^)\s]+)\)", text):
        if ":" not in target:
            file, _, anchor = target.partition("#")
            file = os.path.normpath(os.path.join(os.path.dirname(page), file)) if file else page
            assert os.path.exists(os.path.join(PACKAGE, file)), "no file for [%s](%s)" % (label, target)
            assert not anchor or anchor in anchors_of(file), "no heading for [%s](%s)" % (label, target)
        assert not picture or len(label) > 20, "a picture without alternative text"


@pytest.mark.parametrize("page", PAGES + ["CONTRIBUTING.md"])
def test_quotes(page):
    """Quoted code is in the file that it comes from, word for word in this order; a diff is the whole difference."""
    sources = []
    for number, language, above, text in blocks_of(page):
        if language in ("console", "mermaid") or "**Layout" in above or EDIT.search(above):
            continue
        linked = re.findall(r"\]\(([\w/.]+)\)", above)
        sources = [text_of(os.path.join(os.path.dirname(page), file)) for file in linked] or sources
        assert sources, "line %d: quoted from no file" % number
        if language == "diff":
            compared = difflib.unified_diff(*(source.splitlines(True) for source in sources[-2:]), n=0)
            whole = [line for line in compared if re.match(r"[-+](?!--|\+\+)", line)]
            assert whole == [line for line in text.splitlines(True) if line[0] in "-+"], \
                "line %d: the difference is\n%s" % (number, "".join(whole))
        elif "whole file [" in above:
            assert text == sources[-1], "line %d: this is not the whole file" % number
        else:
            source, text = (re.sub("(?m)^ +", "", code) for code in (sources[-1], text))
            pattern = "^.*?^".join(map(re.escape, re.split("(?m)^…\n", text)))
            assert re.search("(?ms)^" + pattern, source), "line %d: this is not in its file:\n%s" % (number, text)


def test_files_of_the_lessons_are_the_repositorys():
    files = {}
    for _, _, above, text in (block for page in LESSONS for block in blocks_of(page)):
        edit = re.search("(Save this|Change) .*`~/catkin_ws/src/actions_tutorial/((action|srv|scripts)/.*)`:$", above)
        if edit:
            files[edit.group(2)] = edited(edit.group(1), files.get(edit.group(2)), text)
    assert len(files) == 5
    for file, text in files.items():
        assert text == text_of(file), file


def test_versions_agree():
    stated = [re.search(words, text_of(file), re.M).group(1) for file, words in (
        ("package.xml", "<version>(.*)</version>"), ("CHANGELOG.rst", r"^(\d[\d.]*) \("),
        ("src/actions_tutorial/robust.py", '^__version__ = "(.*)"'))]
    assert len(set(stated)) == 1, stated


def test_states():
    shown = re.findall(r"(?m)^\| (\d) \| ([A-Z]+) \|", text_of("doc/lessons/5_stop_a_goal.md"))
    real = run(os.path.join(PACKAGE, "tutorial"), "shell", "rosmsg", "show", "actionlib_msgs/GoalStatus")
    assert sorted(shown) == sorted((number, name) for name, number in re.findall(r"uint8 ([A-Z]+)=(\d)", real))


def test_pictures():
    texts = [text for page in PAGES for _, language, _, text in blocks_of(page) if language == "mermaid"]
    assert len(texts) >= 2
    if subprocess.run(["sh", "-c", "node -e 'require.resolve(\"jsdom\"); require.resolve(\"mermaid\")'"]).returncode:
        pytest.skip("this needs node, and in NODE_PATH mermaid and jsdom")
    parsed = subprocess.run(["node", "-e", PARSE], input=json.dumps(texts), stderr=subprocess.PIPE, text=True)
    assert parsed.returncode == 0, parsed.stderr
