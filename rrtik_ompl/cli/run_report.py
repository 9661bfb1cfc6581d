"""What `rrtik check` says of the record of a run."""

from __future__ import annotations

from pathlib import Path
from typing import TypeGuard

from rrtik_ompl.base.errors import InputError, in_file
from rrtik_ompl.cli.terminal import progress
from rrtik_ompl.replanning.record import KIND, load_run
from rrtik_ompl.world.problem import Problem

HEAD = 4096  # bytes in which a record says what it is
MOST_LINES = 20


def is_record(file: Path | None) -> TypeGuard[Path]:
    """Whether a file is the record of a run."""
    if file is None or file.suffix.lower() != ".json" or not file.is_file():
        return False
    with file.open("rb") as opened:
        return f'"{KIND}"'.encode() in opened.read(HEAD)


def judged(problem: Problem, file: Path) -> tuple[list[str], bool]:
    """What a judge says of a record, in lines, and whether nothing touches in it.

    Raises:
        InputError: If it is none, or one of another problem.
    """
    run = load_run(file)
    with progress(f"{file}: judging {len(run.ticks)} ticks"):
        try:
            found = run.violations(problem)
        except InputError as error:
            raise in_file(file, error) from None

    moves, proven = run.moves
    if not found:
        return [f"{len(run.ticks)} ticks, nothing touches; {proven} of {moves} moves proven"], True

    lines = [str(violation) for violation in found[:MOST_LINES]]
    lines += [f"and {len(found) - MOST_LINES} more"] if len(found) > MOST_LINES else []

    touching = len({each.tick for each in found if each.touches})
    lines.append(f"{touching} of {len(run.ticks)} ticks touch something; {proven} of {moves} moves are called proven")
    return lines, False
