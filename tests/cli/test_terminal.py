"""What a terminal shows: tables, a spinner where something takes long; and the end of a command."""

import fcntl
import os
import pty
import struct
import subprocess
import sys
import termios
import time
from io import StringIO

import pytest

from rrtik_ompl.cli.table import LEAST_WIDTH, Table, columns_of, folded, short_names
from rrtik_ompl.cli.terminal import progress, say


@pytest.mark.parametrize(("word", "code"), [("list", 0), ("nothing", 2)])
def test_what_was_to_be_done_at_the_end_is_done(word, code):
    lines = "import atexit, threading; atexit.register(print, 'taken down')\n"
    later = "threading.Thread(target=lambda: threading.main_thread().join() or print('written')).start()\n"
    end = "from rrtik_ompl.cli.entry import main; main()"
    for text, said in ((lines, "taken down\n"), (lines + later, "written\ntaken down\n")):
        child = [sys.executable, "-c", text + end, word]
        done = subprocess.run(child, stdout=subprocess.PIPE, text=True, check=False)
        assert done.returncode == code
        assert done.stdout.endswith(said)


def test_a_spinner_shows_what_takes_long_alone(monkeypatch):
    class Terminal(StringIO):
        def isatty(self):
            return True

    for seconds, shown in ((0.0, False), (0.8, True)):
        terminal = Terminal()
        monkeypatch.setattr(sys, "stderr", terminal)
        with progress("looking"):
            time.sleep(seconds)
        assert ("looking" in terminal.getvalue()) is shown


def test_cells_of_a_table_stand_below_each_other(capsys):
    table = Table("no.", "joint", right=(0,))
    table.add_row("1", "\u80a9")
    table.add_row("10", "elbow")
    say(table)
    assert capsys.readouterr().out.splitlines()[1::2] == [" no.   joint", "   1   \u80a9", ""]


def moves(names, count):
    """A table with a row per name and ``count`` columns of figures."""
    table = Table("joint [deg]", *map(str, range(count)), right=range(1, count + 1))
    for name in names:
        table.add_row(name, *("-123.45" for _ in range(count)))
    return table


@pytest.mark.parametrize("width", [40, 60, 80, 167])
def test_a_table_fits_and_shows_every_figure_whole(width):
    text = moves(["shoulder_pitch", "wrist"], 12).fitted(width)
    assert max(map(len, text.splitlines())) <= width
    assert text.count("-123.45") == 24
    blocks = text.count("joint [deg]")
    assert (blocks > 1) == (width < 120)
    assert text.count("shoulder_pitch") == blocks


def test_headings_are_broken_before_text_and_text_before_the_table_is_folded():
    table = Table("no.", "what it is", "largest velocity", right=(0, 2))
    table.add_row("1", "a longer text", "1.25")
    assert len(table.fitted(80).splitlines()) == 4
    assert [line.split() for line in table.fitted(30).splitlines()[1:3]] == [
        ["largest"],
        ["no.", "what", "it", "is", "velocity"],
    ]
    assert table.fitted(24).splitlines()[-2:] == ["   1  a longer      1.25", "      text"]
    assert table.fitted(15).count("no.") == 2


def test_each_block_of_a_folded_table_says_what_its_rows_are():
    table = Table("problem", "planner", "seconds", "iterations", right=(2, 3), keys=2)
    table.add_row("panda_shelf", "bicrdt", "1.2345", "12345")
    blocks = table.fitted(36).split("\n\n")
    assert len(blocks) == 2
    assert all("panda_shelf  bicrdt" in block for block in blocks)


@pytest.mark.parametrize(
    ("names", "title", "short"),
    [
        (["panda_joint1", "panda_joint2"], "panda_*", ["joint1", "joint2"]),
        (["j2s6s200_joint_1", "j2s6s200_joint_2"], "j2s6s200_*", ["joint_1", "joint_2"]),
        (["shoulder_pan_joint", "elbow_joint"], "*_joint", ["shoulder_pan", "elbow"]),
        (["joint1", "joint2"], "joint", ["joint1", "joint2"]),
        (["arm_", "arm_b"], "joint", ["arm_", "arm_b"]),
        (["x"], "joint", ["x"]),
        (["same", "same"], "joint", ["same", "same"]),
    ],
)
def test_joints_lose_what_all_of_them_share_up_to_a_mark(names, title, short):
    assert short_names(names) == (title, short)


def test_texts_fold_at_words_where_a_person_reads_them_and_names_of_files_stay_whole():
    long = "rrtik: /a/folder/with/a/long/name.yaml: is no problem\n  indented words here"
    assert folded(long, None) == long
    assert folded(long, 20).splitlines() == [
        "rrtik:",
        "  /a/folder/with/a/long/name.yaml:",
        "  is no problem",
        "  indented words",
        "    here",
    ]


def test_the_width_is_that_of_the_variable_or_of_the_terminal(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)
    assert columns_of(StringIO()) is None
    for told, columns in (("60", 60), ("4", LEAST_WIDTH), ("0", None), ("wide", None)):
        monkeypatch.setenv("COLUMNS", told)
        assert columns_of(StringIO()) == columns
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 97, 0, 0))
    with open(theirs, "w") as terminal:
        assert columns_of(terminal) == 97
    os.close(ours)
