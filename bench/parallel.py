"""Pieces of a measurement in several processes, each kept on disk when it is done, so that a broken run goes on."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from ompl import util as ou


@dataclass(frozen=True)
class Measuring:
    """Calls a function for each of some pieces of work.

    Attributes:
        jobs: Processes.
        kept: Results are kept in this file, and those that are there already are not measured again; None keeps none.
    """

    jobs: int
    kept: Path | None

    def __call__(self, work: Callable[..., Any], pieces: Sequence[tuple]) -> list[Any]:
        """``work(*piece)`` for each piece, in order; ``work`` is a function of a module, its results can be pickled."""
        done: dict[str, Any] = {}
        if self.kept is not None and self.kept.exists():
            done = pickle.loads(self.kept.read_bytes())
        names = {piece: f"{work.__module__}.{work.__qualname__}{piece!r}" for piece in pieces}
        left = [piece for piece in pieces if names[piece] not in done]
        with ProcessPoolExecutor(self.jobs, mp_context=get_context("spawn"), initializer=_quiet) as pool:
            running = {pool.submit(work, *piece): names[piece] for piece in left}
            try:
                for number, future in enumerate(as_completed(running), start=1):
                    done[running[future]] = future.result()
                    if number % 10 == 0 or number == len(left):
                        _keep(done, self.kept)
                        print(f"{work.__name__}: {number} of {len(left)}", file=sys.stderr, flush=True)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                _keep(done, self.kept)
                raise
        return [done[names[piece]] for piece in pieces]


def _keep(done: dict[str, Any], kept: Path | None) -> None:
    if kept is not None:
        new = kept.with_name(kept.name + ".new")
        new.write_bytes(pickle.dumps(done))
        new.replace(kept)


def _quiet() -> None:
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
