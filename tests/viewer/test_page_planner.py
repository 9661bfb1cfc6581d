"""A page that plans: its answers in node are those of Python, its saved files those that the commands take."""

import json
import subprocess
from dataclasses import replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest

import rrtik_ompl as rrtik
from rrtik_ompl.base.arrays import Matrix
from rrtik_ompl.kernels.layout import FREE
from rrtik_ompl.kernels.record import holds_table
from rrtik_ompl.kernels.search.connect import ConnectSearch
from rrtik_ompl.kernels.search.crdt.rules import CrdtRules
from rrtik_ompl.kernels.search.crdt.search import CrdtSearch
from rrtik_ompl.kernels.search.motions.motion_table import step_counts
from rrtik_ompl.model.scene import Scene
from rrtik_ompl.planning.generated_problems import generated_problem
from rrtik_ompl.planning.moves.axis_cut import double_axis_cut
from rrtik_ompl.viewer.page import page
from rrtik_ompl.viewer.page_planner import LAYOUTS, SAMPLES, TABLES, VERTICES, layout_numbers, page_planner
from rrtik_ompl.world.clearances import Clearances, clearances_between, search_form
from rrtik_ompl.world.problem import Problem, densely_checked
from rrtik_tests.browser import Browser, planning_page
from rrtik_tests.programs import needs_chromium, node

pytestmark = pytest.mark.kernels
ASSETS = files("rrtik_ompl.viewer").joinpath("assets")
RUN = """
const fs = require("fs");
const read = (name) => fs.readFileSync(`${process.argv[2]}/${name}`, "utf8");
const source = ["unpack.js", "kernels.js", "obstacles.js", "fixed.js", "moves.js", "shapes.js"].map(read).join("");
const shown = "{ Kernels, placeObstacle, hasKernels, searchMoves, fewerMoves, resized }";
const parts = new Function(`${source}; return ${shown}`)();
const { Kernels, placeObstacle, hasKernels, searchMoves, fewerMoves, resized } = parts;
const result = (work) => {
  let step = work.next();
  while (!step.done) step = work.next();
  return step.value;
};
(async () => {
  const { plan, seeds, moves, poses } = JSON.parse(fs.readFileSync(0, "utf8"));
  const kernels = await Kernels.load(plan);
  const paths = seeds.map((seed) => result(kernels.searchPath(plan.start, plan.goal, seed)));
  const short = paths.map((path, k) => (path === null ? null : [...kernels.shortened(path, seeds[k])].pop()));
  const moved = seeds.map((seed) => result(searchMoves(kernels, plan.start, plan.goal, seed)));
  const fewer = moved.map((path) => (path === null ? null : result(fewerMoves(kernels, path))));
  const reached = poses.map(({ pose, from }) => kernels.reach(pose, from));
  const free = moves.map(({ obstacle, pose, sizes, Q }) => {
    placeObstacle(kernels, sizes ? resized(plan.obstacles[obstacle], sizes) : plan.obstacles[obstacle], pose);
    return Q.map((q) => kernels.free(q));
  });
  console.log(JSON.stringify({ has: hasKernels(), paths, short, moved, fewer, reached, free }));
})();
"""


def in_node(plan, tmp_path, **work):
    script = tmp_path / "run.js"
    script.write_text(RUN, encoding="utf-8")
    given = json.dumps({"plan": plan, "seeds": [], "moves": [], "poses": [], **work})
    done = subprocess.run([node(), script, str(ASSETS)], input=given, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def searched_world(problem: Problem) -> rrtik.World:
    clearances = clearances_between(problem.world, np.stack([problem.start, problem.goal.q]), None) or Clearances(
        0.0, 0.0
    )
    return search_form(densely_checked(problem).world, clearances)


def refused(A: Matrix, B: Matrix) -> np.ndarray:
    return np.zeros(len(A), dtype=bool)


def proven(world: rrtik.World, A: Matrix, B: Matrix) -> np.ndarray:
    """Which motions the kernels prove free."""
    values, steps = world.robot.joint_values, step_counts(A, B, world.weights, world.motion_resolution)
    return world.fast.classify_edges(values(A), values(B), steps) == FREE


PROBLEMS = {
    "titan4": lambda: rrtik.load_problem("titan4_sdu"),
    "panda": lambda: generated_problem(rrtik.load_robot("panda"), "pipes", 1),
    "ur5": lambda: generated_problem(rrtik.load_robot("ur5"), "clutter", 0),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_searches_in_the_page_find_pythons_paths(name, tmp_path):
    """Equal but for the last digit or two: this machine may round a product and a sum at once, WebAssembly does not."""
    problem, seeds = PROBLEMS[name](), [1, 2, 3]
    plan = page_planner(problem, problem.goal.q, 0.1)
    found = in_node(plan, tmp_path, seeds=seeds)
    world = searched_world(problem)
    search = ConnectSearch(world.motions, *problem.robot.finite_range(), vertices=VERTICES, patience=0)
    for seed, path, short in zip(seeds, found["paths"], found["short"], strict=True):
        wanted = search.solve(problem.start[None], problem.goal.q[None], seed, ask=refused, max_iterations=SAMPLES)
        np.testing.assert_allclose(path, wanted, rtol=0.0, atol=1e-12)
        shortened = rrtik.JointPath.of(problem.robot, np.array(short))
        assert shortened.violations(problem.world) == ()
        assert shortened.length <= rrtik.JointPath.of(problem.robot, wanted).length + 1e-9
        assert (shortened.start == problem.start).all()
        assert (shortened.end == problem.goal.q).all()


@pytest.mark.parametrize("name", PROBLEMS)
def test_searches_of_single_joint_moves_find_pythons_paths(name, tmp_path):
    problem, seeds = PROBLEMS[name](), [1, 2, 3]
    found = in_node(page_planner(problem, problem.goal.q, 0.1), tmp_path, seeds=seeds)
    world = searched_world(problem)
    same, none = np.ones(problem.robot.dof), np.zeros(problem.robot.dof)
    refusing = SimpleNamespace(motions=world.motions, robot=problem.robot, motion_valid_batch=refused)
    rules = CrdtRules(*problem.robot.finite_range(), same, none, same)
    for seed, path, fewer in zip(seeds, found["moved"], found["fewer"], strict=True):
        search = CrdtSearch(refusing, rules, seed, SAMPLES, problem.start[None], problem.goal.q[None])
        assert search.advance(lambda: False)
        one, two = search.meeting()
        np.testing.assert_array_equal(path, np.vstack([one, two[-2::-1]]))
        cut = double_axis_cut(path, partial(proven, world))
        np.testing.assert_array_equal(fewer, cut)
        assert rrtik.JointPath.of(problem.robot, np.array(fewer)).one_joint_at_a_time


@pytest.mark.parametrize("name", PROBLEMS)
def test_moved_obstacles_are_packed_as_python_packs_them(name, tmp_path):
    problem, rng = PROBLEMS[name](), np.random.default_rng(3)
    plan = page_planner(problem, problem.goal.q, 0.1)
    clearances = clearances_between(problem.world, np.stack([problem.start, problem.goal.q]), None)
    named = {each["name"]: k for k, each in enumerate(plan["obstacles"])}
    scene, moves, wanted = problem.world.scene, [], []
    lower, upper = problem.robot.finite_range()
    for _ in range(8):
        chosen = scene.obstacles[int(rng.integers(len(scene.obstacles)))]
        placed = pin.SE3(pin.exp3(rng.normal(size=3)), np.array(chosen.pose.translation) + rng.normal(0.0, 0.2, 3))
        Q = rng.uniform(lower, upper, (150, problem.robot.dof))
        kept = tuple(replace(each, pose=placed) if each is chosen else each for each in scene.obstacles)
        scene = Scene(kept, scene.attached, scene.allowed_collisions)
        world = rrtik.World(problem.robot, scene).with_clearance(clearances.searched_clearance)
        wanted.append(world.fast.classify(problem.robot.joint_values(Q)) == FREE)
        moves.append({"obstacle": named[chosen.name], "pose": placed.homogeneous.ravel().tolist(), "Q": Q.tolist()})
    assert 0 < np.mean(wanted) < 1
    np.testing.assert_array_equal(in_node(plan, tmp_path, moves=moves)["free"], wanted)


def test_every_kind_of_obstacle_is_packed_alike_wherever_and_however_large(tmp_path):
    robot, rng = rrtik.load_robot("ur5"), np.random.default_rng(4)
    solids = {
        "ball": rrtik.Sphere(0.15),
        "capsule": rrtik.Capsule(0.06, 0.5),
        "can": rrtik.Cylinder(0.1, 0.4),
        "box": rrtik.Box([0.3, 0.2, 0.1]),
    }
    resized = {
        "ball": (rrtik.Sphere(0.25), [0.25]),
        "capsule": (rrtik.Capsule(0.1, 0.3), [0.1, 0.3]),
        "can": (rrtik.Cylinder(0.2, 0.15), [0.2, 0.15]),
        "box": (rrtik.Box([0.1, 0.35, 0.4]), [0.1, 0.35, 0.4]),
    }
    far = pin.SE3(np.eye(3), np.array([2.0, 2.0, 0.0]))
    scene = Scene(tuple(rrtik.Obstacle(name, solid, far, margin=0.01) for name, solid in solids.items()))
    ends = np.zeros(6), np.full(6, -0.5)
    problem = Problem(rrtik.World(robot, scene), *ends)
    plan = page_planner(problem, problem.goal.q, 0.1)
    clearances = clearances_between(problem.world, np.stack(ends), None)
    moves, wanted = [], []
    for k, each in enumerate(plan["obstacles"][: len(solids)]):
        for solid, sizes in ((solids[each["name"]], None), resized[each["name"]]):
            placed = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.3, 3))
            Q = rng.uniform(-3.0, 3.0, (200, 6))
            scene = scene.without(each["name"]).with_(rrtik.Obstacle(each["name"], solid, placed, margin=0.01))
            world = rrtik.World(robot, scene).with_clearance(clearances.searched_clearance)
            wanted.append(world.fast.classify(robot.joint_values(Q)) == FREE)
            moves.append({"obstacle": k, "pose": placed.homogeneous.ravel().tolist(), "sizes": sizes, "Q": Q.tolist()})
    assert all(0.05 < share.mean() < 0.95 for share in wanted)
    np.testing.assert_array_equal(in_node(plan, tmp_path, moves=moves)["free"], wanted)


@pytest.mark.parametrize("name", ["kinova", "titan4", "xarm7", "z1", "baxter_left"])
def test_what_touches_the_base_leaves_nothing_free(name, tmp_path):
    robot, rng = rrtik.load_robot(name), np.random.default_rng(5)
    start = next(q for q in rng.uniform(*robot.finite_range(), (100, robot.dof)) if rrtik.World(robot).valid(q))
    solids = {"ball": rrtik.Sphere(0.05), "can": rrtik.Cylinder(0.04, 0.1), "box": rrtik.Box([0.1, 0.06, 0.1])}
    far = pin.SE3(np.eye(3), np.array([2.0, 2.0, 2.0]))
    problem = Problem(
        rrtik.World(robot, Scene(tuple(rrtik.Obstacle(k, v, far) for k, v in solids.items()))), start, start
    )
    plan = page_planner(problem, start, 0.1)
    clearances = clearances_between(problem.world, np.stack([start, start]), None) or Clearances(0.0, 0.0)
    Q, moves, wanted = rng.uniform(*robot.finite_range(), (60, robot.dof)), [], []
    for _ in range(40):
        k = int(rng.integers(3))
        placed = pin.SE3(pin.exp3(rng.normal(size=3)), rng.normal(0.0, 0.12, 3))
        scene = Scene(tuple(rrtik.Obstacle(n, v, placed if n == [*solids][k] else far) for n, v in solids.items()))
        fast = search_form(densely_checked(problem.with_world(rrtik.World(robot, scene))).world, clearances).fast
        wanted.append(np.zeros(len(Q), bool) if fast is None else fast.classify(robot.joint_values(Q)) == FREE)
        moves.append({"obstacle": k, "pose": placed.homogeneous.ravel().tolist(), "Q": Q.tolist()})
        moves.append({"obstacle": k, "pose": far.homogeneous.ravel().tolist(), "Q": []})
    assert 4 < sum(not free.any() for free in wanted) < 40  # by coal, where the obstacle touches what stands still
    np.testing.assert_array_equal(in_node(plan, tmp_path, moves=moves)["free"][::2], wanted)


def test_a_pose_is_reached_within_its_tolerances(tmp_path):
    problem, rng = rrtik.load_problem("titan4_sdu"), np.random.default_rng(2)
    robot = problem.robot
    starts = rng.uniform(robot.lower, robot.upper, (30, robot.dof))
    tips = robot.fk_batch(np.clip(starts + rng.normal(0.0, 0.05, starts.shape), robot.lower, robot.upper))
    poses = [
        {"pose": [*tip[:3, :3].ravel(), *tip[:3, 3]], "from": q.tolist()} for tip, q in zip(tips, starts, strict=True)
    ]
    found = in_node(page_planner(problem, problem.goal.q, 0.1), tmp_path, poses=poses)["reached"]
    reached = robot.fk_batch(np.array(found))
    assert np.abs(reached - tips).max() < 2e-5
    assert (np.array(found) >= robot.lower).all()
    assert (np.array(found) <= robot.upper).all()


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_name_means_one_number_of_a_layout(name):
    numbers = layout_numbers()[name]
    module = LAYOUTS[name]
    constants = {key: value for key, value in vars(module).items() if key.isupper() and type(value) is int}
    assert constants.items() <= numbers.items()

    own = [table for table in vars(module).values() if holds_table(table) and table.__module__ == module.__name__]
    if not set(own) & set(TABLES.values()):
        for table in own:
            assert {field.upper(): place for field, place in table.places.items()}.items() <= numbers.items()


def test_what_cannot_plan_is_a_still_page():
    problem = rrtik.load_problem("ur5_upright")
    assert page_planner(problem, problem.start, 0.1) is None  # its path is constrained
    moving = rrtik.load_problem("titan4_sdu")
    assert '"plan":null' in page(moving, still=True)
    assert '"plan":null' in page(moving.robot)
    assert "wasm-unsafe-eval" in page(moving, still=True)
    assert len(page(moving, still=True)) < 0.75 * len(page(moving))


FRAMES = "(async () => { for (let k = 0; k < 30; k += 1) await new Promise((r) => requestAnimationFrame(r)); })()"
# Where a person would take hold of something: the middle one of the places where the pointer meets it.
SPOT = """(() => {
  const r = pane.getBoundingClientRect();
  const places = [];
  for (let x = r.left + 5; x < r.right; x += 15) for (let y = r.top + 5; y < r.bottom; y += 15) {
    pointerAt({ clientX: x, clientY: y });
    if (hitThing()?.name === "%s" && !hitHandle()) places.push([x, y]);
  }
  return places[Math.floor(places.length / 2)];
})()"""


def type_in(browser: Browser, name: str, value: float) -> None:
    """Type a number of what is selected."""
    browser.ask(
        "(() => { const input = [...document.querySelectorAll('#plan-fields input')]"
        f".find((each) => each.ariaLabel.includes(': {name} ')); input.value = {value};"
        " input.dispatchEvent(new Event('change')); })()"
    )


@pytest.mark.usefixtures("coarse_arms")
@needs_chromium
def test_in_a_browser_goal_and_obstacles_are_dragged_and_the_saved_files_hold(tmp_path):
    crate = rrtik.Obstacle("crate", rrtik.Box([0.2, 0.2, 0.2]), rrtik.pose([0.6, 0.6, 0.6]))
    world = rrtik.World(rrtik.load_robot("ur5"), Scene((crate,)))
    problem = Problem(world, [0.0, -1.2, 1.0, 0.2, 0.0, 0.0], [1.6, -1.2, 1.0, 0.2, 0.0, 0.0])
    with planning_page(page(problem, rrtik.plan(problem, seed=1).path), tmp_path) as browser:
        browser.coarsen_shadows()
        spot = browser.ask(SPOT % "goal")
        browser.drag(spot, [spot[0] - 12.0, spot[1] - 8.0])
        browser.ask(FRAMES)
        goal, chosen = browser.ask("state.goal"), browser.ask("selected")
        spot = browser.ask(SPOT % "crate")
        browser.drag(spot, spot, 1)  # a click selects it
        browser.ask(FRAMES)
        spot = browser.ask(SPOT % "crate")  # beside its handles
        browser.drag(spot, [spot[0] + 10.0, spot[1] - 40.0])
        browser.ask(FRAMES)
        moved = browser.ask("[state.obstacles[0].pose[3], state.obstacles[0].pose[7], state.obstacles[0].pose[11]]")
        for shape in ("box", "capsule"):
            browser.ask(f"addShape('{shape}')")
            browser.ask("moveSelected(new THREE.Vector3(0, 0, 0.9), 0.3)")
        type_in(browser, "pitch", 30)
        type_in(browser, "length", 0.4)
        type_in(browser, "radius", 0)
        refused = browser.ask("document.getElementById('plan-refusal').textContent")
        browser.ask("changed()")
        browser.ask(FRAMES)
        status = browser.ask("document.getElementById('plan-state').textContent")
        assert "length" in status, status
        (tmp_path / "path.json").write_text(browser.ask("pathText()"), encoding="utf-8")
        (tmp_path / "problem.yaml").write_text(browser.ask("problemText()"), encoding="utf-8")
        for _ in range(8):
            browser.ask("document.getElementById('plan-undo').click()")
        assert browser.ask("state.goal") == problem.goal.q.tolist()
    assert chosen == "goal"
    assert np.abs(goal - problem.goal.q).max() > 1e-3
    saved = rrtik.load_problem(tmp_path / "problem.yaml")
    path = rrtik.JointPath.load(tmp_path / "path.json", saved.robot)
    assert "radius must be above 0" in refused
    assert [each.name for each in saved.world.scene.obstacles] == ["crate", "box 1", "capsule 1"]
    assert saved.world.scene.obstacles[2].shape.length == 0.4
    turned = saved.world.scene.obstacles[2].pose.rotation
    np.testing.assert_allclose(turned, pin.rpy.rpyToMatrix(0.0, np.pi / 6.0, 0.3), atol=1e-9)
    np.testing.assert_allclose(saved.world.scene.obstacles[0].pose.translation, moved, atol=1e-9)
    assert np.linalg.norm(np.array(moved) - 0.6) > 0.01
    assert path.violations(saved.world) == ()
    np.testing.assert_array_equal(path.end, saved.goal.q)
    np.testing.assert_array_equal(saved.goal.q, goal)


# What every object of JavaScript's has, and the words by which the page tells its ends apart.
TRICKY_NAMES = ["constructor", "__proto__", "toString", "hasOwnProperty", "_proto__", "start", "goal", "robot", ":goal"]
TRICKY_ARM = """<robot name="__proto__"><link name="valueOf"/>
<link name="isPrototypeOf"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
<link name="propertyIsEnumerable"><collision>
<origin xyz="0.3 0 0"/><geometry><box size="0.5 0.1 0.1"/></geometry></collision></link>
<joint name="constructor" type="revolute"><parent link="valueOf"/><child link="isPrototypeOf"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="__proto__" type="revolute"><parent link="isPrototypeOf"/><child link="propertyIsEnumerable"/>
<axis xyz="0 1 0"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""


@needs_chromium
def test_a_name_of_javascripts_own_is_a_name_like_any_other(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(TRICKY_ARM)
    robot = rrtik.load_robot("arm.urdf", tip="propertyIsEnumerable")
    places = [rrtik.pose([0.9, 0.3 * k - 1.2, 0.0]) for k in range(len(TRICKY_NAMES))]
    boxes = map(rrtik.Obstacle, TRICKY_NAMES, [rrtik.Box([0.1, 0.1, 0.1])] * len(TRICKY_NAMES), places)
    problem = Problem(rrtik.World(robot, Scene(tuple(boxes))), [0.0, 0.0], [1.0, 0.3])
    with planning_page(page(problem, rrtik.plan(problem, seed=1).path), tmp_path) as browser:
        for k in range(len(TRICKY_NAMES)):
            browser.ask(f"select({k}); moveSelected(new THREE.Vector3(0.5, 0, 0), 0)")
        assert browser.ask("nameOf(selected)") == TRICKY_NAMES[-1]
        browser.ask("select('goal'); moveSelected(new THREE.Vector3(0, 0, 0.01), 0)")
        found = browser.ask("problemText()")
    (tmp_path / "moved.yaml").write_text(found, encoding="utf-8")
    moved = rrtik.load_problem(tmp_path / "moved.yaml").world.scene
    assert [each.name for each in moved.obstacles] == TRICKY_NAMES
    for each, before in zip(moved.obstacles, places, strict=True):
        np.testing.assert_allclose(each.pose.translation, before.translation + np.array([0.5, 0.0, 0.0]), atol=1e-9)


TEMPTED = """<script>
window.broken = [];
addEventListener("securitypolicyviolation", (event) => window.broken.push(event.effectiveDirective));
try { eval("1"); window.evaluated = "ran"; } catch (error) { window.evaluated = error.name; }
fetch("http://127.0.0.1:9/").then(() => { window.fetched = "sent"; }, (error) => { window.fetched = error.name; });
</script></body>"""


@needs_chromium
def test_the_page_runs_no_text_as_script_and_connects_to_nobody(tmp_path: Path) -> None:
    text = page(rrtik.load_problem("planar3_a")).replace("</body>", TEMPTED)
    with planning_page(text, tmp_path, "document.documentElement.dataset.plans && window.fetched") as browser:
        assert browser.ask("[window.evaluated, window.fetched]") == ["EvalError", "TypeError"]
        assert browser.ask("window.broken.includes('connect-src')")
        assert browser.ask("window.broken.includes('script-src')")


@needs_chromium
def test_the_page_says_what_it_cannot_plan(tmp_path: Path) -> None:
    problem = rrtik.load_problem("planar3_a")
    with planning_page(page(problem, rrtik.plan(problem, seed=1).path), tmp_path) as browser:
        blocked = browser.ask(
            "(async () => { const k = 0; const q = state.start; const t = tipPosition(q);"
            " state.obstacles[k].pose = [1, 0, 0, t.x, 0, 1, 0, t.y, 0, 0, 1, t.z, 0, 0, 0, 1];"
            " applyObstacle(k); plan();"
            " return document.getElementById('plan-state').textContent; })()"
        )
        assert blocked.startswith("start: ")
        assert "too near" in blocked
        browser.ask("document.getElementById('plan-save-path').click()")
        assert browser.ask("document.getElementById('plan-refusal').textContent") == "there is no path to save"
