"""Waiting for other threads and processes."""

import time


def until(good, seconds=100.0):
    """Wait until ``good()`` is true; fail after ``seconds`` [s], of which a busy machine may need many."""
    end = time.monotonic() + seconds
    while not good():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)
