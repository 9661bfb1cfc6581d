"""What bad peers send: messages of a protocol, mutated, cut, repeated, far too long, in pieces."""

from __future__ import annotations

import os
import socket
import struct
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np
from numpy.typing import ArrayLike

from bench.robustness.spoilt_files import spoilt
from rrtik_ompl.pilot.devices.arm import SimulatedArm

HUGE_BYTES = 300_000
SLOW_SHARE, SLOW_SECONDS = 0.01, 0.7  # of messages that pause in their middle; longer than a line's patience
PATIENCE_SECONDS = 30.0  # of a check, on a busy machine
BACKSLASH = "backslashreplace"


class Witness(SimulatedArm):
    """A simulated arm that knows whether it was stopped since it was last sent anywhere.

    Attributes:
        stands: Whether it was.
        sent: How often it was sent anywhere.
    """

    stands, sent = True, 0

    def move(self, joint: int, target: float) -> None:
        """Send one joint to a value [rad or m]."""
        super().move(joint, target)
        self.stands, self.sent = False, self.sent + 1

    def follow(self, q: ArrayLike) -> None:
        """Send all joints to a set point."""
        super().follow(q)
        self.stands, self.sent = False, self.sent + 1

    def stop(self) -> None:
        """Stop at once."""
        super().stop()
        self.stands = True

    def fault(self) -> str:
        """Why the arm cannot be where it is; "" if it can."""
        q = self.read()
        return "" if np.isfinite(q).all() and self.robot.within_limits(q, 1e-9)[0] else f"the arm is at {q.tolist()}"


def mutated(rng: np.random.Generator, good: Sequence[str], end: str = "\n") -> bytes:
    """A message: a good one, one that is spoilt, several at once, noise, or far too much."""
    text = good[int(rng.integers(len(good)))]
    kind = rng.random()
    if kind < 0.15:
        return (text + end).encode()
    if kind < 0.7:
        return (spoilt(rng, text) + (end if rng.random() < 0.9 else "")).encode("utf-8", errors=BACKSLASH)
    if kind < 0.8:
        several = rng.integers(len(good), size=int(rng.integers(2, 40))).tolist()
        return "".join(good[k] + end for k in several).encode()
    if kind < 0.98:
        return bytes(rng.bytes(int(rng.integers(0, 200)))) + end.encode()
    return (text[: len(text) // 2] + "9" * HUGE_BYTES + end).encode()


def send_in_pieces(rng: np.random.Generator, line: socket.socket, data: bytes) -> None:
    """Send in one piece or in two, sometimes with a pause between them; that the other side has gone is no fault."""
    at = int(rng.integers(0, len(data) + 1))
    with suppress(OSError):
        line.sendall(data[:at])
        if rng.random() < SLOW_SHARE:
            time.sleep(SLOW_SECONDS)
        line.sendall(data[at:])


def drain(line: socket.socket) -> bytes:
    """What has come, at most 64 kB; nothing where the other side has gone."""
    line.setblocking(False)
    try:
        return line.recv(65536)
    except OSError:
        return b""
    finally:
        with suppress(OSError):
            line.settimeout(5.0)


def leave(rng: np.random.Generator, line: socket.socket) -> None:
    """Close in good order, or with a reset."""
    with suppress(OSError):
        if rng.random() < 0.3:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    line.close()


def comes_true(good: Callable[[], bool]) -> bool:
    """Whether something comes true in time."""
    end = time.monotonic() + PATIENCE_SECONDS
    while not good():
        if time.monotonic() > end:
            return False
        time.sleep(0.002)
    return True


@contextmanager
def silence(faults: list[str]) -> Iterator[None]:
    """A fault if anything is written to standard error meanwhile: tracebacks of threads, warnings of libraries."""
    with tempfile.TemporaryFile() as caught:
        usual = os.dup(2)
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(usual, 2)
            os.close(usual)
            caught.seek(0)
            text = caught.read().decode("utf-8", errors=BACKSLASH).strip()
            if text:
                faults.append(f"written to standard error: {' '.join(text.split())[-300:]}")
