"""Certificates on the command line: `rrtik plan --certificate` writes one, `rrtik check --proof` verifies one."""

from __future__ import annotations

from pathlib import Path

from rrtik_ompl.certificates.certificate import load_certificate
from rrtik_ompl.certificates.verify import verify
from rrtik_ompl.certificates.write import certificate_of
from rrtik_ompl.path import JointPath
from rrtik_ompl.problem import Problem


def write_certificate(problem: Problem, path: JointPath, file: Path) -> str:
    """Write a path's certificate; returns why there is none, "" if it is written.

    It is for the clearance that the path is known to keep.

    Raises:
        InputError: If the file cannot be written.
    """
    world = problem.world
    kept = path.proof.clearance if path.proof is not None and path.proven else 0.0
    found = certificate_of(world, path, kept)
    if found is None:
        gaps = world.prove(path.waypoints, clearance=kept).unproven
        return f"{file}: no certificate: the path is not proven free" + (f": {gaps[0]}" if gaps else "")
    found.save(file)
    return ""


def certified(problem: Problem, path: JointPath, proof: Path) -> tuple[str, bool]:
    """A line on whether a certificate proves that a path solves a problem, and whether it does.

    Raises:
        InputError: If the file is missing or is no certificate.
    """
    found = load_certificate(proof)
    fault = verify(found, problem.world, path.waypoints)
    if not fault and abs(path.start - problem.start).max() > 1e-6:
        fault = "the path does not begin at the start of the problem"
    if not fault and not problem.reached(path.end):
        fault = "the path does not end at the goal of the problem"
    if fault:
        return f"{proof}: does not hold: {fault}", False
    kept = f", {1e3 * found.clearance:g} mm kept from obstacles" if found.clearance else ""
    moves = len(found.motions)
    return f"{proof}: holds: {moves} motion{'s' * (moves != 1)} proven free{kept}, {found.entries} entries", True
