"""Types each page (typist.py says how). Each page has a home and a master of its own. The lessons share one: they are
typed each in new terminals, from the block below `<!-- after a break -->`, and once more straight on, without these
blocks. doc/ros2.md is tried by ros2_test.py."""
import os
import re
import shutil

import pytest

from pages import LESSONS, PAGES
from support.processes import PACKAGE, bound_socket
from typist import PROMPT, steps_of, walk

# The page's roscore uses the usual port, which somebody may be using.
BASHRC = """PS1="%s" port=%d
bind 'set enable-bracketed-paste off'
for setup in /opt/ros/{noetic,one}/setup.bash; do [[ ! -f $setup ]] || source $setup; done
export ROS_MASTER_URI=http://localhost:$port ROS_HOSTNAME=localhost
roscore() { command roscore -p $port "$@"; }
"""


@pytest.fixture
def home(tmp_path):
    """A home of its own, with this repository as dishes. -> its folder (pathlib.Path), the environment of a terminal,
    which has no ROS"""
    (tmp_path / "dishes").symlink_to(PACKAGE)
    environment = {name: value for name, value in os.environ.items()
                   if not re.match("ROS|CMAKE_PREFIX_PATH|LD_LIBRARY_PATH|PKG_CONFIG_PATH|PYTHON", name)}
    # The page's files go to ~, which is not the user's here; the workspace of ./tutorial is where it always is.
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    # ROS_HOME: rospack does not go by HOME, but by what the system knows of the user.
    environment.update(HOME=str(tmp_path), ROS_HOME="%s/.ros" % tmp_path, XDG_CACHE_HOME=cache, TERM="dumb",
                       LC_ALL="C.UTF-8", PYTHONDONTWRITEBYTECODE="1")
    with bound_socket() as bound:
        (tmp_path / ".bashrc").write_text(BASHRC % (PROMPT, bound.getsockname()[1]))
        yield tmp_path, environment
    shutil.rmtree(str(tmp_path))


@pytest.mark.parametrize("page", [page for page in PAGES if page not in LESSONS + ["doc/ros2.md"]])
def test_typed_page(page, home):
    walk(steps_of(page), *home, folder=PACKAGE)


def test_typed_lessons_with_a_break_after_each(home):
    for lesson in LESSONS:
        walk(steps_of(lesson), *home)


def test_typed_lessons_straight_on(home):
    walk([step for lesson in LESSONS for step in steps_of(lesson, ["<!-- after a break -->"])], *home)
