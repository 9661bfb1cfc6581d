"""Proofs that motions are free, in numpy: the bounds of the kernels and of the verifier, and a search for planes.

As the kernels, after Schwarzer, Saha and Latombe [16]: an interval on which two solids are not shown apart is halved.
Here all motions, pairs and intervals of one level are compared at once. A pair that is not apart in the middle of an
interval ends the proof of its motion there, because no shorter interval could change that.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rrtik_ompl.base.arrays import Mask, Matrix, Vector
from rrtik_ompl.geometry.collision.shape_table import BOX_CORNERS
from rrtik_ompl.kernels.proof import layout
from rrtik_ompl.kernels.proof.layout import CLOUD, CONVEX_SOLID, DEEPEST, HALF_SPACE, UNKNOWN, WHOLE_BODY
from rrtik_ompl.kernels.proof.packing import ProofPairs
from rrtik_ompl.kernels.reference.checks import search_tree
from rrtik_ompl.kernels.reference.separation import (
    SHORTEST,
    Bounds,
    Ends,
    Joints,
    Numbers,
    Poses,
    ball_gaps,
    lengths_of,
    places_of,
    rotated,
    seen_from_base,
)
from rrtik_ompl.kernels.simd.processor import WIDTH

ENDLESS = 1e18  # [m]
TINY = 1e-300  # [m^2]
MOST_STEPS = 20  # of a search for a plane
CONVERGED = 1e-7  # [m]
AT_ONCE = 4096  # intervals that are compared together, to bound memory
MOST_CORNERS = 1 << 18  # that are compared together, to bound memory
PATIENT = 0.1  # width of an interval down to which whole bodies are kept together, if only the sagitta is in the way
EAGER = 0.9  # of a ball's radius beyond the body's least half side, which planes may gain; else no plane is searched
SINGLE_ROUNDING = 1e-6  # of a point's place, relative and [m]
BENT = 0.05  # of a ball's radius: up to this sagitta they are searched nevertheless, as halves would hardly bend less
NARROW = 0.01  # width of an interval from which on they are searched in any case
PROVEN, LATER, IN_PARTS, NOT = range(4)  # answers for a pair on an interval


@dataclass(frozen=True, slots=True, eq=False)
class Intervals:
    """Pairs of the table on intervals of motions.

    Attributes:
        motion: Numbers of the motions, shape (n,).
        pair: Numbers of the pairs, shape (n,).
        begin, end: Ends of the intervals as shares of the motions, shape (n,).
    """

    motion: Numbers
    pair: Numbers
    begin: Vector
    end: Vector

    def __len__(self) -> int:
        return len(self.motion)

    def of(self, rows: Any) -> Intervals:
        """Return some of them."""
        return Intervals(self.motion[rows], self.pair[rows], self.begin[rows], self.end[rows])

    def parts(self) -> list[Intervals]:
        """Return them in parts that bound memory."""
        return [self.of(slice(first, first + AT_ONCE)) for first in range(0, len(self), AT_ONCE)]

    def middles(self) -> Intervals:
        """Return the middles of the intervals."""
        middle = 0.5 * (self.begin + self.end)
        return replace(self, begin=middle, end=middle)

    def halves(self) -> Intervals:
        """Return both halves of each interval."""
        middle = 0.5 * (self.begin + self.end)
        motion = np.concatenate([self.motion, self.motion])
        pair = np.concatenate([self.pair, self.pair])
        begin = np.concatenate([self.begin, middle])
        return Intervals(motion, pair, begin, np.concatenate([middle, self.end]))


def joined(some: list[Intervals]) -> Intervals:
    """Return all intervals of a list that is not empty."""
    fields = ("motion", "pair", "begin", "end")
    return Intervals(*(np.concatenate([getattr(each, name) for each in some]) for name in fields))


def prove(packed: ProofPairs, starts: Matrix, ends: Matrix, pairs: NDArray[np.int32], places: Vector) -> int:
    """Prove motions between rows of joint values; as :func:`rrtik_ompl.kernels.proof.proof_kernels.prove`.

    Args:
        packed: The table.
        starts: Rows of joint values, shape (m, joints).
        ends: As many.
        pairs: Gets for each motion -1, or the number of a pair that is not proven apart, shape (m,).
        places: Gets where on the motion that is, from 0 to 1, shape (m,).

    Returns:
        How many motions are not proven.
    """
    return _Proof(packed, starts, ends).written_to(pairs, places)


class _Proof:
    """A proof of some motions; arguments as of :func:`prove`."""

    def __init__(self, packed: ProofPairs, starts: Matrix, ends: Matrix) -> None:
        table = packed.table
        self._packed = packed
        self._starts = starts
        self._changes = ends - starts
        self._moves: Mask = (self._changes != 0.0).any(axis=1)
        self._telling = table.log_room > 0

        rows = table.joints.reshape(-1, layout.JOINT_SIZE)
        placements = np.tile(np.eye(4), (len(rows), 1, 1))
        placements[:, :3, :3] = rows[:, : layout.ORIGIN].reshape(-1, 3, 3)
        placements[:, :3, 3] = rows[:, layout.ORIGIN : layout.JOINT_AXIS]
        self._joints = Joints(table.parents, placements, rows[:, layout.JOINT_AXIS :], table.sliding != 0)

        self._solids = np.asarray(table.solids.reshape(-1, layout.SOLID_SIZE), dtype=np.int64)
        self._sizes = np.asarray(table.sizes.reshape(-1, layout.SIZE_COUNT))
        self._corners = np.asarray(table.corners.reshape(-1, 3, WIDTH))
        self._pairs = np.asarray(table.pairs.reshape(-1, layout.PAIR_SIZE), dtype=np.int64)
        self._bends = self._bounded_bends()

        sizes = self._sizes
        kinds = self._solids[:, layout.SOLID_KIND]
        endless = np.where((kinds == UNKNOWN) | (kinds == HALF_SPACE), ENDLESS, 0.0)
        self._bounds = Bounds(
            sizes[:, layout.BALL_CENTRE : layout.BALL_CENTRE + 3],
            sizes[:, layout.BALL_RADIUS] + endless,
            sizes[:, layout.BOX_AXES : layout.BOX_AXES + 9].reshape(-1, 3, 3).transpose(0, 2, 1),
            sizes[:, layout.BOX_MIDDLE : layout.BOX_MIDDLE + 3],
            sizes[:, layout.BOX_HALF : layout.BOX_HALF + 3] + endless[:, None],
        )

    def _bounded_bends(self) -> Matrix:
        """Bound the accelerations of each sweep's points in each motion, shape (sweeps + 1, m); 0 for what rests.

        See :func:`rrtik_ompl.kernels.proof.frames.bound_bends`.
        """
        table = self._packed.table
        rates = np.abs(self._changes).T
        lanes = table.reaches.reshape(-1, table.joint_count, WIDTH)
        reaches = lanes.transpose(0, 2, 1).reshape(-1, table.joint_count)
        bends = np.zeros((table.sweep_count + 1, len(self._changes)))  # the last row is that of number -1

        for number, (frame, base) in enumerate(table.sweeps.reshape(-1, layout.SWEEP_SIZE).tolist()):
            velocity = np.zeros(len(self._changes))
            while frame != base:
                rate = rates[frame - 1]
                if table.sliding[frame - 1]:
                    velocity = velocity + rate
                else:
                    turned = rate * reaches[number, frame - 1]
                    bends[number] += rate * (2.0 * velocity + turned)
                    velocity = velocity + turned
                frame = int(table.parents[frame - 1])
        return bends

    def written_to(self, pairs: NDArray[np.int32], places: Vector) -> int:
        """Write the answers; see :func:`prove`."""
        pairs[:] = -1
        places[:] = 0.0
        table = self._packed.table
        count = len(self._starts)
        first = np.arange(table.body_pair_count) if self._telling else np.array(table.top_pairs, dtype=np.int64)
        motion = np.repeat(np.arange(count), len(first))
        open_ = Intervals(motion, np.tile(first, count), np.zeros(len(motion)), np.ones(len(motion)))

        for level in range(DEEPEST + 1):
            later, failed = self._compared(open_, level)
            if level == DEEPEST:
                failed = [*failed, later.middles()]
            for each in failed:
                # Of several pairs of a motion, the first one in the order of the table is told.
                fresh = pairs[each.motion] < 0
                motions, rows = np.unique(each.motion[fresh], return_index=True)
                pairs[motions] = each.pair[fresh][rows]
                places[motions] = each.begin[fresh][rows]

            open_ = later.of(pairs[later.motion] < 0).halves()
            if len(open_) == 0:
                break
        return int((pairs >= 0).sum())

    def _compared(self, open_: Intervals, level: int) -> tuple[Intervals, list[Intervals]]:
        """Compare all pairs that are open at a level, and the parts of those that consist of several.

        Returns:
            What stays open for shorter intervals, and places where a pair is not apart.
        """
        later = [open_.of(slice(0, 0))]
        failed = list[Intervals]()
        queue = open_.parts()
        while queue:
            some = queue.pop()
            answers, normals = self._answers(some)
            if self._telling:
                proven = np.flatnonzero(answers == PROVEN)
                self._tell(some.of(proven), level, normals[proven])

            doubtful = some.of(answers == NOT)
            if len(doubtful):
                middles = doubtful.middles()
                hopeless = (self._answers(middles)[0] == NOT) | ~self._moves[middles.motion]
                failed.append(middles.of(hopeless))
                doubtful = doubtful.of(~hopeless)
            later += [doubtful, some.of(answers == LATER)]

            whole = some.of(answers == IN_PARTS)
            if len(whole):
                firsts = self._pairs[whole.pair, layout.PARTS_FIRST]
                counts = self._pairs[whole.pair, layout.PARTS_END] - firsts
                parts = whole.of(np.repeat(np.arange(len(whole)), counts))
                within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
                queue += replace(parts, pair=np.repeat(firsts, counts) + within).parts()
        return joined(later), failed

    def _answers(self, some: Intervals) -> tuple[NDArray[np.int64], Matrix]:
        """Compare pairs on intervals; an answer for each, and the unit normal of the plane that proves it, or zeros."""
        rows = self._pairs[some.pair]
        one = rows[:, layout.PAIR_ONE]
        other = rows[:, layout.PAIR_OTHER]
        kind = self._solids[one, layout.SOLID_KIND]
        other_kind = self._solids[other, layout.SOLID_KIND]
        parts = rows[:, layout.PARTS_END] > rows[:, layout.PARTS_FIRST]
        ends = self._ends(some, rows)

        width = some.end - some.begin
        margins = self._packed.table.margins[some.pair]
        bends = (
            self._bends[rows[:, layout.ONE_SWEEP], some.motion] + self._bends[rows[:, layout.OTHER_SWEEP], some.motion]
        )
        bend = 0.125 * bends * width**2
        wanted = margins + bend

        first = self._bounds.of(one)
        gaps, ways = ball_gaps(first, self._bounds.of(other), ends, rows[:, layout.OTHER_SWEEP] < 0)
        normals = np.zeros((len(some), 3))
        answers = np.where(gaps > wanted, PROVEN, NOT)

        # What consists of several parts is kept together while only the sagitta is in the way.
        patient = parts & (gaps > margins) & (width > PATIENT) & (not self._telling)
        answers = np.where(parts & (answers == NOT), np.where(patient, LATER, IN_PARTS), answers)

        # Single solids are compared by planes, unless the interval is still too long for them.
        known = (kind == CONVEX_SOLID) & (other_kind != UNKNOWN) & (other_kind != WHOLE_BODY)
        alone = (answers == NOT) & known
        hidden = EAGER * (first.radii - first.halves.min(axis=1))  # what planes may gain
        hasty = (width > NARROW) & (bend > BENT * first.radii) & (gaps + hidden <= wanted) & (other_kind != HALF_SPACE)
        answers[alone & hasty] = LATER
        alone &= ~hasty

        for group in (np.flatnonzero(alone & mask) for mask in (other_kind <= HALF_SPACE, other_kind >= CLOUD)):
            if len(group) == 0:
                continue
            own = Ends(*(Poses(pose.rotations[group], pose.origins[group]) for pose in ends))
            if other_kind[group[0]] >= CLOUD:
                apart = self._cloud_apart(one[group], other[group], own, wanted[group])
            else:
                suggested = self._packed.table.ways.reshape(-1, 3)[some.pair[group]]
                ways_tried = np.where((suggested != 0.0).any(axis=1, keepdims=True), suggested, ways[group])
                apart, normals[group] = self._planes(one[group], other[group], own, wanted[group], ways_tried)
            answers[group[apart]] = PROVEN
        return answers, normals

    def _ends(self, some: Intervals, rows: Numbers) -> Ends:
        """Return the poses of the solids of pairs at both ends of intervals."""
        motion = np.concatenate([some.motion, some.motion])
        motions, shares, where = places_of(motion, np.concatenate([some.begin, some.end]))
        begin, end = where.reshape(2, -1)
        frames = self._joints.frames(self._starts[motions] + shares[:, None] * self._changes[motions])
        carried = tuple(self._solids[rows[:, k], layout.SOLID_FRAME] for k in (layout.PAIR_ONE, layout.PAIR_OTHER))
        return seen_from_base(frames, (begin, end), (carried[0], carried[1]), rows[:, layout.PAIR_BASE])

    def _planes(self, one: Numbers, other: Numbers, ends: Ends, wanted: Vector, ways: Matrix) -> tuple[Mask, Matrix]:
        """Search planes that keep solids apart at both ends of intervals; which are found, and their unit normals."""
        apart = np.zeros(len(one), dtype=bool)
        normals = np.zeros((len(one), 3))

        of_half_space = self._solids[other, layout.SOLID_KIND] == HALF_SPACE
        for some in self._batches(one, other, of_half_space):
            first = self._core(one[some], ends.first_begin, ends.first_end, some)
            around = self._sizes[one[some], layout.ROUND]
            if of_half_space[some[0]]:
                axes = self._sizes[other[some], layout.DISC_AXIS : layout.DISC_AXIS + 3]
                low = (first.farthest(-axes) * axes).sum(axis=1)
                gaps = low - self._sizes[other[some], layout.DISC] - around
                normals[some] = axes
            else:
                second = self._core(other[some], ends.second_begin, ends.second_end, some)
                around = around + self._sizes[other[some], layout.ROUND]
                gaps, normals[some] = best_planes(first, second, around, wanted[some], ways[some])
            apart[some] = gaps > wanted[some]
        return apart, normals

    def _batches(self, one: Numbers, other: Numbers, of_half_space: Mask) -> Iterator[Numbers]:
        """Divide pairs of solids into those beside half-spaces and others, and these further, to bound memory.

        Solids of few corners are not compared in arrays that are as wide as those of many.
        """
        spans = self._solids[:, layout.END_BLOCK] - self._solids[:, layout.FIRST_BLOCK]
        widest = np.maximum(spans[one], spans[other])
        classes = np.ceil(np.log2(np.maximum(widest, 1))).astype(np.int64)
        if len(one) * int(widest.max()) * WIDTH <= MOST_CORNERS:
            classes[:] = 0

        groups = 2 * classes + of_half_space
        for group in np.unique(groups).tolist():
            rows = np.flatnonzero(groups == group)
            at_once = max(1, MOST_CORNERS // (WIDTH * int(widest[rows].max())))
            for begin in range(0, len(rows), at_once):
                yield rows[begin : begin + at_once]

    def _core(self, solids: Numbers, begin: Poses, end: Poses, rows: Numbers) -> Core:
        """Return the cores of solids at both ends of intervals, of which ``rows`` are the numbers."""
        records = self._solids[solids]
        sizes = self._sizes[solids]
        first = records[:, layout.FIRST_BLOCK]
        last = records[:, layout.END_BLOCK]
        blocks = np.minimum(first[:, None] + np.arange((last - first).max()), last[:, None] - 1)
        corners = self._corners[blocks].transpose(0, 1, 3, 2).reshape(len(solids), -1, 3)
        turns = np.stack([begin.rotations[rows], end.rotations[rows]], axis=1)
        origins = np.stack([begin.origins[rows], end.origins[rows]], axis=1)
        placed = corners[:, None] @ turns.transpose(0, 1, 3, 2) + origins[:, :, None]
        axes = np.einsum("neij,nj->nei", turns, sizes[:, layout.DISC_AXIS : layout.DISC_AXIS + 3])
        return Core(placed, sizes[:, layout.DISC], axes)

    def _cloud_apart(self, one: Numbers, cloud: Numbers, ends: Ends, wanted: Vector) -> Mask:
        """Check which solids are apart from all balls or cubes of clouds at both ends of intervals.

        A point beyond a face of a box around the solid at both ends has that face between itself and the solid. For
        each of the other points a plane is searched.
        """
        apart = np.ones(len(one), dtype=bool)
        reach = wanted + self._sizes[cloud, layout.ROUND]
        bounds = self._bounds.of(one)
        poses = self._packed.table.cloud_poses.reshape(-1, layout.FRAME_SIZE)
        begin, end = (p.origins + rotated(p.rotations, bounds.centres) for p in (ends.first_begin, ends.first_end))
        radii = 0.5 * lengths_of(end - begin) + bounds.radii + reach

        for number in np.unique(cloud).tolist():
            rows = np.flatnonzero(cloud == number)
            place = self._solids[number, layout.SOLID_KIND] - CLOUD
            turn = poses[place, : layout.ORIGIN].reshape(3, 3)
            origin = poses[place, layout.ORIGIN :]
            cloud_table = self._packed.clouds[place]
            tree = search_tree(cloud_table)
            half = turn * cloud_table.half  # columns are half the edges of a cube
            middles = (0.5 * (begin + end)[rows] - origin) @ turn
            farthest = radii[rows] + np.sqrt(3.0) * cloud_table.half
            near = tree.query_ball_point(middles, (1.0 + SINGLE_ROUNDING) * farthest + SINGLE_ROUNDING)
            counts = np.array([len(found) for found in near])
            points = tree.data[np.concatenate(near).astype(np.int64)] @ turn.T + origin
            owners = np.repeat(rows, counts)
            corners = (BOX_CORNERS if cloud_table.half else BOX_CORNERS[:1]) @ half.T  # of a point there is one

            close = self._in_box(one[owners], ends, owners, points, reach[owners], half)
            owners = owners[close]
            points = points[close]
            for first in range(0, len(owners), AT_ONCE):
                some = owners[first : first + AT_ONCE]
                core = self._core(one[some], ends.first_begin, ends.first_end, some)
                centres = points[first : first + AT_ONCE]
                placed = np.repeat((centres[:, None] + corners)[:, None], 2, axis=1)
                piece = Core(placed, np.zeros(len(some)), np.zeros((len(some), 2, 3)))
                around = self._sizes[one[some], layout.ROUND] + self._sizes[number, layout.ROUND]
                gaps, _ = best_planes(core, piece, around, wanted[some], begin[some] - centres)
                apart[some[gaps <= wanted[some]]] = False
        return apart

    def _in_box(self, one: Numbers, ends: Ends, rows: Numbers, points: Matrix, reach: Vector, half: Matrix) -> Mask:
        """Check which points are within reach of the box around a solid at both ends, along its axes at the begin.

        The points are the centres of cubes of which half the edges are the columns of ``half``, 0 for mere points.
        """
        bounds = self._bounds.of(one)
        axes = ends.first_begin.rotations[rows] @ bounds.axes
        low = np.full((len(rows), 3), np.inf)
        high = -low
        for pose in (ends.first_begin, ends.first_end):
            own = pose.rotations[rows] @ bounds.axes
            middle = rotated(axes.transpose(0, 2, 1), rotated(own, bounds.middles) + pose.origins[rows])
            extent = rotated(np.abs(axes.transpose(0, 2, 1) @ own), bounds.halves)
            low = np.minimum(low, middle - extent)
            high = np.maximum(high, middle + extent)
        along = rotated(axes.transpose(0, 2, 1), points)
        room = reach[:, None] + np.abs(axes.transpose(0, 2, 1) @ half).sum(axis=2)
        inside = (along >= low - room) & (along <= high + room)
        return np.asarray(inside.all(axis=1))

    def _tell(self, some: Intervals, level: int, normals: Matrix) -> None:
        """Write a record for each interval on which a pair is proven apart, as far as there is room."""
        table = self._packed.table
        first = table.log_count
        table.log_count = first + len(some)
        room = max(0, min(len(some), table.log_room - first))
        records = table.log.reshape(-1, layout.LOG_SIZE)[first : first + room]
        numbers = np.rint(some.begin * (1 << level)).astype(np.int64)
        means = np.where(normals.any(axis=1), layout.BY_PLANE, layout.BY_BALL)
        columns = (some.pair, np.full(len(some), level), numbers, means)
        records[:] = np.stack(columns, axis=1)[:room]
        table.log_ways.reshape(-1, 3)[first : first + room] = normals[:room]


@dataclass(frozen=True, slots=True, eq=False)
class Core:
    """The cores of solids at two places: hulls of corners with discs around them.

    Attributes:
        corners: Shape (n, 2, k, 3).
        discs: Radii of the discs [m], shape (n,).
        axes: Their axes at both places, shape (n, 2, 3).
    """

    corners: NDArray[np.float64]
    discs: Vector
    axes: NDArray[np.float64]

    def of(self, rows: Mask) -> Core:
        """Return some of them."""
        return Core(self.corners[rows], self.discs[rows], self.axes[rows])

    def farthest(self, ways: Matrix) -> Matrix:
        """Return the points, at either place, that are farthest along unit vectors, shape (n, 3) each."""
        count, _, width, _ = self.corners.shape
        rows = np.arange(count)
        heights = (self.corners.reshape(count, -1, 3) @ ways[:, :, None])[:, :, 0]
        if not self.discs.any():
            return np.asarray(self.corners.reshape(count, -1, 3)[rows, heights.argmax(axis=1)])

        across = ways[:, None] - (self.axes @ ways[:, :, None]) * self.axes
        sines = np.linalg.norm(across, axis=2)
        heights += np.repeat(self.discs[:, None] * sines, width, axis=1)
        best = heights.argmax(axis=1)
        place = best // width
        outwards = across[rows, place] / np.maximum(sines[rows, place], SHORTEST)[:, None]
        return np.asarray(self.corners.reshape(count, -1, 3)[rows, best] + self.discs[:, None] * outwards)


def best_planes(first: Core, second: Core, around: Vector, wanted: Vector, ways: Matrix) -> tuple[Vector, Matrix]:
    """Search planes with gaps above ``wanted`` between solids at both ends of intervals, by GJK [35].

    The gap of a plane is computed over all corners, so that a poor search costs time but never a wrong proof. See
    :func:`rrtik_ompl.kernels.proof.planes.best_plane`.

    Args:
        first: The solids above the planes.
        second: Those below.
        around: The radii around both [m], shape (n,).
        wanted: Where to end the search [m], shape (n,).
        ways: The first normals to try, not of unit length, shape (n, 3).

    Returns:
        The gaps [m], shape (n,), and the unit normals, shape (n, 3).
    """
    count = len(around)
    best = np.full(count, -np.inf)
    distance = np.full(count, np.inf)
    lengths = np.asarray(lengths_of(ways))[:, None]
    ways = np.where(lengths > SHORTEST, ways / np.maximum(lengths, SHORTEST), [0.0, 0.0, 1.0])
    normals = ways.copy()
    simplex = np.zeros((count, 3, 3))
    rows = np.arange(count)  # those that go on, of which first and second are kept alone

    for step in range(MOST_STEPS):
        way = ways[rows]
        corner = first.farthest(-way) - second.farthest(way)
        along = (corner * way).sum(axis=1)
        gap = along - around[rows]

        better = gap > best[rows]
        best[rows[better]] = gap[better]
        normals[rows[better]] = way[better]
        going = (best[rows] <= wanted[rows]) & (distance[rows] - along >= CONVERGED)
        if not going.all():
            rows = rows[going]
            corner = corner[going]
            first = first.of(going)
            second = second.of(going)
        if len(rows) == 0:
            break

        if step == 0:
            simplex[rows] = corner[:, None]
            nearest = corner
        else:
            nearest = _replaced(simplex, rows, corner)
        distance[rows] = lengths_of(nearest)
        ways[rows] = nearest / np.maximum(distance[rows], SHORTEST)[:, None]

        # Points that are so near to each other leave no room for a plane.
        going = (distance[rows] - around[rows] > wanted[rows]) & (distance[rows] >= SHORTEST)
        if not going.all():
            rows = rows[going]
            first = first.of(going)
            second = second.of(going)
        if len(rows) == 0:
            break
    return best, normals


def _replaced(simplex: NDArray[np.float64], rows: Numbers, corner: Matrix) -> Matrix:
    """Put a corner in the place of one of a triangle's, such that the new triangle is nearest to the origin.

    Returns:
        The points of the triangles that are nearest to the origin, shape (n, 3).
    """
    triangles = np.repeat(simplex[rows, None], 3, axis=1)  # the third one is replaced first, as in the kernels
    for number, place in enumerate((2, 0, 1)):
        triangles[:, number, place] = corner
    found = nearest_on_triangles(triangles.reshape(-1, 3, 3)).reshape(-1, 3, 3)
    chosen = (found**2).sum(axis=2).argmin(axis=1)
    every = np.arange(len(rows))
    simplex[rows] = triangles[every, chosen]
    return np.asarray(found[every, chosen])


def nearest_on_triangles(triangles: NDArray[np.float64]) -> Matrix:
    """Return the points of triangles, shape (n, 3, 3), that are nearest to the origin, shape (n, 3) [36, 5.1.5].

    They are means of the corners with weights that are not negative; corners may coincide.
    """
    # The nearest point of each edge.
    edges = triangles[:, [1, 2, 0]] - triangles
    squares = (edges * edges).sum(axis=2)
    shares = (-(triangles * edges).sum(axis=2) / np.maximum(squares, TINY)).clip(0.0, 1.0)
    on_edges = triangles + shares[:, :, None] * edges
    rows = np.arange(len(triangles))
    nearest = on_edges[rows, (on_edges * on_edges).sum(axis=2).argmin(axis=1)]

    # The foot of the origin on the plane, if it is inside, by its barycentric coordinates.
    d = -(triangles @ edges[:, ::2].transpose(0, 2, 1))  # of each corner, along the edges a to b and c to a
    areas = d[:, [1, 2, 0], 1] * d[:, [2, 0, 1], 0] - d[:, [1, 2, 0], 0] * d[:, [2, 0, 1], 1]
    inside = (areas > 0.0).all(axis=1)
    if inside.any():
        weights = areas[inside] / areas[inside].sum(axis=1)[:, None]
        foot = (weights[:, None] @ triangles[inside])[:, 0]
        closer = (foot * foot).sum(axis=1) < (nearest[inside] ** 2).sum(axis=1)
        nearest[np.flatnonzero(inside)[closer]] = foot[closer]
    return np.asarray(nearest)
