"""The second check of planners' paths: prove them, add detours where that fails, or else check them in steps."""

from __future__ import annotations

import numpy as np

from rrtik_ompl.base.arrays import Matrix, Vector
from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.ompl_bridge.attempt import Attempt
from rrtik_ompl.ompl_bridge.planner_traits import traits_of
from rrtik_ompl.planning.moves.clearance_levels import wide_clearances_between
from rrtik_ompl.planning.outcome import NamedPlanner, Request
from rrtik_ompl.world.clearances import (
    Clearances,
    clearances_between,
    keeping,
    proved,
    proved_as_clear,
    search_form,
)
from rrtik_ompl.world.detours import with_detours
from rrtik_ompl.world.problem import Problem, densely_checked, fixed_ends, problem_in
from rrtik_ompl.world.route_check import violations_of

# Options of planners that restrict the moves, see MoveRules.
MOVE_RULES = ("frozen_joints", "last_joints", "smallest_move")
TOUCHING = 1e-6  # [m]; bodies that are nearer to their margin than this count as touching


class SecondCheck:
    """Checks the paths that planners find, and accepts or rejects them.

    A proven path is accepted at once. A path that is not proven gets detours around the motions concerned. If these do
    not help it is checked in steps, and the best such path is remembered.

    Attributes:
        best: The best path so far that is valid but not proven with the clearance wanted, or None.
        reason: One line that says why the last path was not accepted; "" if it was.
        num_rejected: How many paths were invalid.
        num_unproven: How many paths were valid but not proven.

    Args:
        problem: The problem that is solved.
        planner: The planner whose paths are checked.
        request: Which proofs and which clearance are asked for. If its options restrict the moves of the planner, no
            detours are made.
        seed: Seed of the detours.
    """

    def __init__(self, problem: Problem, planner: NamedPlanner, request: Request, *, seed: int) -> None:
        # Arguments.
        self._problem = problem
        self._name = planner.name
        self._traits = traits_of(planner.factory)
        self._proof = request.proof
        self._clearance = request.clearance
        self._moves_are_restricted = any(option in request.parameters for option in MOVE_RULES)
        self._seed = seed

        # Results of the paths so far.
        self.best: JointPath | None = None
        self.reason = ""
        self.num_rejected = 0
        self.num_unproven = 0
        self._ends_can_be_proven = True  # becomes False once the ends of a path could not be proven

    @property
    def wants_proofs(self) -> bool:
        """Whether paths are to be proven at all."""
        return self._proof != "off"

    @property
    def cannot_improve(self) -> bool:
        """Whether there is a path that no attempt can improve, because its ends themselves are not proven free."""
        return self.best is not None and not self._ends_can_be_proven

    def why_impossible(self) -> str:
        """Return why there can be no proven path although one is required, in a line; "" if there may be one."""
        world = self._problem.world
        if self._proof != "required":
            return ""
        for what, q in fixed_ends(self._problem).items():
            if world.motion_proven(q, q):
                continue
            near = world.closest(q)
            if near is not None and near.clearance < TOUCHING:
                remedy = "list the pair in allowed_collisions if it may touch"
                return f"the {what} is not proven free: '{near.first}' and '{near.second}' touch; {remedy}"
            return f"the {what} is not proven free: {self._first_gap(np.stack([q, q]))}"
        return ""

    def resting_path(self) -> JointPath:
        """Return the path that stays at the start, proven with the largest clearance that can be proven there."""
        path = JointPath.of(self._problem.robot, self._problem.start[None])
        if not self.wants_proofs:
            return path
        clearances = self._provable_clearances(path.waypoints)
        return proved_as_clear(path, self._problem.world, 0.0 if clearances is None else clearances.proven_clearance)

    def strict_problem(self, *, proving: bool) -> Problem:
        """Return the problem for searches that keep more room than the clearance that has to be proven.

        Args:
            proving: Whether each motion is proven during the search, which searches in kernels cannot do. Otherwise
                motions are checked in steps, see :func:`search_form`.
        """
        clearances = self._provable_clearances(self._problem.start[None]) or Clearances(0.0, 0.0)
        dense = densely_checked(self._problem)
        if proving:
            proving_world = keeping(dense.world, clearances.searched_clearance, proven=clearances.proven_clearance)
            return problem_in(dense, proving_world)
        return problem_in(dense, search_form(dense.world, clearances))

    def accept(self, outcome: Attempt) -> JointPath | None:
        """Check the path of an attempt, and update `best`, `reason` and the counts.

        Returns:
            A path with which the search may end: that of the attempt, with its proof and with detours where it needed
            them, or `best` where no path can be proven. None if the search has to go on: there was no path, it is
            invalid (`num_rejected`), or it is valid but not proven (`num_unproven`, and perhaps `best`).
        """
        if outcome.rows is None:
            # A planner without a reason of its own is quoted with OMPL's status.
            why = f": {outcome.reason}" if outcome.reason else f" with '{outcome.status}'"
            self.reason = f"{self._name} ended{why}"
            return None

        problem = self._problem
        path = JointPath.of(problem.robot, outcome.rows)
        if not (path.start == problem.start).all() or not _at_goal(problem, path.end):
            self.reason = f"the path of {self._name} does not lead from the start to the goal"
            self.num_rejected += 1
            return None

        if self.wants_proofs:
            proven = self._prove_with_detours(path)
            if proven is not None:
                self.reason = ""
                return proven
        return self._check_in_steps(path)

    def _prove_with_detours(self, path: JointPath) -> JointPath | None:
        """Prove that a path keeps the clearance, with detours around the motions where that fails.

        Returns:
            The proven path. None if there is no proof: the ends of the path cannot be proven free, which is remembered;
            or detours are not allowed, as they might break a rule of moves or a path constraint; or detours did not
            help.
        """
        clearances = self._provable_clearances(path.waypoints[[0, -1]])
        if clearances is None:
            self._ends_can_be_proven = False
            return None

        world = self._problem.world
        clearance = clearances.proven_clearance
        # Prove the path as it is.
        if self._traits.leaves_room:
            first = proved_as_clear(path, world, clearance)
            known_proof = None  # it may be of less clearance, so it is not reused
        else:
            first = proved(path, world, clearance=clearance)
            known_proof = first.proof
        if first.proven:
            return first
        detours_might_break_rules = self._moves_are_restricted or bool(self._problem.constraints)
        if detours_might_break_rules:
            return None

        # Replace the motions that are not proven by detours, and prove the result.
        repaired = with_detours(
            world,
            path.waypoints,
            clearance=clearance,
            rng=np.random.default_rng(self._seed),
            one_joint=self._traits.one_joint,
            proof=known_proof,
        )
        if repaired is None:
            return None
        with_detour = proved(path_through(path, repaired), world, clearance=clearance)
        return with_detour if with_detour.proven else None

    def _check_in_steps(self, path: JointPath) -> JointPath | None:
        """Check a path without the clearance, by a proof or else in steps, and remember it if it is the best one.

        Returns:
            The path if no proof is wanted and it is valid; `best` if no path can be proven; otherwise None, and the
            counts and the reason say why.
        """
        world = self._problem.world
        if self.wants_proofs:
            path = proved(path, world)  # with no more clearance than the world keeps
        faults = () if path.proven else violations_of(world.checks, path.waypoints)
        if faults:
            self.num_rejected += 1
            self.reason = f"the path of {self._name} was rejected by the second check: {faults[0].reason}"
            return None

        self.reason = ""
        if not self.wants_proofs:
            return path

        self.num_unproven += 1
        if path.proven or self._proof == "preferred":
            if self.best is None or _rank(path) < _rank(self.best):
                self.best = path
        else:
            self.reason = f"no path that is proven free: {self._first_gap(path.waypoints)}"
        return self.best if self.cannot_improve else None

    def _provable_clearances(self, ends: Matrix) -> Clearances | None:
        """Return the clearances that paths between ends can be proven to keep; None if there are none.

        Args:
            ends: First and last configuration, shape (k, dof).
        """
        clearances_of = wide_clearances_between if self._traits.leaves_room else clearances_between
        return clearances_of(self._problem.world, ends, self._clearance)

    def _first_gap(self, rows: Matrix) -> str:
        """Describe the first motion of a route, shape (k, dof), that is not proven free; "" if all are proven."""
        world = self._problem.world
        proof = world.prover.route(rows, clearance=world.settings.required_clearance)
        return str(next(iter(proof.unproven), ""))


def _at_goal(problem: Problem, q: Vector) -> bool:
    """Check whether a configuration, shape (dof,), is at the goal.

    The bitwise comparison comes first because it is cheap and decides most cases.
    """
    wanted = problem.goal.q
    if wanted is not None and (q == wanted).all():
        return True
    return problem.reached(q)


def _rank(path: JointPath) -> tuple[int, float]:
    """Return the rank of a path, smaller is better: the number of its unproven motions, then its length."""
    num_unproven = 0 if path.proof is None else len(path.proof.unproven)
    return num_unproven, path.length
