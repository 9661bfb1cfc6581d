"""Waiting for other threads and processes."""

import time


def until(good, seconds=10.0):
    """Wait until ``good()`` is true; fail after ``seconds`` [s]."""
    end = time.monotonic() + seconds
    while not good():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)
