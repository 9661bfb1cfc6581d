"""Make random paths that are proven free, verify the certificate of each, and tamper with all of them.

Exit code 0 if each certificate is accepted and each falsified one refused, else 1. Certificates are written to text and
read again on their way.
"""

from __future__ import annotations

import json
import time
from collections import Counter

import numpy as np

from bench.proofs.cases import Case, random_cases
from bench.proofs.tampering import TAMPERINGS
from rrtik_ompl import load_robot
from rrtik_ompl.model.certificate import from_document
from rrtik_ompl.world.certificate_check import certificate_fault

ROBOTS = ("planar3", "titan4", "panda", "ur5_gripper", "puma560", "point2d")


def measured(paths: int, seed: int) -> Counter[str]:
    """What was accepted, refused and tampered with, by name, and what should not have been."""
    streams = [random_cases(load_robot(name), seed + k) for k, name in enumerate(ROBOTS)]
    rng, counts = np.random.default_rng(seed), Counter[str]()
    for number in range(paths):
        case = next(streams[number % len(streams)])
        text = json.dumps(case.certificate.document())
        begin = time.perf_counter()
        fault = certificate_fault(from_document(json.loads(text)), case.world, case.path.waypoints, clearance=0.001)
        counts["microseconds of verifying"] += round(1e6 * (time.perf_counter() - begin))
        counts["bytes"] += len(text)
        counts["accepted" if not fault else "WRONG: refused"] += 1
        counts += tampered(case, rng)
    return counts


def verified(paths: int, seed: int) -> dict[str, int]:
    """The counts of :func:`measured`, of which a page is made."""
    return dict(measured(paths, 1000 * seed))


def tampered(case: Case, rng: np.random.Generator) -> Counter[str]:
    """What comes of tampering with a certificate in each way, by name."""
    counts = Counter[str]()
    for name, tamper in TAMPERINGS.items():
        falsified = tamper(case, rng)
        if falsified is None:
            counts[f"{name}: nothing to tamper with"] += 1
        elif certificate_fault(*falsified):
            counts[f"{name}: refused"] += 1
        else:
            counts[f"WRONG: {name}: accepted"] += 1
    return counts


def main(paths: int = 1000, seed: int = 0) -> int:
    """Print the counts; exit code 1 if one of them should be 0."""
    counts = measured(paths, seed)
    mean = {name: counts.pop(name) / max(1, paths) for name in ("microseconds of verifying", "bytes")}
    for name, count in sorted(counts.items()):
        print(f"{count:8d}  {name}")
    print(f"{1e-3 * mean['microseconds of verifying']:8.1f}  ms to read and verify one, on average")
    print(f"{1e-3 * mean['bytes']:8.1f}  kB of each, on average")
    return 1 if any(name.startswith("WRONG") for name in counts) else 0
