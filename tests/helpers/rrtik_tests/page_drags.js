// What the tool of drags asks in a page that plans, of now or of an earlier version: it works as ever, but draws no pictures.
window.drags = (() => {
  const TRIES = 3000;  // pixels that are looked at for one where a press takes hold of a thing
  const EDGE = 4;  // [pixels] of the picture that a drag keeps away from
  const faults = [];
  addEventListener("error", ({ message }) => faults.push(message));
  addEventListener("unhandledrejection", ({ reason }) => faults.push(String(reason)));
  let first = null;  // the state from which each drag begins, and what is shown of it

  const hasHandles = () => typeof hitHandle === "function";
  const frame = () => new Promise((done) => { requestAnimationFrame(done); });

  // Work for one path goes on over several frames; it is over when it ends, or when another path is wanted. Nobody looks at the
  // paths in between: once the pointer rests, what is left is done at once.
  let working = null;
  let resting = false;
  const goOn = inFrames;
  window.inFrames = (work, number, { each, end }, ...last) => {
    if (number === shortening) working = number;
    goOn(resting ? atOnce(work) : work, number, { each, end: (result) => { working = null; end(result); } }, ...last);
  };

  function* atOnce(work) {
    let step = work.next();
    if (step.done) return step.value;
    let given = step.value;
    for (step = work.next(); !step.done; step = work.next()) given = step.value;
    yield given;
    return step.value;
  }

  /** Wait until the page has done what its state asks for. */
  async function rest() {
    resting = true;
    while (again !== null || working === shortening) await frame();
    resting = false;
  }

  /** The camera of the first view, or one that is given: the same pixel is the same place in each page. */
  function look(given) {
    Object.assign(pane.parentElement.style, { position: "fixed", inset: 0, zIndex: 1000 });
    viewer.set_3d_pane_size();
    lookFrom(viewpoint);
    const { camera, controls } = viewer;
    if (given) {
      camera.position.fromArray(given.eye);
      controls.target.fromArray(given.target);
    }
    controls.update();
    camera.updateMatrixWorld();
    turnedByHand = true;
    return { eye: camera.position.toArray(), target: controls.target.toArray() };
  }

  /** Prepare the page. With what the same call in another page returned it begins from the same state and view, and finds paths alone. */
  async function begin(given = null) {
    document.getElementById("plan-shorten").checked = !given;
    viewer.renderer.render = () => { viewer.scene.updateMatrixWorld(); viewer.camera.updateMatrixWorld(); };
    const view = look(given?.view);
    if (given) Object.assign(state, { start: given.start, goal: given.goal });
    changed();
    await rest();
    const line = document.getElementById("plan-state");
    const said = [line.textContent, line.classList.contains("bad")];
    first = { state: copyOf(state), rows: story.moves.length ? story.waypoints : [], said, view, shortens: !given };
    const free = [...planning.obstacles.keys()].filter((k) => isMovable(k) && !planning.obstacles[k].locked);
    return { view, start: state.start, goal: state.goal, size, handles: hasHandles(), things: [...ENDS.keys(), ...free] };
  }

  /** The first state again, with its path. */
  function reset() {
    shortening += 1;
    document.getElementById("plan-shorten").checked = first.shortens;
    past.length = 0;
    look(first.view);
    take(first.state);
    select("goal");
    replacePath(first.rows);
    planStatus(...first.said);
    viewer.render();
  }

  function take(wanted) {
    state = copyOf(wanted);
    state.obstacles.forEach((_, k) => applyObstacle(k));
    planRefusal("");
  }

  /** Numbers in [0, 1) that a seed decides: a linear congruential generator of 32 bits. */
  function randomNumbers(seed) {
    let value = seed;
    return () => {
      value = (Math.imul(value, 1664525) + 1013904223) >>> 0;
      return value / 2 ** 32;
    };
  }

  const drawn = (thing) => (isEnd(thing) ? node(ENDS.get(thing)) : node("obstacles", planning.obstacles[thing].node));

  function pixelOf(place) {
    const { x, y } = place.clone().project(viewer.camera);
    const box = pane.getBoundingClientRect();
    return [box.left + (0.5 + 0.5 * x) * box.width, box.top + (0.5 - 0.5 * y) * box.height];
  }

  const inside = ([x, y]) => {
    const { left, right, top, bottom } = pane.getBoundingClientRect();
    return x > left + EDGE && x < right - EDGE && y > top + EDGE && y < bottom - EDGE;
  };

  /** A random pixel on a group for which something is found, and that; null where there is none. */
  function seek(group, random, find) {
    viewer.render();
    const { min, max } = new THREE.Box3().setFromObject(group);
    const corners = [...Array(8).keys()].map((k) => pixelOf(new THREE.Vector3(k & 1 ? max.x : min.x, k & 2 ? max.y : min.y, k & 4 ? max.z : min.z)));
    const [across, down] = [0, 1].map((i) => corners.map((corner) => corner[i]));
    const between = (ends) => Math.round(Math.min(...ends) + random() * (Math.max(...ends) - Math.min(...ends)));
    for (let n = 0; n < TRIES; n += 1) {
      const pixel = [between(across), between(down)];
      if (!inside(pixel)) continue;
      pointerAt({ clientX: pixel[0], clientY: pixel[1] });
      const found = find(pixel);
      if (found) return { pixel, found };
    }
    return null;
  }

  /** From and to which pixel a thing must be dragged so that it moves by a shift in the plane of the picture [m]. */
  function aim(thing, shift, seed) {
    const [right, up] = [0, 1].map((k) => new THREE.Vector3().setFromMatrixColumn(viewer.camera.matrixWorld, k));
    const way = right.multiplyScalar(shift[0]).addScaledVector(up, shift[1]);
    const spot = seek(drawn(thing), randomNumbers(seed), () => {
      const found = hitThing();
      if (found?.thing !== thing || (hasHandles() && hitHandle())) return null;
      const end = pixelOf(found.hit.point.clone().add(way));
      return inside(end) ? end : null;
    });
    return spot && { press: spot.pixel, release: spot.found, way: [way.x, -way.z, way.y] };  // meshcat's picture has y up
  }

  /** From and to which pixel to drag some handle of what is selected by some pixels. */
  function aimHandle(by, seed) {
    const spot = seek(handles, randomNumbers(seed), ([x, y]) => {
      const end = [x + by[0], y + by[1]];
      return hitHandle() && inside(end) ? end : null;
    });
    return spot && { press: spot.pixel, release: spot.found };
  }

  /** How far the tip that is held of an end is from where a drag by a way would have it: the place [m], the turn [rad]. */
  function gap(end, way) {
    const pose = (q) => carried(held, jointFrames(q));
    const [from, now] = [pose(first.state[end]), pose(state[end])];
    const place = (matrix) => new THREE.Vector3().setFromMatrixPosition(matrix);
    const turn = (matrix) => new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().extractRotation(matrix));
    const shift = new THREE.Vector3(way[0], way[1], story.planar ? 0 : way[2]);
    return [place(from).add(shift).distanceTo(place(now)), turn(from).angleTo(turn(now))];
  }

  /** What the page says, once it has done what its state asks for. */
  async function says() {
    await rest();
    const [line, refusal] = ["plan-state", "plan-refusal"].map((id) => document.getElementById(id));
    const obstacles = planning.obstacles.flatMap(({ name, shape, spare }, k) => {
      const { pose, sizes, shown } = state.obstacles[k];
      return spare && !shown ? [] : [{ name, shape, sizes, pose, shown }];
    });
    return {
      state, obstacles, faults, text: line.textContent, bad: line.classList.contains("bad"),
      refusal: refusal.hidden ? "" : refusal.textContent,
      moves: story.moves.length, waypoints: story.waypoints, title: document.getElementById("title").textContent,
    };
  }

  /** What the page says of a path in the state of another page: the same ends, the same obstacles. */
  function saysIn(other) {
    const there = new Map(other.obstacles.map((each) => [each.name, each]));
    const obstacles = first.state.obstacles.map((kept, k) => {
      const found = there.get(planning.obstacles[k].name);
      return found ? { pose: found.pose, sizes: found.sizes, shown: found.shown } : kept;
    });
    document.getElementById("plan-shorten").checked = false;
    take({ ...first.state, start: other.state.start, goal: other.state.goal, obstacles });
    changed();
    return says();
  }

  return { begin, reset, rest, aim, aimHandle, gap, says, saysIn };
})();
