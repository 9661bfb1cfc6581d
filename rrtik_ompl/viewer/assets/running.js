// Obstacles that move by themselves, and the arm that goes on planning among them: a run in the page.
const LOOKS = [0.1, 0.2, 0.4, 0.7];  // [s] ahead, for which an obstacle is expected to go on as it does
const EVASION = 0.3;  // [s] that the way of an evasion may take
const RUN_MILLISECONDS = 6;  // of a search in one frame
const EVASIONS = 60;  // directions that are tried to make way
const LONGEST_FRAME = 0.1;  // [s]
const courses = new Map((planning?.courses ?? []).map((course) => [planning.obstacles.findIndex(({ name }) => name === course.name), course]));
const clock = { time: 0, running: false };

/** Where an obstacle is at a time [s]: 16 numbers, row by row. One that moves through stated poses stays on them. */
function poseAt(k, time) {
  const { pose } = state.obstacles[k];
  const course = courses.get(k);
  if (!course) return pose;
  if (course.velocity) return pose.map((value, n) => (n % 4 === 3 && n < 12 ? value + time * course.velocity[(n - 3) / 4] : value));
  const after = course.times.findIndex((stamp) => stamp > time);
  if (after <= 0) return rowsOf(poseBetween(course.poses, after === 0 ? 0 : course.poses.length - 1));
  const [from, to] = [course.times[after - 1], course.times[after]];
  return rowsOf(poseBetween(course.poses, after - 1 + (time - from) / (to - from)));
}

const rowsOf = (matrix) => matrix.transpose().elements.slice();
const poseNow = (k) => poseAt(k, clock.time);
const staysOnCourse = (k) => courses.get(k)?.times !== undefined;

/** Whether a question about each look ahead has a yes if the obstacles go on as they did in the last frame; the page does not look into their plans. */
function ifTheyGoOn(question) {
  const answer = LOOKS.every((ahead) => {
    for (const [k, { before }] of clock.seen) {
      const further = clock.step > 0 ? ahead / clock.step : 0;
      putInTables(k, poseNow(k).map((value, n) => (n % 4 === 3 ? value + further * (value - before[n]) : value)));
    }
    return question(ahead);
  });
  for (const k of clock.seen.keys()) putInTables(k, poseNow(k));
  return answer;
}

/** The rows from here on along the path, as far as the arm comes in some seconds. */
function partAhead(seconds) {
  const rows = [clock.q];
  let left = seconds;
  for (const target of clock.rest) {
    const from = rows[rows.length - 1];
    const needed = secondsOf(from, target);
    if (needed > left) return [...rows, from.map((value, j) => value + (left / needed) * (target[j] - value))];
    rows.push(target);
    left -= needed;
  }
  return rows;
}

const secondsOf = (a, b) => Math.max(...b.map((value, j) => Math.abs(value - a[j]) / planning.rates[j]));
const rowsFree = (rows) => rows.every((row, k) => k === 0 || kernels.motionFree(rows[k - 1], row));

/** A posture nearby that is free now and a moment later, or null. */
function wayOut() {
  for (let n = 0; n < EVASIONS; n += 1) {
    const q = clock.q.map((value, j) => Math.min(Math.max(value + EVASION * planning.rates[j] * (2 * clock.random() - 1), planning.lower[j]), planning.upper[j]));
    if (kernels.motionFree(clock.q, q) && ifTheyGoOn(() => kernels.free(q))) return q;
  }
  return null;
}

/** Numbers in [0, 1) that a seed decides: a linear congruential generator of 32 bits. */
function seeded(seed) {
  let last = seed >>> 0;
  return () => {
    last = (Math.imul(last, 1664525) + 1013904223) >>> 0;
    return last / 2 ** 32;
  };
}

/** Search from here for some milliseconds; true once a path is there. */
function searchOn() {
  const until = performance.now() + RUN_MILLISECONDS;
  clock.work ??= kernels.searchPath(clock.q, state.goal, state.seed + clock.plans);
  let step = clock.work.next();
  while (!step.done && performance.now() < until) step = clock.work.next();
  if (!step.done) return false;
  clock.work = null;
  if (!step.value) return false;
  let rows = step.value;
  for (const better of kernels.shortened(rows, state.seed)) {
    rows = better;
    if (performance.now() > until) break;
  }
  clock.rest = rows.slice(1);
  clock.plans += 1;
  drawTrail(rows);
  return true;
}

/** One frame: what the arm does, in a word; its posture moves on by some seconds. */
function runOn(seconds) {
  if (!kernels.free(clock.q)) return "ended";
  const arrived = () => clock.q.every((value, j) => value === state.goal[j]);
  if (arrived() && ifTheyGoOn(() => kernels.free(clock.q))) return "arrived";
  if (!ifTheyGoOn(() => kernels.free(clock.q))) {
    const aside = wayOut();
    if (aside) clock.rest = [aside];
    clock.work = null;
  } else if (!clock.rest.length || !rowsFree([clock.q, ...clock.rest]) || !ifTheyGoOn((ahead) => rowsFree(partAhead(ahead)))) {
    clock.rest = [];
    if (!searchOn() || !ifTheyGoOn((ahead) => rowsFree(partAhead(ahead)))) return "waits";
  }
  const rows = partAhead(seconds);
  if (!rowsFree(rows)) return "waits";
  clock.rest = clock.rest.slice(Math.max(rows.length - 2, 0));
  clock.q = rows[rows.length - 1];
  if (clock.rest.length && clock.q.every((value, j) => value === clock.rest[0][j])) clock.rest = clock.rest.slice(1);
  return "moves";
}

/** Let time go on: obstacles along their courses, then the arm; what it did, in a word. */
function advance(seconds) {
  for (const [k, one] of clock.seen) one.before = poseNow(k);
  Object.assign(clock, { step: seconds, time: clock.time + seconds });
  for (const k of courses.keys()) applyObstacle(k);
  return runOn(seconds);
}

function runFrame(stamp) {
  if (!clock.running) return;
  const seconds = Math.min(Math.max(stamp - clock.stamp, 0) / 1000, LONGEST_FRAME) * Number(document.getElementById("speed").value);
  clock.stamp = stamp;
  const done = advance(seconds);
  setPosture(node("robot"), clock.q);
  showJoints(clock.q, null, false);
  const texts = { ended: `ended: ${kernels.blame(clock.q)}`, arrived: "goal reached", waits: "waits", moves: "on its way" };
  planStatus(`${clock.time.toFixed(2)} s, ${count(clock.plans, "new path")}: ${texts[done]}`, done === "ended");
  viewer.set_dirty();
  if (done === "arrived" || done === "ended") endRun();
  else requestAnimationFrame(runFrame);
}

function startRun() {
  resetRun();
  if (!kernels.free(state.start) || !kernels.free(state.goal)) return planRefusal("start and goal must be free at the beginning");
  Object.assign(clock, { running: true, q: state.start.slice(), rest: story.waypoints.slice(1), plans: 0, work: null, step: 0, stamp: performance.now(), random: seeded(state.seed) });
  clock.seen = new Map([...courses.keys()].map((k) => [k, { before: poseNow(k) }]));
  const rows = story.waypoints;
  shortening += 1;  // what is still being made shorter is left
  replacePath([]);
  sayTitle("obstacles move");
  if (rows.length > 1) drawTrail(rows);
  document.getElementById("player").hidden = true;
  viewer.set_3d_pane_size();
  document.getElementById("run-start").textContent = "Stop";
  return requestAnimationFrame(runFrame);
}

/** The arm stays where it is; the next press begins anew. */
function endRun() {
  clock.running = false;
  document.getElementById("run-start").textContent = "Run again";
}

/** Everything as it was at time 0, with a path from the start. */
function resetRun() {
  clock.time = 0;
  for (const k of courses.keys()) applyObstacle(k);
}

function wireRunning() {
  if (courses.size === 0) return;
  document.getElementById("run-controls").hidden = false;
  document.getElementById("run-start").addEventListener("click", () => {
    if (!clock.running) return startRun();
    endRun();
    resetRun();
    return plan();
  });
}
