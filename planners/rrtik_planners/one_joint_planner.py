"""What the planners that move one joint at a time have in common: their options, what comes first, what comes last."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from ompl import base as ob

from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.search.crdt.rules import KERNELS
from rrtik_ompl.ompl_bridge import MotionChecker, MotionQueries, SafePlanner, SearchResult, Stop
from rrtik_ompl.planning.moves.rules import Joints, PerJoint
from rrtik_planners.crdt_endings import NO_ENDING, Endings
from rrtik_planners.one_joint_options import OneJointOptions, joint_names


class OneJointPlanner(SafePlanner):
    """Base class: a subclass implements :meth:`between`, which need not know of joints that stay or move last.

    Attributes:
        ompl_name: For the class: its name in OMPL's reports.
        options: The options, checked.
    """

    ompl_name: ClassVar[str]
    kernels: ClassVar[tuple[str, ...]] = (KERNELS,)
    one_joint: ClassVar[bool] = True

    def __init__(
        self,
        si: ob.SpaceInformation,
        *,
        world: MotionQueries | None = None,
        seed: int | None = None,
        scale_by_range: bool = False,
        max_iterations: int | None = None,
        joint_costs: PerJoint | None = None,
        frozen_joints: Joints = (),
        smallest_move: PerJoint = 0.0,
        last_joints: Joints = (),
    ) -> None:
        """Make a planner. These are the options of all planners that move one joint at a time; some take a part.

        Args:
            si: ``ompl.base.SpaceInformation`` of real coordinates and angles.
            world: Checks configurations and motions instead of ``si``, if given.
            seed: At least 0; drawn from OMPL's if None.
            scale_by_range: Divide each coordinate by its range in the metric of the nearest neighbour.
            max_iterations: K of [1, ch. 6.3, algorithms 9 to 11]; without limit if None.
            joint_costs: Cost of a joint's motion, greater than 0, shape (n,): a slow or risky joint costs more. The
                metric multiplies its coordinate by it, and of the samples it takes part only in the share lowest cost /
                its cost, so that it moves less often; where it has to, it still does. All equal if None.
            frozen_joints: Joints that must not move, by number (from 0) or, with a world, by name. Starts and goals
                have to agree in them exactly; those that do not are left out.
            smallest_move: No move of a path is shorter [unit of the joint: rad or m], one number or one for each joint.
            last_joints: Joints that stay until all others have arrived, by number or name, such as the gripper's
                rotation; then they go straight to the goal, one after the other in this order. Goals to which that is
                not free are left out.

        Raises:
            InputError: If an option is out of range or the space is of another kind.
            UnknownNameError: If there is no joint of a name.
        """
        super().__init__(si, self.ompl_name, world=world, seed=seed)
        self.options = OneJointOptions(
            joint_names(world),
            si.getStateDimension(),
            scale_by_range=scale_by_range,
            max_iterations=max_iterations,
            joint_costs=joint_costs,
            frozen_joints=frozen_joints,
            smallest_move=smallest_move,
            last_joints=last_joints,
        )

    def between(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """Look for a path between starts and goals, shapes (s, n) and (g, n), that agree in the joints that stay."""
        raise NotImplementedError(f"{type(self).__name__} has no between()")

    def completed(self, found: SearchResult, path: Matrix) -> SearchResult:
        """The result with the last moves: its path goes on to ``path``. For subclasses whose statistics count moves."""
        return replace(found, path=path)

    def search(self, starts: Matrix, goals: Matrix, checker: MotionChecker, ptc: Stop) -> SearchResult:
        """See :meth:`rrtik_ompl.ompl_bridge.SafePlanner.search`."""
        starts, goals = self.options.agreeing(starts, goals)
        last = self.options.last_joints
        starts = starts[(starts[:, last] == starts[0, last]).all(axis=1)]
        endings = Endings(starts[0], goals, last, self.options.smallest_move, checker)
        if len(endings.aims) == 0:
            return SearchResult(None, reason=NO_ENDING)
        found = self.between(starts, endings.aims, checker, ptc)
        return found if found.path is None else self.completed(found, endings.completed(found.path))
