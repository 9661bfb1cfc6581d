"""Two checkers of certificates beside each other: true ones and forged ones, judged in numpy and by the page's script.

Each certificate is of a path among random obstacles of all kinds, for foreign and own arms that both checkers read from
URDF; each is forged in many ways (`forgeries`). The script is run by node.
"""

from __future__ import annotations

import atexit
import json
import math
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Option

from bench.proofs.checked_cases import CLEARANCE, Arm, arm_of, cases_of
from bench.proofs.forgeries import FORGERS, Case, Forgery
from bench.proofs.task_forgeries import TASK_FORGERS
from bench.shared.parts import Parts
from bench.shared.run import Run
from rrtik_bench.report.machine import processes
from rrtik_bench.report.page import Report
from rrtik_ompl.base.errors import InputError, RrtikError
from rrtik_ompl.files.tables import json_value
from rrtik_ompl.model.certificate import from_document, task_from_document
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.problem_files.path_constraints import constraint_data
from rrtik_ompl.tasks import Task
from rrtik_ompl.world.certificate_check import certificate_fault

ARMS = {"planar": 10, "titan4": 10, "ur5": 6, "panda": 5, "so101": 1}  # how often each is taken
# Arms whose certificates are of other kinds: of timed motions, of motions among obstacles that move, beside an octree
# and a height field, with things in the hand, and with path constraints.
KINDS = {
    "planar timed": 2, "ur5 timed": 1, "planar moving": 2, "ur5 moving": 1, "titan4 piles": 2, "panda piles holding": 1,
    "planar holding": 1, "ur5 holding": 1, "planar held": 1, "titan4 held": 2, "ur5 held timed": 1,
    "panda holding held": 1,
}  # fmt: skip
ROUND = 2  # true certificates of a part


@lru_cache(maxsize=8)
def _written(scene: Scene, file: Path) -> str:
    """Return the text of a scene's file; the scene of a case is asked for again and again."""
    scene.save(file)
    return file.read_text()


def _constraints(forgery: Forgery) -> str:
    """Return the line of a problem file that has the path constraints of the asker."""
    found = [constraint_data(region) for region in forgery.world.settings.constraints]
    return f"path_constraints: {json.dumps(found)}\n" if found else ""


class Script:
    """The checker of the page, run by node."""

    def __init__(self, node: str = "node") -> None:
        command = str(files("rrtik_ompl.viewer").joinpath("assets", "checker", "command.cjs"))
        self._process = subprocess.Popen(
            [node, command, "--batch"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, encoding="utf-8"
        )

    def fault(self, arm: Arm, forgery: Forgery, folder: Path) -> str:
        """Return why a certificate does not hold, "" if it does."""
        scene = folder / "scene.yaml"
        route = forgery.route
        path: dict[str, Any] = {
            "kind": "joint_path",
            "joint_names": forgery.world.robot.joint_names,
            "waypoints": np.asarray(route.waypoints).tolist(),
        }
        if route.times is not None and route.rates is not None:
            path |= {"kind": "joint_motion", "times": route.times.tolist(), "rates": route.rates.tolist()}
        texts = {
            "certificate.json": forgery.text,
            "path.json": json.dumps(path),
            str(scene): _written(forgery.world.scene, scene) + _constraints(forgery),
        }
        return self.fault_of(arm, texts, forgery.clearance)

    def fault_of(self, arm: Arm, texts: Mapping[str, str], clearance: float) -> str:
        """Return why the certificate among files that are given by name does not hold, "" if it does."""
        job = {"files": arm.files, "texts": dict(texts), "clearance": clearance}
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write(json.dumps(job) + "\n")
        stdin.flush()
        answer: dict[str, Any] = json.loads(stdout.readline())
        return "" if answer["holds"] else answer["fault"] or "refused"

    def close(self) -> None:
        """End node."""
        self._process.communicate()


@cache
def script(node: str = "node") -> Script:
    """Return the script, which runs as long as this process: what it has read of an arm it keeps."""
    running = Script(node)
    atexit.register(running.close)
    return running


def fault_in_numpy(forgery: Forgery) -> str:
    """Return why our own verifier refuses a certificate, "" if it does not."""
    try:
        document = json_value(forgery.text)
        if not isinstance(document, dict):
            return "not an object"
        certificate = from_document(document)
    except InputError as error:
        return str(error)
    return certificate_fault(certificate, forgery.world, forgery.route, clearance=forgery.clearance)


@dataclass(slots=True)
class Count:
    """What came of certificates.

    Attributes:
        true, accepted: Number of true ones, and of those that both have accepted.
        forged, refused: By kind of forgery, the number of forged ones, and of those that both have refused.
        wrong: What one of them got wrong, a line each.
        seconds: Processor time of our verifier and wall time of the script, for true ones [s].
    """

    true: int = 0
    accepted: int = 0
    forged: dict[str, int] = field(default_factory=dict)
    refused: dict[str, int] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    seconds: list[tuple[float, float]] = field(default_factory=list)


def compared(name: str, seed: int, true: int, forged: int, kinds: Sequence[str] = tuple(FORGERS)) -> Count:
    """Count what both checkers say of some certificates of an arm, and of so many forgeries of each, of some kinds."""
    count = Count()
    rng = np.random.default_rng(seed)
    page = script()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        arm = arm_of(name, folder)
        cases = cases_of(name, arm.robot, folder, seed)
        for case in (next(cases) for _ in range(true)):
            given = Forgery(json.dumps(case.document), case.world, case.route, CLEARANCE)
            begin = time.process_time()
            ours = fault_in_numpy(given)
            middle = time.perf_counter()
            theirs = page.fault(arm, given, folder)
            count.seconds.append((time.process_time() - begin, time.perf_counter() - middle))
            count.true += 1
            count.accepted += not ours and not theirs
            if ours or theirs:
                count.wrong.append(f"{name} {seed}: true, refused: {ours!r} {theirs!r}")
            drawn = rng.permutation([*kinds] * (2 + forged // len(kinds))).tolist()
            forge(count, case, arm, page, folder, drawn, forged, rng)
    return count


TASKS = {"titan4_drawer": "titan4", "panda_pick_place": "panda"}  # each with its arm


def tasks_compared(name: str, seed: int, forged: int) -> Count:
    """Count what both checkers say of the certificate of a task, and of so many forgeries of it."""
    count = Count()
    rng = np.random.default_rng(seed)
    page = script()
    with tempfile.TemporaryDirectory() as place:
        arm = arm_of(TASKS[name], Path(place))
        plan = Task.load(name).plan(seed=seed)
        made = plan.certificate()
        plan.save(Path(place) / "plan.json")
        text = (Path(place) / "plan.json").read_text()

        def faults(document: dict[str, Any]) -> tuple[str, str]:
            texts = {"certificate.json": json.dumps(document), "plan.json": text}
            begin = time.process_time()
            try:
                ours = plan.verify(task_from_document(document))
            except InputError as error:
                ours = str(error)
            middle = time.perf_counter()
            theirs = page.fault_of(arm, texts, 0.0)
            count.seconds.append((time.process_time() - begin, time.perf_counter() - middle))
            return ours, theirs

        document = json.loads(json.dumps(made.document())) if made is not None else {}
        said = faults(document)
        count.true = 1
        count.accepted = int(not any(said))
        if any(said):
            count.wrong.append(f"{name}: true, refused: {said}")
        for k in range(forged):
            kind, forger = list(TASK_FORGERS.items())[k % len(TASK_FORGERS)]
            changed = forger(deepcopy(document), rng)
            if changed is not None:
                said = faults(changed)
                count.forged[kind] = count.forged.get(kind, 0) + 1
                count.refused[kind] = count.refused.get(kind, 0) + all(said)
                count.wrong += [] if all(said) else [f"{name}: {kind}, accepted: {said}"]
        del count.seconds[1:]
    return count


def forge(
    count: Count, case: Case, arm: Arm, page: Script, folder: Path, kinds: Sequence[str], forged: int,
    rng: np.random.Generator,
) -> None:  # fmt: skip
    """Count what both checkers say of forgeries of one certificate, of the first kinds that there is something for."""
    done = 0
    for name in kinds:
        if done == forged:
            return
        try:
            forgery = FORGERS[name](case, rng)
        except RrtikError:  # the scene that it would need is none
            continue
        if forgery is None:
            continue
        done += 1
        ours, theirs = fault_in_numpy(forgery), page.fault(arm, forgery, folder)
        count.forged[name] = count.forged.get(name, 0) + 1
        count.refused[name] = count.refused.get(name, 0) + (bool(ours) and bool(theirs))
        if not ours or not theirs:
            count.wrong.append(
                f"{case.world.robot.name}: {name}, accepted by {'us' if not ours else 'the script'}: {ours}{theirs}"
            )


def main(
    run: Run,
    parts: Parts,
    *,
    true: Annotated[int, Option(help="True certificates.")] = 1000,
    forged: Annotated[int, Option(help="Forged ones of each.")] = 20,
) -> Report:
    """Make the page of both checkers."""
    shares = ARMS | KINDS
    whole = sum(shares.values())
    # Of all arms and kinds a part, then of all a second one, so that what is done of a longer run is a shorter one.
    counts = [math.ceil(true * share / whole / ROUND) for share in shares.values()]
    wanted = [
        (name, 1000 * k + seed, ROUND, forged)
        for seed in range(max(counts))
        for k, name in enumerate(shares)
        if seed < counts[k]
    ]
    found = parts(compared, wanted)
    of_tasks = parts(tasks_compared, [(name, 1, 2 * forged) for name in TASKS])

    report = Report("Two checkers of certificates", run.command, processes(run.jobs), intro=INTRO)
    everything = [*found, *of_tasks]
    accepted, total = (sum(getattr(each, name) for each in everything) for name in ("accepted", "true"))
    forgeries, refused = (
        sum((Counter(getattr(each, name)) for each in everything), Counter[str]()) for name in ("forged", "refused")
    )
    report.bar("true certificates that both accept", "all", f"{accepted} of {total}", accepted == total)
    text = f"{refused.total()} of {forgeries.total()}"
    report.bar("forged certificates that both refuse", "all", text, refused == forgeries)

    rows = []
    for name in (*shares, *TASKS):
        own = [each for part, each in zip(wanted, found, strict=True) if part[0] == name]
        own += [each for task, each in zip(TASKS, of_tasks, strict=True) if task == name]
        ours, script_s = 1e3 * np.array([pair for each in own for pair in each.seconds]).T
        count = f"{sum(each.accepted for each in own)} of {sum(each.true for each in own)}"
        rows.append([name, count, *(f"{np.median(x):.0f} / {x.max():.0f}" for x in (ours, script_s))])
    report.table(
        "True certificates", ["arm, kind or task", "both accept", "ours [ms]", "the script [ms]"], rows, text=TRUE
    )
    table = [[name, f"{forgeries[name]}", f"{refused[name]}"] for name in (*FORGERS, *TASK_FORGERS)]
    report.table("Forged certificates, by kind", ["kind", "forged", "both refuse"], table, text=FORGED)
    wrong = [line for each in everything for line in each.wrong]
    if wrong:
        report.note("What one of them got wrong", "\n".join(f"- {line}" for line in wrong[:50]))
    return report


INTRO = (
    "`rrtik_ompl/world/certificate_check.py`, in numpy and coal, and the JavaScript of the checker's page, run by "
    "node, which reads the arm's URDF, SRDF and meshes and the scene's YAML, STL, PLY, NPY and OctoMap by itself. "
    "Paths of seven waypoints among six obstacles of eight kinds and a half-space, clearance 1 mm. *timed*: splines "
    "through these; *moving*: three of the obstacles move; *piles*: an octree and a height field are among them; "
    "*holding*: one or two things in the hand; *held*: one to three path constraints of any kind that the motion keeps."
)
TRUE = "Times of one certificate, median and worst: processor time of ours, wall time of the script with reading."
FORGED = (
    "What is forged is drawn at random. A forgery counts only if it is certain that it proves nothing: by "
    "construction, or by a witness of Pinocchio and coal (`bench/proofs/forgery_judge.py`)."
)
