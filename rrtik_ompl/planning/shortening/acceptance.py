"""Which shortened paths may be returned: proven ones with the clearance, or what is no worse than the input in that."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rrtik_ompl.model.path import JointPath, path_through
from rrtik_ompl.planning.moves.clearance_levels import roomiest
from rrtik_ompl.planning.shortening.task import Wishes
from rrtik_ompl.world.detours import with_detours
from rrtik_ompl.world.kept_clearance import Room, keeping, proved_as_clear, room_between
from rrtik_ompl.world.motion_queries import MotionQueries
from rrtik_ompl.world.problem import Problem, densely_checked
from rrtik_ompl.world.proven_motions import proven_motions
from rrtik_ompl.world.route_check import violations_of

SPARE = 2.5e-4  # [m] beyond the clearance that searches keep if the ends have it: chords of timed motions need 0.1 mm


class Form(NamedTuple):
    """A form of the problem in which to shorten.

    Attributes:
        problem: With a world that checks what methods check themselves.
        motions: What the others ask.
        share: Of the time left.
    """

    problem: Problem
    motions: MotionQueries
    share: float


class Acceptance:
    """The second check of shortened paths.

    Attributes:
        input: The given path, with what is proven of it.

    Args:
        path: Given, valid.
        problem: What it solves.
        wishes: Which clearance is to be kept, None for a millimetre or what the ends of the path have; and the seed of
            the detours.
        one_joint: Whether its moves of one joint have to stay such, so that there are no detours.
        leaves_room: Whether the method keeps a clearance itself, where that costs no move.
        samples: Whether the method checks motions in steps, by the problem's world alone.
    """

    def __init__(
        self,
        path: JointPath,
        problem: Problem,
        wishes: Wishes,
        *,
        one_joint: bool,
        leaves_room: bool = False,
        samples: bool = False,
    ) -> None:
        self._problem = problem
        self._seed = wishes.budget.seed
        self._one_joint = one_joint
        self._leaves_room = leaves_room
        self._samples = samples
        room = roomiest if leaves_room else room_between
        self._room = room(problem.world, path.waypoints[[0, -1]], wishes.clearance)

        known = path.proven_in(problem.world) and self._keeps(path)
        self.input = path if known else self._proved(path)
        self._input_keeps = self._keeps(self.input)

    def forms(self) -> list[Form]:
        """The problem in the forms in which to shorten, one after the other.

        What is as short as can be touches what it goes round, so motions must be proven to count as free. Methods that
        ask the world alone check as densely as the second check, with room to spare; then with proofs too. Where the
        input does not keep the clearance, neither may help.
        """
        dense = densely_checked(self._problem)
        if self._leaves_room:
            return [Form(dense, dense.world, 1.0)]

        found = [] if self._room is None else self._roomy_forms(dense, self._room)
        if not self._input_keeps:
            found.append(Form(dense, dense.world, 1.0))
        return found

    def _roomy_forms(self, dense: Problem, room: Room) -> list[Form]:
        """Those that leave room; where the input does not keep the clearance, with time left for one that need not."""
        wider = min(room.searched, room.kept + SPARE)
        last = 1.0 if self._input_keeps else 0.5
        if not self._samples:
            return [Form(dense, proven_motions(dense.world, wider, self.input.waypoints), last)]

        roomy = keeping(dense.world, wider)
        proving = keeping(dense.world, wider, proven=room.kept)
        return [Form(dense.with_world(roomy), roomy, 0.7), Form(dense.with_world(proving), proving, last)]

    def accepted(self, shorter: JointPath) -> JointPath | None:
        """The path, with what is proven of it and with detours where it needs them, or None."""
        proved = self._proved(shorter)
        if self._keeps(proved):
            return proved

        if self._room is not None and not self._one_joint:
            rng = np.random.default_rng(self._seed)
            rows = with_detours(self._problem.world, shorter.waypoints, clearance=self._room.kept, rng=rng)
            if rows is not None:
                return self._proved(path_through(shorter, rows))

        # the clearance cannot be had: a path that is no worse than the input in what is proven will do
        if self._leaves_room and proved.proven:
            return proved
        if self._input_keeps or (self.input.proven and not proved.proven):
            return None
        return None if violations_of(self._problem.world, shorter.waypoints) else proved

    def _proved(self, path: JointPath) -> JointPath:
        """The path with a proof of the clearance, or of less."""
        kept = 0.0 if self._room is None else self._room.kept
        return proved_as_clear(path, self._problem.world, kept)

    def _keeps(self, proved: JointPath) -> bool:
        """Whether a path is proven to keep the clearance."""
        proof = proved.proof
        return self._room is not None and proof is not None and proof.proven and proof.clearance >= self._room.kept
