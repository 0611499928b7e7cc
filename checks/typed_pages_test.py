"""Types the tutorial: walks each page from top to bottom, in real terminals, and compares what comes with what the page
shows.

In a ```console block, `# Terminal N` names the terminal of what follows; `# By hand` marks the little that is not run.
`$ ` begins a command, `^C` is Ctrl-C, TAB and BACKSPACE are keys; the other lines are output, in which … stands for
anything within a line and, alone on a line, for any lines. Output that the page does not show is a difference, too.
A block of another kind below "Save this … `~/FILE`:" is saved; below "Change … `~/FILE`:" it is a diff, with … between
two places. Each page has a home and a master of its own, and begins with a bare shell in each terminal.
"""
import codecs
import difflib
import os
import re
import select
import shutil
import time

import pexpect
import pytest

from conftest import ROOT
from processes import bound_socket

PAGES = ["README.md"] + sorted(
    os.path.join("doc", name) for name in os.listdir(os.path.join(ROOT, "doc")) if name.endswith(".md"))
LIMIT = 300  # s to wait for what the page shows, many times what it takes; Debian 11 builds GMock, too
PROMPT = "README> "
# Not the page's: what Debian 11's ROS, which is older than its Python, says whenever it ends; what rospy's tools say
# when a peer connects twice, now and then.
NOISE = re.compile(r"(Error in atexit._run_exitfuncs:\n)?Traceback .*\n(  .*\n)+AttributeError: .* 'isAlive'\n"
                   r"|\[WARN\] .*: Inbound TCP/IP connection failed: .*\n")
KEYS = {"TAB": "\t", "BACKSPACE": "\x7f"}


class Step:
    """Something to type (str, or None to look only) in a terminal (str), and the lines (number, str) shown below it."""

    def __init__(self, section, terminal, number, typed):
        self.section, self.terminal, self.number, self.typed = section, terminal, number, typed or ""
        self.shown = []
        self.returns = False  # whether the page types the next command into this terminal after it


class Edit:
    """A file (str, below the home) to write in an editor: how (str) tells whether all of it or what a diff changes."""

    def __init__(self, section, how, file):
        self.section, self.how, self.file, self.text = section, how, file, ""

    def do(self, home):
        path = os.path.join(home, self.file)
        text = self.text
        if self.how == "Change":
            text = open(path, encoding="utf-8").read()
            for place in self.text.split("…\n"):
                old, new = ("".join(re.findall("(?m)^[ %s](.*\n)" % sign, place)) for sign in "-+")
                if text.count(old) != 1:
                    raise AssertionError("%s has not once:\n%s" % (self.file, old))
                text = text.replace(old, new)
        with open(path, "w", encoding="utf-8") as file:
            file.write(text)


def steps_of(page):
    """Returns the steps (list of Step and Edit) of a page (str)."""
    with open(os.path.join(ROOT, page), encoding="utf-8") as file:
        lines = file.read().splitlines()
    steps, section, fence, above = [], "", None, ""
    for number, line in enumerate(lines, 1):
        line = line.rstrip()
        if line.startswith("```"):
            fence, terminals, block = None if fence else line[3:] or "text", None, []
            edit = fence and re.search(r"(Save this|Change) .*`~/([^`]*)`:$", above)
            if edit:
                steps.append(Edit(section, *edit.groups()))
        elif not fence:
            section = re.sub("^#+ ", "", line) if re.match("##? ", line) else section
            above = line
        elif edit:
            steps[-1].text += line + "\n"
        elif fence == "console" and re.match("# (Terminals? |By hand)", line):
            terminals, block = re.findall(r"\b\d\b", line.split(":")[0]), []
        elif fence == "console" and terminals is None:
            raise AssertionError("line %d: neither `# Terminal N` nor `# By hand` begins this block" % number)
        elif fence == "console" and terminals:
            typed = line if re.match(r"\$ |\^C|(TAB|BACKSPACE)\b", line) else None
            if typed or not block:
                block = [Step(section, terminal, number, typed) for terminal in terminals]
                for step in block:
                    for before in [s for s in steps if isinstance(s, Step) and s.terminal == step.terminal][-1:]:
                        before.returns = step.typed.startswith("$ ")
                steps += block
            if not typed or typed.startswith("^C"):
                for step in block:
                    step.shown.append((number, line))
    return steps


def pattern_of(line):
    """Returns the regular expression (str) that a line shown stands for."""
    return r"(?:.*\n)*?" if line == "…" else re.escape(line).replace("…", ".*?") + r"[ \t]*\n"


class Terminal:
    """A real terminal with a shell in it, one of all (dict): they are read together, lest one fills up while we look at
    another."""

    def __init__(self, everyone, environment):
        # Dumb and wide: readline then shows a command on one line, whatever its length.
        self.shell = pexpect.spawn("/bin/bash", cwd=ROOT, env=environment, dimensions=(50, 1000))
        self.decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self.tail = self.text = ""  # what came and was not looked at yet
        self.last, self.any_more, self.all = None, False, everyone

    def wait(self, happened, limit=LIMIT):
        """Read all terminals until happened(), at most limit s. Returns whether it has."""
        end = time.monotonic() + limit
        while not happened():
            terminals = {t.shell.fileno(): t for t in self.all.values() if not t.shell.closed}
            ready = select.select(list(terminals), [], [], max(0.0, end - time.monotonic()))[0]
            if not ready:
                return False
            for descriptor in ready:
                terminals[descriptor].read()
        return True

    def read(self):
        """Take what is there, without colours and titles."""
        try:
            data = os.read(self.shell.fileno(), 65536)
        except OSError:  # its shell has ended
            data = b""
        if not data:
            self.shell.close()
        output = self.tail + self.decoder.decode(data)
        self.tail = re.search(r"(\x1b(\[[0-9;?]*|\][^\x07]*)?|\r)?\Z", output).group()
        output = output[:len(output) - len(self.tail)]
        self.text += re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]|\x1b\][^\x07]*\x07|\x07|\r(?=\n)", "", output)
        self.text = NOISE.sub("", self.text.replace("(actions_tutorial) " + PROMPT, PROMPT))

    def walk(self, step):
        """Type what the step types and wait for what it shows. AssertionError if it does not come."""
        if step.typed.startswith("$ "):
            self.finish()
            self.text = self.text[self.text.index(PROMPT) + len(PROMPT):]
        self.last = step
        typed = re.sub(r"^\$ ", "", step.typed)
        completes = typed.endswith(" TAB")
        if typed.startswith("^C"):
            self.shell.send("\x03")
        elif typed:
            keys = re.sub(r"(?<!\S)(TAB|BACKSPACE)(?: |$)", lambda match: KEYS[match.group(1)], typed)
            self.shell.send(keys + ("" if completes else "\n"))
        if typed and not completes and not typed.startswith("^C"):
            if not self.wait(lambda: "\n" in self.text):
                raise AssertionError("line %d: no echo of what was typed" % step.number)
            self.text = self.text[self.text.index("\n") + 1:]

        lines = [line for _, line in step.shown]
        before, self.any_more = self.any_more, lines[-1:] == ["…"]
        lines = ["…"] * before + lines[:len(lines) - self.any_more]
        pattern = "".join(map(pattern_of, lines))
        if step.returns and not self.any_more:
            pattern += r"(?=\s*%s)" % PROMPT
        # A prompt may follow without a new line; readline shows the new lines of a command as ^J.
        self.wait(lambda: PROMPT in self.text or re.match(pattern, self.came(completes)))
        match = re.match(pattern, self.came(completes))
        if not match:
            self.differs(step, self.came(completes))
        self.text = self.came(completes)[match.end():]

    def came(self, completes=False):
        if completes:
            return self.text.replace("^J", "\n") + "\n"
        return re.sub("(?<!\n)" + PROMPT, "\n" + PROMPT, self.text)

    def finish(self):
        """Wait for the end of the last command, and that no more came than the page shows."""
        if not self.wait(lambda: PROMPT in self.text):
            raise AssertionError("line %d: %s has not ended" % (self.last.number, self.last.typed))
        rest = self.text[:self.text.index(PROMPT)]
        if rest.strip() and not self.any_more:
            self.differs(None, rest)
        self.any_more = False

    def differs(self, step, came):
        """AssertionError with the lines shown and those that came, and the number of the first that differs."""
        came = came.split(PROMPT)[0].rstrip().splitlines()
        shown = [line for _, line in step.shown] if step else []
        patterns = [(re.compile(pattern_of(line)), line) for line in shown if line != "…"]
        came = [next((line for pattern, line in patterns if pattern.fullmatch(got + "\n")), got) for got in came]
        difference = [line for line in difflib.ndiff(shown, came) if line[0] in "-+ " and line != "- …"]
        numbers = [number for number, line in step.shown if "- " + line in difference] if step else []
        raise AssertionError("line %d, in terminal %s (- is on the page, + came within %d s):\n  %s" % (
            numbers[0] if numbers else self.last.number, self.last.terminal, LIMIT, "\n  ".join(difference)))

    def close(self):
        """End what runs here."""
        for keys in ("\x03", "exit\n", "exit\n"):
            if not self.shell.closed:
                self.shell.send(keys)
                self.wait(lambda: self.shell.closed or PROMPT in self.text, 20)
        self.shell.close()


def make_home(home, port):
    """Write what a user's shell reads. Returns the environment of a terminal: the user's own, without ROS. port: the
    master's."""
    with open(os.path.join(home, ".bashrc"), "w", encoding="utf-8") as bashrc:
        # The page says roscore, which takes the usual port; here it must not, because someone may be using it.
        bashrc.write("PS1=%r; bind 'set enable-bracketed-paste off'; roscore() { command roscore -p %d \"$@\"; }\n"
                     "for setup in /opt/ros/{noetic,one}/setup.bash; do [[ ! -f $setup ]] || source $setup; done\n"
                     "export ROS_MASTER_URI=http://localhost:%d ROS_HOSTNAME=localhost\n" % (PROMPT, port, port))
    environment = {name: value for name, value in os.environ.items()
                   if not re.match("ROS|CMAKE_PREFIX_PATH|LD_LIBRARY_PATH|PKG_CONFIG_PATH|PYTHON", name)}
    # The page's files go to ~, which is not the user's here; the workspace of ./tutorial is where it always is.
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    # ROS_HOME: rospack does not go by HOME, but by what the system knows of the user.
    environment.update(HOME=home, ROS_HOME=home + "/.ros", XDG_CACHE_HOME=cache, TERM="dumb", LC_ALL="C.UTF-8",
                       PYTHONDONTWRITEBYTECODE="1")
    return environment


class Walk:
    """A page (str) with a home and terminals of its own, typed as far as it was asked for."""

    def __init__(self, page, home):
        self.steps, self.home, self.terminals, self.failed = steps_of(page), home, {}, None
        self.bound = bound_socket()
        self.environment = make_home(home, self.bound.getsockname()[1])

    def to_the_end_of(self, section):
        last = max(number for number, step in enumerate(self.steps) if step.section == section)
        todo, self.steps = self.steps[:last + 1], self.steps[last + 1:]
        for step in todo:
            if isinstance(step, Edit):
                step.do(self.home)
            else:
                if step.terminal not in self.terminals:
                    self.terminals[step.terminal] = Terminal(self.terminals, self.environment)
                self.terminals[step.terminal].walk(step)

    def close(self):
        for terminal in reversed(list(self.terminals.values())):
            terminal.close()
        self.bound.close()
        shutil.rmtree(self.home)


@pytest.fixture(scope="module")
def walk_of(tmp_path_factory):
    """The walk of a page (str), the same until another page's begins. -> Walk"""
    walks = {}

    def walk_of(page):
        if page not in walks:
            close()
            walks[page] = Walk(page, str(tmp_path_factory.mktemp("home")))
        return walks[page]

    def close():
        while walks:
            walks.popitem()[1].close()

    yield walk_of
    close()


@pytest.mark.parametrize("page, section", [
    pytest.param(page, section, id="%s: %s" % (page, section)) for page in PAGES
    for section in dict.fromkeys(step.section for step in steps_of(page))])
def test_what_comes_is_what_the_page_shows(walk_of, page, section):
    walk = walk_of(page)
    if walk.failed:
        pytest.skip("this needs %s to be as shown" % walk.failed)
    walk.failed = section
    walk.to_the_end_of(section)
    walk.failed = None
