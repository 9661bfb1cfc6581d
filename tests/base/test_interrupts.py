"""Ctrl-C is not lost in a library that catches it."""

import signal
import subprocess
import sys
from contextlib import suppress
from threading import Thread

import pytest

from rrtik_ompl.base.interrupts import interruptible
from rrtik_ompl.description.shapes.by_trimesh import meshes_in


def swallowed(*_, **__):
    with suppress(BaseException):
        signal.raise_signal(signal.SIGINT)


def test_ctrl_c_leaves_a_block_that_catches_it_and_the_handler_is_the_usual_one_again():
    usual = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), interruptible():
        swallowed()
    assert signal.getsignal(signal.SIGINT) is usual


def test_errors_pass_and_other_threads_are_left_alone():
    with pytest.raises(ValueError, match="wrong"), interruptible():
        raise ValueError("wrong")
    seen = []

    def enter():
        with interruptible():
            seen.append(1)

    thread = Thread(target=enter)
    thread.start()
    thread.join()
    assert seen == [1]


ENDED = """
import signal, sys
from rrtik_ompl.base.interrupts import tidied_before_the_end
signal.signal(getattr(signal, sys.argv[1]), signal.SIG_DFL)  # nohup, too, hands on that it is ignored
with tidied_before_the_end():
    try:
        signal.raise_signal(getattr(signal, sys.argv[1]))
        print("goes on")
    finally:
        print("tidied", flush=True)
print("not reached")
"""


@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
def test_who_is_ended_by_a_signal_has_tidied_up_and_is_ended_by_it(name):
    found = subprocess.run([sys.executable, "-c", ENDED, name], capture_output=True, text=True, check=False)
    assert (found.stdout, found.returncode) == ("tidied\n", -getattr(signal, name))


def test_ctrl_c_while_a_mesh_is_read_is_not_lost(monkeypatch, tmp_path):
    monkeypatch.setattr("trimesh.load_scene", swallowed)
    with pytest.raises(KeyboardInterrupt):
        meshes_in(tmp_path / "part.dae")
