"""What the tests of campaigns share: a suite, and how its runs are read."""

from rrtik_ompl.benchmark.records import NAME, key_of, read_records

SUITE = """\
version: 1
title: Two scenes
problems: [planar3_a, {joints: {counts: [4]}}]
planners: [bicrdt, RRTConnect, {name: RRTConnect, label: short steps, parameters: {range: 0.3}}]
runs: 3
seconds: 5.0
seed: 7
shorten: sequential
"""
TOTAL = 18


def found(folder):
    """Records by run, with the paths that were found, without what depends on the clock."""
    keep = ("status", "seed", "waypoints", "counts")
    return {key_of(r): {name: r.get(name) for name in keep} for r in read_records(folder / NAME)}
