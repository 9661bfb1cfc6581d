"""Measurements in parts, spread over processes; what is done is kept beside the page until that is written."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any, TextIO, get_type_hints

from pydantic import TypeAdapter, ValidationError

from rrtik_ompl.files.text import write_text

Part = Sequence[Any]  # what the work is given: plain words and numbers, files, None


class Parts:
    """Calls functions for many parts of a measurement; an interrupted measurement goes on where it was.

    Used with ``with``: at the end of that the file is removed, unless an error came after something was done.

    Args:
        out: The page. What is done stands in `.parts.jsonl` beside it, one line each, and is not done again.
        jobs: Processes.
    """

    def __init__(self, out: Path, jobs: int) -> None:
        self._kept, self._jobs = out.with_suffix(".parts.jsonl"), jobs
        self._known: dict[str, Any] = {}
        self._file: TextIO

    def __enter__(self) -> Parts:
        self._known = dict(_read(self._kept))
        if self._known:
            print(f"{self._kept} has {len(self._known)} parts; delete it to begin anew", file=sys.stderr)
        self._kept.parent.mkdir(parents=True, exist_ok=True)
        write_text(self._kept, "".join(_line(key, result) for key, result in self._known.items()))
        self._file = self._kept.open("a", encoding="utf-8")
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._file.close()
        if kind is None or not self._known:
            self._kept.unlink()

    def __call__(self, work: Callable[..., Any], parts: Sequence[Part]) -> list[Any]:
        """``work(*part)`` for every part, in order.

        Args:
            work: A function of a module; the type that it says to return must be one that pydantic can write as JSON.
            parts: All different.
        """
        kind: TypeAdapter[Any] = TypeAdapter(get_type_hints(work)["return"])
        keys = [_key(work, part) for part in parts]
        self._forget_unreadable(kind, keys)
        left = [(key, part) for key, part in zip(keys, parts, strict=True) if key not in self._known]
        begin = perf_counter()
        for count, (key, result) in enumerate(_spread(work, left, self._jobs), start=1):
            self._known[key] = kind.dump_python(result, mode="json")
            self._file.write(_line(key, self._known[key]))
            self._file.flush()
            seconds = perf_counter() - begin
            text = f"{work.__name__}: {len(parts) - len(left) + count} of {len(parts)}, {seconds:.0f} s"
            to_go = seconds / count * (len(left) - count)
            print(f"{text}, {to_go:.0f} s to go", file=sys.stderr, flush=True)
        return [kind.validate_python(self._known[key]) for key in keys]

    def _forget_unreadable(self, kind: TypeAdapter[Any], keys: Sequence[str]) -> None:
        for key in self._known.keys() & set(keys):
            try:
                kind.validate_python(self._known[key])
            except ValidationError:
                del self._known[key]
                print(f"{key}: kept by another version, measured again", file=sys.stderr)


def _key(work: Callable[..., Any], part: Part) -> str:
    return " ".join(str(member) for member in (work.__name__, *part))


def _line(key: str, result: Any) -> str:
    return json.dumps([key, result]) + "\n"


def _read(kept: Path) -> Iterator[tuple[str, Any]]:
    """What a file has; a last line that was cut off is left out."""
    lines = kept.read_text(encoding="utf-8").splitlines(keepends=True) if kept.exists() else []
    for line in lines:
        if line.endswith("\n"):
            key, result = json.loads(line)
            yield key, result


def _spread(work: Callable[..., Any], parts: Sequence[tuple[str, Part]], jobs: int) -> Iterator[tuple[str, Any]]:
    """Keys and results as they come."""
    if jobs == 1:
        yield from ((key, work(*part)) for key, part in parts)
        return
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        asked = {pool.submit(work, *part): key for key, part in parts}
        yield from ((asked[done], done.result()) for done in as_completed(asked))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
