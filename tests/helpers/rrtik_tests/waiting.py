"""Waiting for other threads and processes."""

import time


def cut_off(line):
    """Whether the other side has ended a connection to which one byte more is sent, and which has a timeout."""
    try:
        line.sendall(b"G")
        return line.recv(1) == b""
    except TimeoutError:
        return False
    except OSError:
        return True


def until(good, seconds=100.0):
    """Wait until ``good()`` is true; fail after ``seconds`` [s], of which a busy machine may need many."""
    end = time.monotonic() + seconds
    while not good():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)
