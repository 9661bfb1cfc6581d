"""What a terminal shows: tables, a spinner where something takes long; and the end of a command."""

import subprocess
import sys
import time
from io import StringIO

import pytest

from rrtik_ompl.cli.terminal import Table, progress, say


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
    assert capsys.readouterr().out.splitlines()[1::2] == [" no.   joint ", "   1   \u80a9    ", ""]
