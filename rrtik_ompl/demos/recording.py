"""Record demonstrations of a task: draw, plan and time it until there are as many as wanted."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from rrtik_ompl.base.arrays import not_negative, positive, seed_of, whole_number
from rrtik_ompl.base.choices import one_of
from rrtik_ompl.base.errors import InputError, require
from rrtik_ompl.base.version import __version__
from rrtik_ompl.demos.episode import Episode, Timing, attempted, observed
from rrtik_ompl.demos.folder import DemoFolder, Pictures
from rrtik_ompl.demos.formats import check_format, write_dataset
from rrtik_ompl.files.digest import sha256
from rrtik_ompl.files.kinds import FilePath
from rrtik_ompl.files.text import file_name
from rrtik_ompl.many import spread
from rrtik_ompl.many.guard import PARCEL, out_of_memory
from rrtik_ompl.many.parcels import packed, unpacked
from rrtik_ompl.motion.trajectory import RateLimits
from rrtik_ompl.tasks import Task
from rrtik_ompl.tasks.randomness import Draws
from rrtik_ompl.tasks.task_file import task_data

DemoFormat: TypeAlias = Literal["npz", "hdf5", "lerobot"]
FIRST = 100  # attempts after which it is given up if none has succeeded
PER_DEMO = 10  # attempts for each demonstration that is wanted, at most
MEMORY_MB = 4096.0  # limit of an attempt in a process
PATIENCE = (3.0, 30.0)  # an attempt in a process is killed after so many times its time limit, and so many seconds more
DONE = "done"
NUMBERS = re.compile(r"-?\d+(\.\d+)?(e-?\d+)?")


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a recording is: demonstrations that are there, those that are wanted, and attempts."""

    done: int
    count: int
    attempts: int


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """What has come of recording demonstrations.

    Attributes:
        folder: Where they are.
        count: How many there are, of those that were wanted.
        wanted: How many were wanted.
        attempts: How many tasks were drawn and planned for them.
        failures: How often an attempt failed, by the reason; the first of those that differ in numbers alone.
        rejected: How often a draw was not usable and was drawn anew, by the reason.
        dataset: File or folder of the dataset in the format that was asked for.

    Example:
        >>> demos = rrtik.demos.record("panda_pick_place", 2, "demos", seed=1)
        >>> demos.complete, demos.count
        (True, 2)
    """

    folder: Path
    count: int
    wanted: int
    attempts: int
    failures: Mapping[str, int]
    rejected: Mapping[str, int]
    dataset: Path

    @property
    def complete(self) -> bool:
        """Whether there are as many as were wanted."""
        return self.count >= self.wanted

    @property
    def reason(self) -> str:
        """Why there are too few; "" if there are enough."""
        if self.complete:
            return ""
        why, number = Counter(self.failures).most_common(1)[0]
        return f"{self.count} of {self.wanted} demonstrations after {self.attempts} attempts; {number} times: {why}"


def record(
    task: Task | FilePath,
    count: int,
    out: FilePath,
    *,
    seed: int | None = 0,
    rate: float = 30.0,
    share: float = 1.0,
    pause: float = 0.5,
    seconds: float = 10.0,
    format: DemoFormat = "npz",
    jobs: int | None = None,
    scheduler: str | None = None,
    pictures: Pictures | None = None,
    on_attempt: Callable[[Progress], object] = lambda _: None,
) -> Recording:
    """Record demonstrations of a task of which something is random, until there are as many as wanted.

    Each attempt draws an instance of the task, plans it, proves all of its motions and times them at the controller's
    rate. Its random numbers depend on ``seed`` and its number alone: the same data come out however many processes
    there are and however often the recording was interrupted, unless a time limit ends a plan. Attempts that are done
    are kept: the same call goes on where it ended, and one with a larger ``count`` adds to them.

    Args:
        task: A task with something random: of a file, by the name of a shipped one, or made in Python.
        count: Number of demonstrations.
        out: The folder; it holds `attempts.jsonl`, a file of arrays for each demonstration, and the dataset.
        seed: Seed of all attempts; None draws one.
        rate: Ticks per second.
        share: Share of the joints' limits, above 0 to 1.
        pause: Rest where a gripper moves or an object is taken or put down [s].
        seconds: Limit of wall time for planning one task [s].
        format: "npz" for the files of arrays alone, "hdf5" for one file as robomimic has it, "lerobot" for a dataset of
            LeRobot, version 3.0.
        jobs: Number of processes; None for the number of cores, 1 for this process.
        scheduler: Address of a Dask scheduler whose workers plan instead.
        pictures: What draws pictures for the dataset, of format "hdf5" or "lerobot", such as `DemoPictures`.
        on_attempt: Called after each attempt.

    Returns:
        How many there are, how many attempts failed and why. There are fewer than wanted if none of the first 100
        attempts succeeded, or fewer than one in ten of all.

    Raises:
        InputError: If the task or an argument cannot be used, the folder holds other demonstrations, there is no room,
            or a package that the format needs is not installed.
        UnknownNameError: If there is no such task or format.

    Example:
        >>> demos = rrtik.demos.record("panda_pick_place", 2, "demos", seed=1)
        >>> import numpy as np
        >>> arrays = np.load("demos/episodes/000000.npz")
        >>> arrays["position"].shape[1], sorted(arrays)
        (7, ['gripper', 'motion', 'object_pose', 'position', 'time', 'velocity'])
    """
    wanted = whole_number(count, "count", 1)
    first_seed = seed_of(seed)
    timing = Timing(
        positive(rate, "rate"), positive(share, "share"), not_negative(pause, "pause"), positive(seconds, "seconds")
    )
    one_of(get_args(DemoFormat), format, "format")
    processes = os.cpu_count() or 1 if jobs is None else whole_number(jobs, "jobs", 1)
    require(scheduler, str | None, "scheduler", "use its address, such as tcp://host:8786")
    if scheduler is not None and jobs is not None:
        raise InputError("demonstrations: give jobs or scheduler, not both")
    path = file_name(out)
    check_format(format, timing.rate)
    if pictures is not None and format == "npz":
        raise InputError("pictures of demonstrations: format npz has none; use lerobot or hdf5")

    known = task if isinstance(task, Task) else Task.load(task)
    draws = Draws(known)
    RateLimits.of(known.world.robot, share=timing.share)
    about = _about(known, first_seed, timing)
    folder = DemoFolder(path, about, pictures)
    run = _Run(draws, first_seed, timing, folder)

    with folder.opened() as file:
        for numbers in run.rounds(wanted):
            for episode in _episodes(run, numbers, processes, scheduler):
                folder.keep(episode, file)
                on_attempt(Progress(run.successes, wanted, len(folder.records)))
        folder.finish({"count": min(run.successes, wanted)}, run.last)
        dataset = write_dataset(format, folder, known, min(run.successes, wanted))
    return run.recording(wanted, dataset)


def _about(task: Task, seed: int, timing: Timing) -> dict[str, Any]:
    """Return all that demonstrations depend on, as plain values, and what a reader needs to know of them."""
    robot = task.world.robot
    try:
        text = json.dumps(task_data(task, Path("/")), sort_keys=True)
    except InputError:  # a mesh that was made in memory has no place in a file
        text = repr(task)
    instruction = task.random.instruction if task.random is not None else ""
    return {
        "task": task.name,
        "content": sha256(text.encode()).hexdigest(),
        "instruction": instruction or task.name.replace("_", " "),
        "seed": seed,
        "rate": timing.rate,
        "share": timing.share,
        "pause": timing.pause,
        "robot": robot.name,
        "joint_names": list(robot.joint_names),
        "units": ["m" if slides else "rad" for slides in robot.prismatic.tolist()],
        "gripper": None if robot.gripper is None else "share to which it is open: 0 closed, 1 wide open",
        "objects": list(observed(task)),
        "rrtik-ompl": __version__,
    }


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A recording that is going on."""

    draws: Draws
    seed: int
    timing: Timing
    folder: DemoFolder

    @property
    def last(self) -> int:
        """Number of the last attempt."""
        return max(self.folder.records, default=-1)

    @property
    def successes(self) -> int:
        """Number of demonstrations that are there."""
        return sum(each["found"] for each in self.folder.records.values())

    def rounds(self, wanted: int) -> Iterator[list[int]]:
        """Yield the numbers of attempts that have yet to be made.

        No round has more attempts than demonstrations are missing, so that exactly as many attempts are made as the
        wanted number takes, however they are spread.
        """
        attempts = 0
        found = 0
        while found < wanted and attempts < FIRST + PER_DEMO * wanted:
            if attempts >= FIRST and not found:
                return
            missing = wanted - found
            numbers = range(attempts, attempts + (min(missing, FIRST) if attempts < FIRST else missing))
            yield [number for number in numbers if number not in self.folder.records]
            attempts = numbers.stop
            found += sum(self.folder.records[number]["found"] for number in numbers)

    def recording(self, wanted: int, dataset: Path) -> Recording:
        """Return what has come of it."""
        records = self.folder.records
        failures: Counter[str] = Counter()
        alike: dict[str, str] = {}  # a reason for all that differ from it in numbers alone
        for each in (each for each in records.values() if not each["found"]):
            failures[alike.setdefault(NUMBERS.sub("", each["reason"]), each["reason"])] += 1
        rejected: Counter[str] = Counter()
        for each in records.values():
            rejected.update(each["rejected"])
        return Recording(self.folder.path, self.successes, wanted, len(records), failures, rejected, dataset)


def _episodes(run: _Run, numbers: list[int], processes: int, scheduler: str | None) -> Generator[Episode, None, None]:
    """Make attempts, and yield what has come of them as they are done."""
    if scheduler is None and (processes == 1 or len(numbers) < 2):
        for number in numbers:
            yield attempted(run.draws, run.seed, number, run.timing)
        return

    jobs = _jobs(run, numbers)
    finished = spread.cluster(jobs, scheduler) if scheduler is not None else spread.local(jobs, processes)
    try:
        for record in finished:
            if record["status"] == DONE:
                yield record["episode"]
            else:
                yield Episode(record["number"], f"{record['status']}: {record['reason']}", {})
    finally:
        finished.close()


def _jobs(run: _Run, numbers: Iterable[int]) -> Iterator[dict[str, Any]]:
    """Yield the attempts as jobs for other processes; see `many.child.guarded`."""
    times, more = PATIENCE
    parcel = packed((run.draws, run.seed, run.timing))
    limits = {"patience": times * run.timing.seconds + more, "memory_mb": MEMORY_MB, "planner": None}
    for number in numbers:
        yield {"run": {"number": number}, "module": __name__, **limits, PARCEL: parcel}


def prepared(job: Mapping[str, Any]) -> Callable[[], dict[str, Any]]:
    """Unpack the draws of a job, and return what makes the attempt; see `many.child.guarded`."""
    return partial(_made, job, *unpacked(job[PARCEL]))


def _made(job: Mapping[str, Any], draws: Draws, seed: int, timing: Timing) -> dict[str, Any]:
    """Make the attempt, and return its record."""
    try:
        return {"status": DONE, "episode": attempted(draws, seed, job["run"]["number"], timing)}
    except MemoryError as error:
        return out_of_memory(job, error)
