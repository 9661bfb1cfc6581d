"""Work in parts, spread over processes; what is done is kept in a file, so an interrupted run goes on where it was."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

Part = Sequence[str | int]  # what the work is given: plain words and numbers


def in_parts(work: Callable[..., Any], parts: Sequence[Part], *, jobs: int, kept: Path) -> list[Any]:
    """What a piece of work returns for every part, in order.

    Args:
        work: A function of a module, called with the members of a part; returns what JSON can hold.
        parts: All different.
        jobs: Processes.
        kept: A file for what is done, one line each; it is removed at the end. Parts that it has are not done again.
    """
    known = dict(_read(kept))
    left = [part for part in parts if _key(part) not in known]
    if len(left) < len(parts):
        print(f"{kept} has {len(parts) - len(left)} of {len(parts)} parts; delete it to begin anew", file=sys.stderr)
    kept.parent.mkdir(parents=True, exist_ok=True)
    begin = perf_counter()
    with kept.open("w", encoding="utf-8") as file:
        file.writelines(_line(key, result) for key, result in known.items())
        file.flush()
        for count, (part, result) in enumerate(_spread(work, left, jobs), start=1):
            known[_key(part)] = result
            file.write(_line(_key(part), result))
            file.flush()
            seconds = perf_counter() - begin
            text = f"{len(known)} of {len(parts)}, {seconds:.0f} s, {seconds / count * (len(left) - count):.0f} s to go"
            print(text, file=sys.stderr, flush=True)
    kept.unlink()
    return [known[_key(part)] for part in parts]


def _key(part: Part) -> str:
    return " ".join(str(member) for member in part)


def _line(key: str, result: Any) -> str:
    return json.dumps([key, result]) + "\n"


def _read(kept: Path) -> Iterator[tuple[str, Any]]:
    """What a file has; a last line that was cut off is left out."""
    lines = kept.read_text(encoding="utf-8").splitlines(keepends=True) if kept.exists() else []
    for line in lines:
        if line.endswith("\n"):
            key, result = json.loads(line)
            yield key, result


def _spread(work: Callable[..., Any], parts: Sequence[Part], jobs: int) -> Iterator[tuple[Part, Any]]:
    """Parts and results as they come."""
    if jobs == 1:
        yield from ((part, work(*part)) for part in parts)
        return
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        asked = {pool.submit(work, *part): part for part in parts}
        yield from ((asked[done], done.result()) for done in as_completed(asked))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
