"""Types pages from top to bottom, in real terminals, and compares the output with what they show.

In a ```console block, `# Terminal N` names the terminal of what follows. `$ ` begins a command, `^C` is Ctrl-C, TAB and
BACKSPACE are keys. The other lines are output, in which … stands for anything within a line or, on its own, for
any lines. Output that the page does not show is a difference, too, but after ^C it may be anything until the next
command in that terminal. A block below the line `<!-- not typed -->` is for people only. A block of another kind below
"Save this … `~/FILE`:" is saved; below "Change … `~/FILE`:" it is a diff, with … between two places. Folded solutions
(<details>) are typed like everything else.
"""
import contextlib
import difflib
import re
import time
import types

import pexpect

from pages import EDIT, blocks_of, edited
from support import printed

LIMIT = 300  # s to wait for what the page shows, many times what it takes
PROMPT = "typed> "
# Colours, titles and bells; and what the page does not show: lines that a busy machine adds; and of ./tutorial, that it
# waits, and how its prompt begins.
NOISE = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]|\x1b\][^\x07]*\x07|\x07|\r(?=\n)"
                   r"|%s|waiting for another \./tutorial …\r?\n|\((ros|actions_tutorial)\) (?=%s)" % (
                       printed.NOISE, PROMPT))
FIRST_FEEDBACK = re.compile(' *(Feedback received: last_dish_washed: "|feedback: )bowl-0"?')
KEYS = {"TAB": "\t", "BACKSPACE": "\x7f"}
# Goals that are over at once: actionlib's client may miss the outcome (ros/actionlib #206). The pages say that one then
# presses Ctrl-C and runs the client again.
OVER_AT_ONCE = re.compile(r"rosrun .*_client\.py( -3| 101)?$")


def steps_of(page, left_out=()):
    """Returns what a reader of the page (str) does: edits (how, file, text), and steps with terminal (str), the line of
    the page, what is typed (str, "" to look only), and the lines (list of str) shown below it. left_out: marks (str)
    above blocks that are skipped."""
    steps = []
    for first, language, above, text in blocks_of(page):
        edit, terminals = EDIT.search(above), None
        if above in ("<!-- not typed -->", *left_out):
            continue
        if edit:
            steps.append(edit.groups() + (text,))
        for number, line in enumerate(text.splitlines() if language == "console" else [], first + 1):
            if re.match("# Terminals? ", line):
                terminals, block = re.findall(r"\b\d\b", line.split(":")[0]), []
                continue
            assert terminals is not None, "line %d: no `# Terminal N` begins this block" % number
            typed = re.match(r"\$ |\^C|(TAB|BACKSPACE)\b", line)
            if typed or not block:
                block = [types.SimpleNamespace(terminal=terminal, line="%s, line %d" % (page, number),
                                               typed=line if typed else "", shown=[]) for terminal in terminals]
                steps += block
            for step in [] if typed else block:
                step.shown.append(line)
    return steps


def edit(how, path, text):
    """Write a file (pathlib.Path) as in an editor: all of it, or what a diff changes."""
    path.write_text(edited(how, path.exists() and path.read_text(encoding="utf-8"), text), encoding="utf-8")


def pattern_of(line):
    """Returns the regular expression (str) that a line shown stands for."""
    return r"(?:.*\n)*?" if line == "…" else re.escape(line.rstrip()).replace("…", ".*?") + r"[ \t]*\n"


class Terminal:
    """A real terminal with a shell in it. everyone: all terminals (dict); they are read together, so that none blocks
    because its output is not read. folder: where it begins."""

    def __init__(self, everyone, environment, folder):
        # Dumb and wide: readline then shows a command on one line, whatever its length.
        self.shell = pexpect.spawn("/bin/bash", cwd=folder, env=environment, dimensions=(50, 1000), encoding="utf-8",
                                   codec_errors="replace")
        self.all, self.text = everyone, ""  # text: what came and was not looked at yet
        self.may_go_on, self.stopped = False, False  # stopped: ^C was typed, and no command since

    def wait(self, happened, limit=LIMIT):
        """Read all terminals until happened(), at most limit s. Returns whether it has."""
        end = time.monotonic() + limit
        while not happened() and time.monotonic() < end:
            for terminal in self.all.values():
                terminal.read()
        return happened()

    def read(self):
        """Read what is there; a prompt is on a line of its own, also after output that does not end with one."""
        try:
            self.text += "" if self.shell.closed else self.shell.read_nonblocking(65536, timeout=0.02)
        except pexpect.EOF:
            self.shell.close()
        except pexpect.TIMEOUT:
            return
        self.text = re.sub("(?<!\n)" + PROMPT, "\n" + PROMPT, NOISE.sub("", self.text))

    def walk(self, step, returns):
        """Type what the step types and wait for what it shows, and for the prompt if it returns, which means that the
        page types the next command after it. AssertionError if it does not come."""
        typed = re.sub(r"^\$ ", "", step.typed)
        completes = typed.endswith(" TAB")
        if typed != step.typed:
            self.finish(step)
        if typed == "^C":
            self.shell.send("\x03")
            self.stopped = True
            self.finish(step, "^C")
        elif typed:
            self.stopped = False
            keys = re.sub(r"(?<!\S)(TAB|BACKSPACE)(?: |$)", lambda match: KEYS[match.group(1)], typed)
            self.shell.send(keys)
            if not completes:
                self.enter(step)
                if OVER_AT_ONCE.match(typed) and not self.wait(lambda: self.text.strip(), 20):
                    self.shell.send("\x03")
                    self.may_go_on = True
                    self.finish(step)
                    self.shell.send(keys)
                    self.enter(step)

        before, goes_on = self.may_go_on or self.stopped, step.shown[-1:] == ["…"]
        self.may_go_on = goes_on or self.stopped
        lines = ["…"] * before + step.shown[:len(step.shown) - goes_on]
        # On a busy machine actionlib's client may miss the first feedback (ros/actionlib #206).
        pattern = "".join("(?:%s)?" % pattern_of(line) if FIRST_FEEDBACK.fullmatch(line) and line is not lines[-1]
                          else pattern_of(line) for line in lines)
        if returns and not self.may_go_on:
            pattern += r"(?=\s*%s)" % PROMPT

        def came():  # readline shows the new lines of a command as ^J
            return self.text.replace("^J", "\n") + "\n" if completes else self.text

        self.wait(lambda: PROMPT in self.text or re.match(pattern, came()))
        match = re.match(pattern, came())
        if not match:
            self.differs(step, step.shown, came())
        self.text = came()[match.end():]

    def enter(self, step):
        """Press Enter, and forget the command that was typed."""
        self.shell.send("\n")
        assert self.wait(lambda: "\n" in self.text), "%s: no echo of what was typed" % step.line
        self.text = self.text.partition("\n")[2]

    def finish(self, step, mark=PROMPT):
        """Wait for the mark (str), by default the end of the command before the step; no more may have come than the
        page shows."""
        if not self.wait(lambda: mark in self.text):
            self.differs(step, [mark.strip()], self.text)
        rest, _, self.text = self.text.partition(mark)
        if rest.strip() and not self.may_go_on:
            self.differs(step, [], rest)
        self.may_go_on = False

    def differs(self, step, shown, came):
        """AssertionError with the lines shown and those that came."""
        patterns = [(re.compile(pattern_of(line)), line) for line in shown if line != "…"]
        came = [next((line for pattern, line in patterns if pattern.fullmatch(got + "\n")), got)
                for got in came.split(PROMPT)[0].rstrip().splitlines()]
        difference = [line for line in difflib.ndiff(shown, came) if line[0] != "?" and line != "- …"]
        raise AssertionError("%s, in terminal %s (- is on the page, + came within %d s):\n  %s" % (
            step.line, step.terminal, LIMIT, "\n  ".join(difference)))

    def close(self):
        """Stop what runs here."""
        for keys in ("\x03", "exit\n", "exit\n"):
            if not self.shell.closed:
                self.text = ""
                self.shell.send(keys)
                self.wait(lambda: self.shell.closed or PROMPT in self.text, 20)
        self.shell.close()


def walk(steps, home, environment, folder=None):
    """Do the steps of a reader, in new terminals that begin in a folder, by default home (pathlib.Path)."""
    terminals = {}
    with contextlib.ExitStack() as stack:
        for number, step in enumerate(steps, 1):
            if isinstance(step, tuple):
                how, file, text = step
                edit(how, home / file, text)
                continue
            if step.terminal not in terminals:
                terminals[step.terminal] = Terminal(terminals, environment, folder or home)
                stack.callback(terminals[step.terminal].close)
            later = (other.typed for other in steps[number:] if getattr(other, "terminal", None) == step.terminal)
            terminals[step.terminal].walk(step, next(later, "").startswith("$ "))
