"""Regions held along paths: what they mean, that the bound on motions is one, and what is refused."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from bench.truth.scenes import tolerances
from rrtik_ompl.base.errors import InputError, ProblemError, UnknownNameError
from rrtik_ompl.base.poses import rotation_angles
from rrtik_ompl.constraints.held_region import Turning
from rrtik_ompl.constraints.held_regions import held_regions
from rrtik_ompl.constraints.residuals import projected_rows, residual
from rrtik_ompl.model.scene import AttachedObject, Scene

START = np.array([0.3, -1.2, 1.4, -0.4, 0.6, 0.2])


@pytest.fixture(scope="module")
def ur5():
    return rrtik.load_robot("ur5_limited")


def regions_of(robot, q):
    """One region of each kind, all of which a configuration is in."""
    T = robot.fk(q)
    return {
        "axis": rrtik.constraints.upright(robot, "y", tolerance_deg=4.0),
        "ball": rrtik.constraints.orientation_of(T, 3.0),
        "ranges": rrtik.constraints.orientation_of(T, [5.0, 10.0, 30.0]),
        "plane": rrtik.constraints.on_plane(T.translation, [0.0, 0.6, 0.8]),
        "line": rrtik.constraints.on_line(T.translation, [0.0, 1.0, 0.0], tolerance=0.002),
        "box": rrtik.constraints.inside(T, [0.2, 0.1, 0.3]),
    }


def prepared(robot, q, name):
    return held_regions(robot, Scene(), [regions_of(robot, q)[name]], q)


KINDS = ("axis", "ball", "ranges", "plane", "line", "box")


def tilt(robot, Q, direction, axis=2):
    """Angle of an axis of the tip from a direction, by forward kinematics alone."""
    return np.arccos(np.clip(robot.fk_batch(Q)[:, :3, axis] @ direction, -1.0, 1.0))


def test_upright_keeps_the_direction_of_the_start_and_leaves_the_turn_about_it_free(ur5):
    held = held_regions(ur5, Scene(), [rrtik.constraints.upright(ur5, tolerance_deg=5.0)], START)
    rng = np.random.default_rng(1)
    Q = np.vstack([START + rng.normal(0.0, 0.06, (300, 6)), START + np.outer([1.0, 2.5], np.eye(6)[5])])
    angles = tilt(ur5, Q, ur5.fk(START).rotation[:, 2])
    np.testing.assert_array_equal(held.held(Q), angles <= np.radians(5.0))
    assert held.held(Q)[-2:].all()
    assert 30 < held.held(Q).sum() < 270


def test_a_cup_that_starts_upside_down_stays_so(ur5):
    other = np.array(START)
    region = rrtik.constraints.upright(ur5)
    down = region.started_at(ur5.fk(other) * pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.0, 0.0), np.zeros(3)))
    up = region.started_at(ur5.fk(other))
    np.testing.assert_allclose(down.T_world_w.rotation[:, 2], -up.T_world_w.rotation[:, 2], atol=1e-12)


def test_a_world_without_a_path_refuses_what_begins_where_a_path_does(ur5):
    region = rrtik.constraints.upright(ur5, tolerance_deg=5.0)
    with pytest.raises(InputError, match=r"path constraint 1 begins where a path does .*give it to a Problem"):
        rrtik.World(ur5, constraints=[region])
    placed = rrtik.World(ur5, constraints=[region.started_at(ur5.fk(START))])
    assert placed.constraints.held(START[None]).all()
    problem = rrtik.Problem(rrtik.World(ur5), START, START, constraints=[region])
    assert not any(each.from_start for each in problem.world.settings.constraints)


@pytest.mark.parametrize("kind", KINDS)
def test_projected_configurations_are_in_the_region_by_the_errors_of_task_regions(ur5, kind):
    held = prepared(ur5, START, kind)
    Q = START + np.random.default_rng(2).normal(0.0, 0.3, (60, 6))
    rows, there = projected_rows(ur5, held, Q)
    assert there.mean() > 0.9
    assert held.held(rows[there]).all()
    region = held.regions[0].region
    assert region.satisfied(ur5, rows[there]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_bound_on_motions_holds_at_every_place(ur5, kind):
    region = prepared(ur5, START, kind).regions[0]
    rng, shares = np.random.default_rng(3), np.linspace(0.0, 1.0, 51)[:, None]
    for size in (0.02, 0.08, 0.2):
        near = START + rng.normal(0.0, 0.02, (40, 6))
        for a, b in zip(near, near + rng.normal(0.0, size, (40, 6)), strict=True):
            measures = region.measures((1.0 - shares) * a + shares * b)
            allowed = measures[[0, -1]].max(axis=0) + region.deviations(a[None], b[None])[0]
            assert (measures.max(axis=0) <= allowed + 1e-12).all()


def allowing(held, position, orientation):
    """The same regions, of which motions between waypoints may leave more."""
    parts = [
        replace(each.region, position_allowance=position, orientation_allowance=orientation) for each in held.regions
    ]
    return held_regions(held.regions[0].robot, Scene(), parts, None)


@pytest.mark.parametrize(("position", "orientation"), [(0.0, 0.0), (5e-4, np.radians(0.2))])
@pytest.mark.parametrize("kind", KINDS)
def test_motions_that_are_held_keep_the_tolerance_in_between_unless_more_was_asked_for(
    ur5, kind, position, orientation
):
    held = allowing(prepared(ur5, START, kind), position, orientation)
    task, rng, shares = held.regions[0].region, np.random.default_rng(4), np.linspace(0.0, 1.0, 101)[:, None]
    rows, there = projected_rows(ur5, held, START + rng.normal(0.0, 0.1, (120, 6)))
    rows = rows[there]
    seen = held.motions_held(rows[:-1], rows[1:])
    kept = np.flatnonzero(seen)
    assert len(kept) > 0
    for k in kept[:25]:
        away, angle = task.errors(ur5, (1.0 - shares) * rows[k] + shares * rows[k + 1])
        assert away.max() <= task.position_tolerance + position + 1e-9
        assert angle.max() <= task.orientation_tolerance + orientation + 1e-6


def test_the_way_into_a_region_is_the_derivative_of_the_displacement(ur5):
    """By differences of poses: J times a small change of the joints is the twist that it makes."""
    held = prepared(ur5, START, "ball")
    region, Q = held.regions[0], START + np.random.default_rng(5).normal(0.0, 0.3, (20, 6))
    _, J = residual(ur5, region, Q)
    step = np.random.default_rng(6).normal(0.0, 1e-6, (20, 6))
    before, after = region.displacements(Q), region.displacements(Q + step)
    turned = after[:, :3, :3] @ np.swapaxes(before[:, :3, :3], 1, 2)
    made = np.einsum("mkn,mn->mk", J[:, 3:], step) / 0.5
    np.testing.assert_allclose(np.linalg.norm(made, axis=1), rotation_angles(turned), rtol=1e-4)


def test_several_regions_hold_all_at_once(ur5):
    T = ur5.fk(START)
    both = [rrtik.constraints.upright(ur5), rrtik.constraints.on_plane(T.translation, [0.0, 0.0, 1.0])]
    held = held_regions(ur5, Scene(), both, START)
    rows, there = projected_rows(ur5, held, START + np.random.default_rng(7).normal(0.0, 0.4, (40, 6)))
    tips = ur5.fk_batch(rows[there])
    assert np.abs(tips[:, 2, 3] - T.translation[2]).max() <= 1e-3
    assert tilt(ur5, rows[there], T.rotation[:, 2]).max() <= np.radians(5.0)


def test_an_attached_object_may_carry_the_frame(ur5):
    cup = AttachedObject("cup", ur5.tip, rrtik.Cylinder(0.03, 0.1), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.1])))
    scene = Scene(attached=[cup])
    point = (ur5.fk(START) * cup.pose).translation
    held = held_regions(ur5, scene, [rrtik.constraints.on_plane(point, [0.0, 0.0, 1.0], frame="cup")], START)
    turned = START + 0.1
    away = (ur5.fk(turned) * cup.pose).translation[2] - point[2]
    assert held.regions[0].measures(turned[None])[0, 0] == pytest.approx(abs(away))


@pytest.mark.parametrize(
    ("kind", "turning"),
    [("axis", Turning.AXIS), ("ball", Turning.BALL), ("ranges", Turning.RANGES), ("plane", Turning.FREE)],
)
def test_what_bounds_say_of_the_orientation_is_seen(ur5, kind, turning):
    assert prepared(ur5, START, kind).regions[0].turning == turning


@pytest.mark.parametrize("free", range(3))
def test_any_angle_may_be_the_free_one(ur5, free):
    bounds = np.outer([1000.0] * 3 + [0.0] * 3, [-1.0, 1.0])
    bounds[3:] += np.array([[0.3], [-0.4], [0.5]])
    bounds[3 + free] = -np.pi, np.pi
    task = rrtik.TaskRegion(ur5.fk(START), bounds, orientation_tolerance=0.1)
    held = held_regions(ur5, Scene(), [task], START)
    rows, there = projected_rows(ur5, held, START + np.random.default_rng(8).normal(0.0, 0.5, (30, 6)))
    assert there.mean() > 0.8
    assert task.satisfied(ur5, rows[there]).all()


# --- problems ------------------------------------------------------------------------------------------------------


def test_a_start_or_goal_outside_is_refused_by_name_and_amount(ur5):
    world, T = rrtik.World(ur5), ur5.fk(START)
    level = rrtik.constraints.on_plane(T.translation - [0.0, 0.0, 0.05], [0.0, 0.0, 1.0])
    with pytest.raises(ProblemError, match=r"start.*constraint 1.*tool0.*49 mm"):
        rrtik.Problem(world, START, START, constraints=[level])
    goal = START + 0.3 * np.eye(6)[3]
    amount = np.degrees(tilt(ur5, goal[None], T.rotation[:, 2])[0]) - 5.0
    with pytest.raises(ProblemError, match=rf"goal.*constraint 2.*{amount:.3g} degrees"):
        rrtik.Problem(
            world, START, goal, constraints=[rrtik.constraints.inside(T, [9, 9, 9]), rrtik.constraints.upright(ur5)]
        )


def test_constraints_that_contradict_each_other_or_are_out_of_reach_are_named(ur5):
    world, T = rrtik.World(ur5), ur5.fk(START)
    low, high = (rrtik.constraints.on_plane(T.act(np.array([0.0, 0.0, z])), T.rotation[:, 2]) for z in (0.0, 0.3))
    with pytest.raises(ProblemError, match=r"constraint 2.*constraint 3.*29\d mm"):
        rrtik.Problem(world, START, START, constraints=[rrtik.constraints.upright(ur5), low, high])
    far = rrtik.constraints.on_plane([0.0, 0.0, 5.0], [0.0, 0.0, 1.0])
    with pytest.raises(ProblemError, match=r"constraint 1.*region"):
        rrtik.Problem(world, START, START, constraints=[far])


def test_what_makes_no_sense_is_refused_in_a_line(ur5):
    world, T = rrtik.World(ur5), ur5.fk(START)
    with pytest.raises(InputError, match=r"path constraints.*list.*TaskRegion"):
        rrtik.Problem(world, START, START, constraints=rrtik.constraints.upright(ur5))
    with pytest.raises(UnknownNameError, match="frame of path constraint 1"):
        rrtik.Problem(world, START, START, constraints=[rrtik.constraints.upright(ur5, frame="mug")])
    with pytest.raises(InputError, match=r"constraint 1.*TaskRegion.*str"):
        rrtik.Problem(world, START, START, constraints=["upright"])
    with pytest.raises(InputError, match="pitch may reach 80"):
        rrtik.Problem(world, START, START, constraints=[rrtik.constraints.orientation_of(T, [10.0, 80.0, 10.0])])
    with pytest.raises(InputError, match=r"frame, from_start.*path constraints"):
        rrtik.Problem(world, START, rrtik.constraints.upright(ur5))
    with pytest.raises(InputError, match="axis must be x, y or z"):
        rrtik.constraints.upright(ur5, "w")
    with pytest.raises(InputError, match="normal must have length 1"):
        rrtik.constraints.on_plane([0, 0, 0], [0, 0, 2])
    with pytest.raises(InputError, match=r"tolerance_deg.*80"):
        rrtik.constraints.upright(ur5, tolerance_deg=90.0)


def test_the_world_of_a_problem_obeys_in_checks_proofs_and_violations(ur5):
    goal = START + 0.8 * np.eye(6)[0]
    free = rrtik.Problem(rrtik.World(ur5), START, goal)
    held = rrtik.Problem(
        rrtik.World(ur5), START, goal, constraints=[rrtik.constraints.on_line(*line_of(ur5, START, goal))]
    )
    path = rrtik.JointPath.of(ur5, np.stack([START, goal]))  # the tip goes along an arc
    assert path.violations(free.world) == ()
    assert path.proved(free.world).proven
    assert "leaves the region of 'tool0' in between" in path.violations(held.world)[0].reason
    proved = path.proved(held.world)
    assert not proved.proven
    assert "leaves the region" in str(proved.proof.unproven[0])
    assert not held.world.motion_valid(START, goal)
    assert path.proved(free.world).proven_in(free.world)
    assert not path.proved(free.world).proven_in(held.world)


def line_of(robot, a, b):
    """A point and the direction of the line between the tips of two configurations."""
    first, second = (robot.fk(q).translation for q in (a, b))
    return first, (second - first) / np.linalg.norm(second - first)


def test_an_angle_that_cannot_be_held_is_refused_in_a_line():
    robot = rrtik.load_robot("ur5")
    bounds = np.outer([1000.0] * 3 + [0.0] * 3, [-1.0, 1.0])
    wide = rrtik.TaskRegion(robot.fk(np.zeros(6)), bounds, orientation_tolerance=np.radians(120.0))
    with pytest.raises(InputError, match=r"constraint 1.*orientation_tolerance.*120.*90"):
        rrtik.Problem(rrtik.World(robot), np.zeros(6), np.full(6, 0.1), constraints=[wide])


def off_the_line(robot, rows, point, direction):
    """The largest distance of the tip from a line on the motions between waypoints, by Pinocchio alone."""
    data, frame, worst = robot.model.createData(), robot.model.getFrameId(robot.tip), 0.0
    shares = np.linspace(0.0, 1.0, 41)[:, None]
    for a, b in pairwise(rows):
        for q in robot.pinocchio_configuration((1.0 - shares) * a + shares * b):
            pin.forwardKinematics(robot.model, data, q)
            tip = pin.updateFramePlacement(robot.model, data, frame).translation
            worst = max(worst, float(np.linalg.norm(np.cross(tip - point, direction))))
    return worst


@pytest.mark.kernels
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6])
def test_a_proven_path_is_within_the_stated_tolerance_between_its_waypoints_too(tolerance):
    robot = rrtik.load_robot("panda")
    start = np.array([0.1, -0.5, 0.1, -2.0, 0.1, 1.6, 0.6])
    point, direction = robot.fk(start).translation, np.array([0.0, 1.0, 0.0])
    line = rrtik.constraints.on_line(point, direction, tolerance=tolerance)
    goal = rrtik.PositionGoal(point + 0.25 * direction, tolerance=1e-3)
    plan = rrtik.plan(rrtik.Problem(rrtik.World(robot), start, goal, constraints=[line]), seed=1)
    assert plan.found, plan.reason
    assert plan.proven
    assert off_the_line(robot, plan.path.waypoints, point, direction) <= tolerance + 1e-9


def test_more_between_waypoints_is_a_matter_of_words(ur5):
    T = ur5.fk(START)
    assert all(not region.position_allowance for region in regions_of(ur5, START).values())
    wide = rrtik.constraints.on_line(T.translation, [0, 1, 0], tolerance=1e-9, allowance=5e-4)
    assert wide.position_allowance == 5e-4
    assert rrtik.constraints.upright(ur5, allowance_deg=0.2).orientation_allowance == np.radians(0.2)
    with pytest.raises(InputError, match=r"position_allowance.*negative"):
        rrtik.constraints.on_plane([0, 0, 0], [0, 0, 1], allowance=-1e-3)
    with pytest.raises(InputError, match=r"allowances.*constraints"):
        rrtik.Problem(rrtik.World(ur5), START, wide)


def test_a_tolerance_too_small_for_any_motion_is_refused_with_the_least_that_can_be_kept(ur5):
    world, T = rrtik.World(ur5), ur5.fk(START)
    with pytest.raises(InputError, match=r"constraint 1.* (\d\.\de-08) m") as caught:
        rrtik.Problem(
            world, START, START, constraints=[rrtik.constraints.on_line(T.translation, [0, 1, 0], tolerance=1e-12)]
        )
    least = float(str(caught.value).split(" m is the least")[0].split()[-1])
    rrtik.Problem(
        world, START, START, constraints=[rrtik.constraints.on_line(T.translation, [0, 1, 0], tolerance=1.1 * least)]
    )
    with pytest.raises(InputError, match="degrees is the least that can"):
        rrtik.Problem(world, START, START, constraints=[rrtik.constraints.orientation_of(T, 1e-9)])


def test_three_angles_are_the_largest_and_no_more(ur5):
    T, angles = ur5.fk(START), np.radians([5.0, 10.0, 30.0])
    held = held_regions(ur5, Scene(), [rrtik.constraints.orientation_of(T, [5.0, 10.0, 30.0])], START)
    rows = START + np.random.default_rng(9).normal(0.0, 0.1, (2000, 6))
    turned = np.array([np.abs(pin.rpy.matrixToRpy(T.rotation.T @ ur5.fk(q).rotation)) for q in rows])
    inside = held.held(rows)
    assert inside.sum() > 200
    assert (turned[inside] <= angles).all()
    assert inside[(turned < 0.8 * angles).all(axis=1)].all()


def test_a_motion_may_begin_at_the_very_rim_of_a_region(ur5):
    T = ur5.fk(START)
    rim = rrtik.constraints.on_plane(T.translation - [0.0, 0.0, 1e-3], [0.0, 0.0, 1.0], tolerance=1e-3)
    held = held_regions(ur5, Scene(), [rim], START)
    down = START - 1e-3 * ur5.fk_jacobian_batch(START[None], ur5.tip)[1][0, 2]
    assert held.motions_held(START[None], down[None]).all()
    assert not held.motions_held(START[None], (2.0 * START - down)[None]).any()


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("name", "kind", "share"),
    [
        ("panda", "line", 0.01),
        ("ur5_limited", "plane", 0.05),
        ("titan4", "upright", 0.02),
        ("panda", "orientation", 1.0),
    ],
)
def test_generated_paths_keep_small_tolerances_on_whole_motions_by_pinocchio(name, kind, share):
    seen = tolerances(name, kind, 0, 2, share)
    assert seen.found > 0
    assert seen.proven == seen.found
    assert seen.metres <= 1e-9
    assert seen.degrees <= 1e-9


def test_a_motion_does_not_pass_what_a_range_leaves_out_of_a_turn():
    """Both ends are in the range of yaw, on both sides of what it leaves out at half a turn."""
    robot = rrtik.load_robot("planar3")
    bounds = np.outer([1000.0] * 3 + [np.pi, 0.1, np.pi - 0.04], [-1.0, 1.0])
    held = held_regions(robot, rrtik.Scene(), [rrtik.TaskRegion(np.zeros(3), bounds, orientation_tolerance=0.01)], None)
    step = np.array([[0.014, 0.014, 0.014]])
    across = np.full((1, 3), np.pi / 3.0)
    assert held.held(np.concatenate([across - step, across + step])).all()
    assert not held.held(across).any()
    assert not held.motions_held(across - step, across + step).any()
    assert held.motions_held(across - step, across - 40.0 * step).all()
    narrow = rrtik.TaskRegion(np.zeros(3), bounds, orientation_tolerance=0.041)
    with pytest.raises(InputError, match="leave the angle free"):
        held_regions(robot, rrtik.Scene(), [narrow], None)
