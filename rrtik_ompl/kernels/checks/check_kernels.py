"""Collision checks of configurations and motions in kernels: ``WIDTH`` configurations at a time, one to a SIMD lane.

Configurations are FREE if the outer balls (a cover around every body) meet nothing, COLLIDING if the inner balls
(inside them) do or the narrow phase proves it, UNDECIDED otherwise. The configurations checked along a motion are those
of :class:`rrtik_ompl.World`. Python calls the functions marked ``@entry`` with addresses; other kernels call
:func:`check_part` and :func:`check_edge`.
"""

from __future__ import annotations

from typing import Any

from rrtik_ompl.kernels.checks.kinematics import first_frames, forward_kinematics
from rrtik_ompl.kernels.checks.likely_kernels import likely_collision
from rrtik_ompl.kernels.checks.narrow_phase import compared_neighbours, narrow_phase
from rrtik_ompl.kernels.checks.neighbour_kernels import near_on_way, neighbours_near
from rrtik_ompl.kernels.checks.obstacle_kernels import ALL_LANES, kinds_known
from rrtik_ompl.kernels.checks.self_kernels import self_collision
from rrtik_ompl.kernels.checks.sphere_kernels import prepare, scene_collision
from rrtik_ompl.kernels.checks.watch_kernels import joints_left, watch_motion
from rrtik_ompl.kernels.layout import (
    COLLIDING,
    FREE,
    NO_MARKS,
    NO_WATCH,
    UNDECIDED,
    UNSOUND,
    BallTable,
    JointValues,
    LikelyBall,
    PrimitiveTable,
    Watch,
    WorldTable,
)
from rrtik_ompl.kernels.record import Ints
from rrtik_ompl.kernels.simd.compiled import WIDTH, entry, inlined, kernel
from rrtik_ompl.kernels.simd.lanes import (
    bits,
    double_at,
    int_at,
    lane_numbers,
    larger,
    set_double,
    set_int,
    set_wide_lanes,
    smaller,
)
from rrtik_ompl.kernels.tables.accessors import (
    joint_row,
)

TO_WHOLE = 1.5 * 2.0**52  # added and taken away again it leaves whole numbers


@kernel
def in_collision(
    world: WorldTable,
    balls: BallTable,
    primitives: PrimitiveTable,
    wanted: int,
    likely: LikelyBall,
    one: bool,
    watch: Watch,
    joints: int,
) -> Any:
    """Lanes among ``wanted`` in which these balls meet these primitives or each other; just one lane if ``one``.

    What is watched no more may be carried by other joints than the first ``joints``.
    """
    scratch = world.scratch
    prepare(balls, scratch, joints)
    found = scene_collision(balls, primitives, scratch, wanted, NO_MARKS, one, likely, watch)
    if found == 0:
        return self_collision(balls, scratch, wanted, NO_MARKS, one, watch)
    if found != wanted and not one:
        found |= self_collision(balls, scratch, wanted & ~found, NO_MARKS, one, NO_WATCH)
    return found


@inlined
def outer_collision(world: WorldTable, wanted: int, one: bool, watch: Watch, joints: int) -> Any:
    """Lanes that the outer balls cannot prove free, neighbours that are looked up aside."""
    likely = world.scratch.outer_likely
    return in_collision(world, world.outer_balls, world.outer_primitives, wanted, likely, one, watch, joints)


@inlined
def inner_collision(world: WorldTable, wanted: int, one: bool) -> Any:
    """Lanes that the inner balls prove colliding, for the frames in the scratch memory."""
    likely = world.scratch.inner_likely
    balls = world.inner_balls
    primitives = world.inner_primitives
    joints = world.arm.joint_count
    return in_collision(world, balls, primitives, wanted, likely, one, NO_WATCH, joints)


@kernel
def likely_in_collision(world: WorldTable, wanted: int, inner: bool) -> int:
    """Lanes in which an outer or inner ball that met something lately does so again; 0 says nothing."""
    scratch = world.scratch
    balls = world.outer_balls
    primitives = world.outer_primitives
    likely = scratch.outer_likely

    if inner:
        balls = world.inner_balls
        primitives = world.inner_primitives
        likely = scratch.inner_likely

    return likely_collision(balls, primitives, scratch, wanted, likely)


@inlined
def load_row(world: WorldTable, rows: JointValues, row: int, lane: int) -> None:
    """Set the joint values of a lane to a row of an array of float64."""
    joints = world.arm.joint_count
    values = world.scratch.values
    for joint in range(joints):
        set_double(values, joint * WIDTH + lane, double_at(rows, row * joints + joint))


@inlined
def sound_count(world: WorldTable, count: int) -> int:
    """``count``, or UNSOUND if a table holds a primitive of an unknown kind."""
    return count if kinds_known(world.outer_primitives) and kinds_known(world.inner_primitives) else UNSOUND


@kernel
def resolve_doubtful(world: WorldTable, rows: JointValues, waiting: int, answers: Ints) -> None:
    """Answer what a second check finds for the rows that wait: by their inner balls, then by the narrow phase."""
    queue = world.scratch.waiting
    for lane in range(WIDTH):
        load_row(world, rows, int_at(queue, min(lane, waiting - 1)), lane)
    forward_kinematics(world.arm, world.scratch)
    wanted = ALL_LANES >> (WIDTH - waiting)
    colliding = inner_collision(world, wanted, waiting < 0)
    open_ = 0
    if colliding != wanted:
        open_, overlapping = narrow_phase(world, wanted & ~colliding)
        colliding |= overlapping

    for lane in range(waiting):
        answer = COLLIDING if (colliding >> lane) & 1 else UNDECIDED if (open_ >> lane) & 1 else FREE
        set_int(answers, int_at(queue, lane), answer)


@entry
def classify(world: WorldTable, rows: JointValues, count: int, answers: Ints, resolve: int) -> int:
    """Check ``count`` rows of joint values (float64) at an address; int32 answers go to another.

    Rows that are not proven free wait until there are enough of them to fill all lanes of a second check. Returns
    ``count``, or UNSOUND.
    """
    queue = world.scratch.waiting
    waiting = 0
    joints = world.arm.joint_count
    near = (1 << world.neighbours.count) - 1

    for start in range(0, count, WIDTH):
        filled = min(WIDTH, count - start)
        for lane in range(WIDTH):
            load_row(world, rows, start + min(lane, filled - 1), lane)
        forward_kinematics(world.arm, world.scratch)
        doubtful = outer_collision(world, ALL_LANES >> (WIDTH - filled), filled < 0, NO_WATCH, joints)
        doubtful |= neighbours_near(world.neighbours, near, world.scratch.values, ALL_LANES & ~doubtful)
        for lane in range(filled):
            open_ = (doubtful >> lane) & 1
            set_int(answers, start + lane, open_)
            if open_ and resolve != 0:
                set_int(queue, waiting, start + lane)
                waiting += 1
                if waiting == WIDTH:
                    resolve_doubtful(world, rows, waiting, answers)
                    waiting = 0

    if waiting:
        resolve_doubtful(world, rows, waiting, answers)
    return sound_count(world, count)


@inlined
def place(world: WorldTable, start: JointValues, end: JointValues, share: Any, joints: int) -> None:
    """Frames of the first joints at some shares, in wide lanes, of a motion between two rows of joint values."""
    scratch = world.scratch
    for joint in range(joints):
        value = (1.0 - share) * double_at(start, joint) + share * double_at(end, joint)
        set_wide_lanes(scratch.values, joint, value)
    first_frames(world.arm, scratch, joints)


@inlined
def places_in(number: int, blocks: int, middle: int) -> Any:
    """The configurations of a motion that a block of lanes checks, in wide lanes.

    Those of the first block lie ``blocks`` apart; the others take what is between, neighbours together, so that a few
    primitives are near all lanes.
    """
    if number == 0:
        return lane_numbers() * float(blocks) + float(middle)
    among = lane_numbers() + float((number - 1) * WIDTH)
    between = float(blocks - 1)
    gap = ((among + 0.5) * (1.0 / between) - 0.5 + TO_WHOLE) - TO_WHOLE  # rounded down
    rest = among - gap * between

    return gap * float(blocks) + rest + smaller(larger(rest - float(middle - 1), 0.0), 1.0)


@kernel
def resolved_block(world: WorldTable, doubtful: int, one: bool) -> int:
    """What inner balls and solids say of lanes that outer balls leave in doubt: the worst answer; ``one`` is enough."""
    if inner_collision(world, doubtful, one) != 0:
        return COLLIDING
    open_, overlapping = narrow_phase(world, doubtful)
    if overlapping != 0:
        return COLLIDING
    return UNDECIDED if open_ != 0 else FREE


@kernel
def check_part(
    world: WorldTable, start: JointValues, end: JointValues, last: int, first: int, count: int, resolve: bool
) -> int:
    """Check ``count`` configurations of a motion between two rows of joint values: those at k / last, k = first, ...

    The lanes of the first block are spread over the whole part, so that a collision anywhere shows early; what keeps
    its distance there from all that lies between is watched no more. Without ``resolve`` outer balls and the cells of
    neighbours alone decide.
    """
    scratch = world.scratch
    joints = world.arm.joint_count
    blocks = (count + WIDTH - 1) // WIDTH
    every = bits(lane_numbers() >= 0.0)  # a number: for a constant numba would compile all that is called apart
    answer = FREE
    middle = blocks // 2
    watch = NO_WATCH
    left = joints
    near = 0

    for number in range(blocks):
        places = smaller(places_in(number, blocks, middle), float(count - 1)) + float(first)
        share = places / float(last)
        place(world, start, end, share, left)

        if number == 0:
            if likely_in_collision(world, every, resolve) != 0:
                answer = COLLIDING if resolve else UNDECIDED
                break

            near = near_on_way(world.neighbours, start, end)
            if blocks > 1:
                watch = scratch.watch
                watch_motion(world, start, end, float(middle) / float(last))

        doubtful = outer_collision(world, every, not resolve, watch, left)
        if doubtful != 0 and left < joints:
            place(world, start, end, share, joints)
        if number == 0 and blocks > 1:
            left = joints_left(world)
            if near != 0:
                left = max(left, world.neighbours.joint_count)

        found = FREE
        if doubtful != 0:
            found = resolved_block(world, doubtful, resolve) if resolve else UNDECIDED
        if near != 0 and (found == FREE or (resolve and found != COLLIDING)):
            found = max(found, compared_neighbours(world, near, every & ~doubtful, resolve))
        answer = max(answer, found)
        if left == 0 or found == COLLIDING or (found == UNDECIDED and not resolve):
            break

    return answer


@kernel
def check_edge(world: WorldTable, start: JointValues, end: JointValues, last: int, resolve: bool) -> int:
    """Check the motion between two rows of joint values by its configurations at k / last, k = 0..last."""
    return check_part(world, start, end, last, 0, last + 1, resolve)


@entry
def classify_edges(
    world: WorldTable,
    starts: JointValues,
    ends: JointValues,
    steps: Ints,
    count: int,
    answers: Ints,
    resolve: int,
) -> int:
    """Check ``count`` motions between rows of two arrays in the given numbers of steps; int32 answers.

    Returns ``count``, or UNSOUND.
    """
    joints = world.arm.joint_count
    for k in range(count):
        start = joint_row(starts, joints, k)
        end = joint_row(ends, joints, k)
        set_int(answers, k, check_edge(world, start, end, int_at(steps, k), resolve != 0))

    return sound_count(world, count)


@entry
def mark_pairs(world: WorldTable, row: JointValues, count: int) -> int:
    """For up to ``WIDTH`` rows of joint values: in which of them a pair is not proven free, as bits; see ``mark``.

    Returns the number of marks, or UNSOUND.
    """
    scratch = world.scratch
    wanted = ALL_LANES >> (WIDTH - count)
    for lane in range(WIDTH):
        load_row(world, row, min(lane, count - 1), lane)
    forward_kinematics(world.arm, scratch)
    narrow_phase(world, wanted)
    balls = world.outer_balls
    crossing = balls.body_count * world.outer_primitives.standing_count

    return sound_count(world, crossing + balls.pair_count)
