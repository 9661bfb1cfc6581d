"""What the library says of a run: what its record calls proven, and what touches when it is judged anew."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rrtik_ompl.base.errors import InputError
from rrtik_ompl.model.judgement import Contact, Judged, PathContact, Verdict
from rrtik_ompl.replanning.judge import RunViolation
from rrtik_ompl.world.problem import Problem

if TYPE_CHECKING:
    from rrtik_ompl.replanning.record import ReplanRun

NOWHERE = np.full(3, np.nan)


def judged_run(run: ReplanRun, problem: Problem | None) -> Judged:
    """The verdict on a run, by its ticks; see :meth:`rrtik_ompl.ReplanRun.judged`."""
    made, proven = run.moves
    unproven = {k for k, tick in enumerate(run.ticks) if tick.proven is False}
    text = f"{proven} of {made} moves proven free when they were made" if made else "no move of it is called proven"
    found: tuple[RunViolation, ...] = ()
    if problem is not None:
        try:
            found = run.violations(problem)
            text += "; judged anew: " + (f"{len(found)} faults, the first: {found[0]}" if found else "no fault")
        except InputError as error:
            text += f"; not judged anew: {error}"
    unproven |= {each.tick for each in found}
    ticks = len(run.ticks)
    drawn = tuple(sorted({min(k, ticks - 2) for k in unproven} if ticks > 1 else ()))
    contacts = tuple(_contact(each) for each in found)
    return Judged(Verdict(made > 0 and proven == made and not found, text, drawn), None, contacts)


def _contact(fault: RunViolation) -> PathContact:
    """A fault as what is drawn red in its tick."""
    contact = Contact(fault.first, fault.second, fault.distance, NOWHERE, NOWHERE, fault.kept)
    names = frozenset((fault.first, fault.second))
    return PathContact(float(fault.tick), float(fault.tick + 1), contact, names)
