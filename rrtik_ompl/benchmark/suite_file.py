"""What a suite file may say: the models that check it and tell a person what is wrong with it."""

from __future__ import annotations

from typing import Annotated, Any, Final, get_args

from pydantic import Field, Tag

from rrtik_ompl.base.choices import SuiteShortening
from rrtik_ompl.files.sections import Name, Positive, Section, Version, tag, told_apart_by

BY_KIND: Final = "by-kind"  # of shortening, beside the methods
NONE: Final = "none"
SHORTENINGS: tuple[SuiteShortening, ...] = get_args(SuiteShortening)
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]


class GeneratedEntry(Section):
    """Problems of ``rrtik_ompl.planning.generated_problems``."""

    robot: Name
    family: Name
    count: Count = Field(1, description="problems")
    first: Seed = Field(0, description="seed of the first one")


class ObstaclesEntry(Section):
    """One arm between more and more obstacles."""

    robot: Name
    counts: Annotated[list[Count], Field(min_length=1)]
    seed: Seed = 0


class JointsEntry(Section):
    """Planar chains of more and more joints."""

    counts: Annotated[list[Annotated[Count, Field(ge=2, le=100)]], Field(min_length=1)]
    seed: Seed = 0


class ResolutionEntry(Section):
    """One problem whose motions are checked in finer and finer steps."""

    problem: Name
    metres: Annotated[list[Positive], Field(min_length=1)]


class Generated(Section):
    """See :class:`GeneratedEntry`."""

    generated: GeneratedEntry


class Obstacles(Section):
    """See :class:`ObstaclesEntry`."""

    obstacles: ObstaclesEntry


class Joints(Section):
    """See :class:`JointsEntry`."""

    joints: JointsEntry


class Resolution(Section):
    """See :class:`ResolutionEntry`."""

    resolution: ResolutionEntry


ProblemEntry = Annotated[
    Annotated[Name, Tag(tag("name"))]
    | Annotated[Generated, Tag(tag("generated"))]
    | Annotated[Obstacles, Tag(tag("obstacles"))]
    | Annotated[Joints, Tag(tag("joints"))]
    | Annotated[Resolution, Tag(tag("resolution"))],
    told_apart_by(
        "generated", "obstacles", "joints", "resolution", what="a problem", text="name",
    ),
]  # fmt: skip


class PlannerGroup(Section):
    """A planner with options."""

    name: Name
    label: Name | None = None
    parameters: dict[str, Any] = Field(default={})
    shorten: Name | None = Field(None, description="in place of the suite's")


PlannerEntry = Annotated[
    Annotated[Name, Tag(tag("text"))] | Annotated[PlannerGroup, Tag(tag("name"))],
    told_apart_by("name", what="a planner", text="text"),
]


class SuiteFile(Section):
    """A campaign of benchmarks."""

    version: Version
    title: Name = "benchmark"
    robot: Name | None = Field(None, description="for problem files and folders, in place of the one they name")
    problems: list[ProblemEntry] = Field(default=[], description="may be left out if a folder is given")
    planners: Annotated[list[PlannerEntry], Field(min_length=1)]
    runs: Count = Field(description="of every planner on every problem")
    seconds: Positive = Field(description="for planning in each run [s]")
    patience: Positive | None = Field(None, description="a run that takes longer in all is killed [s]; 3 seconds + 30")
    memory_mb: Positive = Field(4096.0, description="that a run may take beside robot, scene and library [MB]")
    seed: Seed = 0
    shorten: Name = Field(BY_KIND, description="a method of shortening, none, or by-kind: axis for single-joint moves")
