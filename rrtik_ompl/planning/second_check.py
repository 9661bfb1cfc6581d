"""The second check of what planners find: proven, or made provable by detours, or checked in steps and kept in mind."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.ompl_bridge.attempt import Attempt
from rrtik_ompl.ompl_bridge.planner_traits import traits_of
from rrtik_ompl.planning.moves.clearance_levels import roomiest
from rrtik_ompl.planning.outcome import NamedPlanner, Request
from rrtik_ompl.world.detours import with_detours
from rrtik_ompl.world.kept_clearance import Room, keeping, leaving_room, proved, proved_as_clear, room_between
from rrtik_ompl.world.problem import Problem, densely_checked
from rrtik_ompl.world.route_check import violations_of

MOVE_RULES = ("frozen_joints", "last_joints", "smallest_move")  # options of planners, see MoveRules
TOUCHING = 1e-6  # [m]; bodies that are nearer to their margin than this count as touching


class SecondCheck:
    """Accepts paths of planners.

    A proven path is accepted at once. One that is not proven gets detours; where these do not help it is checked in
    steps, and the best such path is kept in mind.

    Attributes:
        best: The best path that is not proven with the clearance wanted, or None.
        reason: Why the last path was not accepted, in a line; "" if it was.
        rejected: How many paths are not valid.
        open: How many are valid, but not proven.

    Args:
        problem: What is solved.
        planner: Whose paths are checked.
        request: Which proofs and which clearance are asked for; where the planner's options say which moves there may
            be, none are added.
        seed: Of the detours.
    """

    def __init__(self, problem: Problem, planner: NamedPlanner, request: Request, *, seed: int) -> None:
        self.best: JointPath | None = None
        self.reason = ""
        self.rejected = 0
        self.open = 0
        self._problem = problem
        self._name = planner.name
        self._traits = traits_of(planner.factory)
        self._proof = request.proof
        self._clearance = request.clearance
        self._ruled = any(option in request.parameters for option in MOVE_RULES)
        self._seed = seed
        self._ends_proven = True

    @property
    def proves(self) -> bool:
        """Whether paths are to be proven at all."""
        return self._proof != "off"

    @property
    def settled(self) -> bool:
        """Whether there is a path that cannot be made better: its ends themselves are not proven free."""
        return self.best is not None and not self._ends_proven

    def impossible(self) -> str:
        """Why there can be no proven path if that is required, in a line; "" if there may be one."""
        world = self._problem.world
        for what, q in fixed_ends(self._problem).items() if self._proof == "required" else ():
            if world.motion_proven(q, q):
                continue
            near = world.closest(q)
            if near is not None and near.clearance < TOUCHING:
                remedy = "list the pair in allowed_collisions if it may touch"
                return f"the {what} is not proven free: '{near.first}' and '{near.second}' touch; {remedy}"
            return f"the {what} is not proven free: {self._first_gap(np.stack([q, q]))}"
        return ""

    def still(self) -> JointPath:
        """The path that stays at the start, with a proof of the clearance, or of what there is of it."""
        path = JointPath.of(self._problem.robot, self._problem.start[None])
        if not self.proves:
            return path
        room = self._room(path.waypoints)
        return proved_as_clear(path, self._problem.world, 0.0 if room is None else room.kept)

    def strict(self, *, proving: bool) -> Problem:
        """The problem for searches that leave room: motions keep more than the clearance in steps, and may be proven.

        Where they are not proven, see :func:`leaving_room`.

        Args:
            proving: Whether motions have to be proven, which searches in kernels cannot.
        """
        room = self._room(self._problem.start[None]) or Room(0.0, 0.0)
        strict = densely_checked(self._problem)
        if proving:
            return strict.with_world(keeping(strict.world, room.searched, proven=room.kept))
        return strict.with_world(leaving_room(strict.world, room))

    def accepted(self, outcome: Attempt) -> JointPath | None:
        """The path of an attempt if it is accepted."""
        if outcome.rows is None:
            why = f": {outcome.reason}" if outcome.reason else f" with '{outcome.status}'"  # or else OMPL's words
            self.reason = f"{self._name} ended{why}"
            return None

        problem = self._problem
        path = JointPath.of(problem.robot, outcome.rows)
        if not (path.start == problem.start).all() or not _at_goal(problem, path.end):
            self.reason = f"the path of {self._name} does not lead from the start to the goal"
            self.rejected += 1
            return None

        proven = self._proven(path) if self.proves else None
        return proven if proven is not None else self._checked(path)

    def _proven(self, path: JointPath) -> JointPath | None:
        """The path, with detours where it needs them, if it is proven to keep the clearance."""
        room = self._room(path.waypoints[[0, -1]])
        if room is None:
            self._ends_proven = False
            return None

        world = self._problem.world
        leaves_room = self._traits.leaves_room
        first = proved_as_clear(path, world, room.kept) if leaves_room else proved(path, world, clearance=room.kept)
        if first.proven:
            self.reason = ""
            return first
        if self._ruled or self._problem.constraints:  # a detour might break them
            return None

        repaired = with_detours(
            world,
            path.waypoints,
            clearance=room.kept,
            rng=np.random.default_rng(self._seed),
            one_joint=self._traits.one_joint,
            proof=None if leaves_room else first.proof,
        )
        mended = None if repaired is None else proved(path_through(path, repaired), world, clearance=room.kept)
        if mended is None or not mended.proven:
            return None
        self.reason = ""
        return mended

    def _checked(self, path: JointPath) -> JointPath | None:
        """The path if no proof is wanted and the check in steps agrees; else it may become the best one."""
        world = self._problem.world
        if self.proves:
            path = proved(path, world)
        faults = () if path.proven else violations_of(world, path.waypoints)
        if faults:
            self.rejected += 1
            self.reason = f"the path of {self._name} was rejected by the second check: {faults[0].reason}"
            return None

        self.reason = ""
        if not self.proves:
            return path

        self.open += 1
        if path.proven or self._proof == "preferred":
            self.best = path if self.best is None or _rank(path) < _rank(self.best) else self.best
        else:
            self.reason = f"no path that is proven free: {self._first_gap(path.waypoints)}"
        return self.best if self.settled else None

    def _room(self, ends: Matrix) -> Room | None:
        room = roomiest if self._traits.leaves_room else room_between
        return room(self._problem.world, ends, self._clearance)

    def _first_gap(self, rows: Matrix) -> str:
        world = self._problem.world
        proof = world.prover.route(rows, clearance=world.settings.kept)
        return str(next(iter(proof.unproven), ""))


def fixed_ends(problem: Problem) -> dict[str, Vector]:
    """The configurations that every path of a problem passes, by what they are."""
    q = problem.goal.q
    return {"start": problem.start} | ({} if q is None else {"goal": q})


def _at_goal(problem: Problem, q: Vector) -> bool:
    """Whether a configuration, shape (dof,), is at the goal; most are its joint values to the bit."""
    wanted = problem.goal.q
    return bool(wanted is not None and (q == wanted).all()) or problem.reached(q)


def _rank(path: JointPath) -> tuple[int, float]:
    """Motions that are not proven, then length: what is to be small."""
    return 0 if path.proof is None else len(path.proof.unproven), path.length
