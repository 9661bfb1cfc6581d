// Paths of single-joint moves: BiCRDT's search in the kernels, and the axis post-processor that makes fewer moves of them.
// Source of both: [1, ch. 6.3, algorithms 11 and 12].
const EXTENSIONS_AT_ONCE = 32n;  // of the search, until it may be left
const FURTHER_SEEDS = 40;  // of paths of single-joint moves, of which the best is kept
const STEP_TOLERANCE = 1e-9;  // [steps], as of the kernels

/** Plant one of the two trees of the search: a single vertex, q. */
function plant(kernels, side, q) {
  const { names } = kernels.plan;
  const tree = kernels.table(kernels.crdt.get(side === 0 ? "TREE" : "OTHER_TREE"), names.crdt);
  const [coordinates, capacity] = [tree.get("COORDINATES") / NUMBER_BYTES, tree.get("CAPACITY")];
  q.forEach((value, axis) => { kernels.doubles[coordinates + axis * capacity] = value; });
  kernels.ints[tree.get("PARENTS") / LANE_BYTES] = names.crdt.ROOT;
  tree.set("SIZE", 1);
  return tree;
}

/** The rows from a vertex of a tree to its root. */
function branch(kernels, tree, vertex) {
  const rows = [];
  const [coordinates, capacity, parents] = [tree.get("COORDINATES") / NUMBER_BYTES, tree.get("CAPACITY"), tree.get("PARENTS") / LANE_BYTES];
  for (let k = vertex; k !== kernels.plan.names.crdt.ROOT; k = kernels.ints[parents + k]) {
    rows.push(Array.from({ length: kernels.dof }, (_, axis) => kernels.doubles[coordinates + axis * capacity + k]));
  }
  return rows;
}

/** A path of single-joint moves from start to goal, or null; it stops where it may be left. The same seed gives the same path as CrdtSearch in Python. */
function* searchMoves(kernels, start, goal, seed) {
  const { crdt, plan } = kernels;
  const names = plan.names.crdt;
  const trees = [plant(kernels, 0, start), plant(kernels, 1, goal)];
  for (const name of ["ITERATIONS", "CHECKED", "GROWING", "MET", "LAST"]) crdt.set(name, 0);
  crdt.set("NEXT", names.BEGIN);
  crdt.set("RANDOM", seed);
  crdt.set("ITERATION_LIMIT", plan.samples);
  let status = names.RUNNING;
  while (status === names.RUNNING || status === names.ASKING) {
    if (status === names.ASKING) refuseEdges(kernels);
    status = Number(kernels.entries.crdt_resume_pair(BigInt(crdt.address), EXTENSIONS_AT_ONCE));
    yield;
  }
  if (status !== names.SOLVED) return null;  // no path, or no room for more vertices
  const ends = [crdt.get("MET"), crdt.get("LAST")];
  if (crdt.get("GROWING") === 0) ends.reverse();  // the turns have changed since
  const [one, two] = trees.map((tree, side) => branch(kernels, tree, ends[side]));
  return [...one.reverse(), ...two.slice(1)];
}

/** Edges that the kernels left undecided count as colliding. */
function refuseEdges(kernels) {
  const { crdt, plan } = kernels;
  const first = crdt.get("VERDICTS") / LANE_BYTES;
  for (let k = first; k < first + crdt.get("EDGE_COUNT"); k += 1) {
    if (kernels.ints[k] === plan.names.table.UNDECIDED) kernels.ints[k] = plan.names.table.COLLIDING;
  }
}

// Fewer moves ------------------------------------------------------------------------------------------------------
const movedAxes = (a, b) => a.flatMap((value, axis) => (value === b[axis] ? [] : [axis]));
const samePlace = (a, b) => a.every((value, axis) => value === b[axis]);

/** Moves of the same joint in a row as one. */
function mergeMoves(rows) {
  const merged = rows.slice(0, 1);
  for (const row of rows.slice(1)) {
    const last = merged[merged.length - 1];
    if (samePlace(last, row)) continue;
    const before = merged[merged.length - 2];
    const [one, two] = before ? [movedAxes(before, last), movedAxes(last, row)] : [[], []];
    if (one.length === 1 && two.length === 1 && one[0] === two[0]) merged.pop();
    if (!merged.length || !samePlace(merged[merged.length - 1], row)) merged.push(row);
  }
  return merged;
}

/** The rows behind `from` on the way to `to`, one joint after the other, the last joint first: distal joints sweep less. */
function axisMoves(from, to) {
  const row = from.slice();
  return movedAxes(from, to).reverse().map((axis) => {
    row[axis] = to[axis];
    return row.slice();
  });
}

/** Whether moves are free; each is asked once, from its lexicographically smaller end. */
function rememberedMotions(kernels) {
  const answers = new Map();
  return (a, b) => {
    const first = movedAxes(a, b)[0];
    const [from, to] = a[first] > b[first] ? [b, a] : [a, b];
    const key = `${from};${to}`;
    if (!answers.has(key)) answers.set(key, kernels.motionFree(from, to));
    return answers.get(key);
  };
}

/** One pass from the end of a route: from a pivot to the earliest row that moves reach, and on; the route turned round. */
function* axisCut(rows, free) {
  let pivot = rows.length - 1;
  const cut = [rows[pivot]];
  while (pivot > 0) {
    const reaches = (way) => way.map((row, k) => [k ? way[k - 1] : rows[pivot], row]).reverse().every(([a, b]) => free(a, b));
    let [test, way] = [0, axisMoves(rows[pivot], rows[0])];
    while (test < pivot - 1 && !reaches(way)) {
      test += 1;
      way = axisMoves(rows[pivot], rows[test]);
    }
    cut.push(...way);
    pivot = test;
    yield;
  }
  return mergeMoves(cut);
}

/** A path of single-joint moves with fewer of them: a pass from its end, one from its start. */
function* fewerMoves(kernels, rows) {
  const free = rememberedMotions(kernels);
  return yield* axisCut(yield* axisCut(mergeMoves(rows), free), free);
}

const lengthOf = (rows) => rows.slice(1).reduce((sum, row, k) => sum + Math.hypot(...row.map((value, j) => value - rows[k][j])), 0);

/** A path with fewer moves, and those of further seeds that have fewer still, or as many and a shorter way: the best so far. */
function* bestMoves(kernels, found, seed) {
  const ends = [found[0], found[found.length - 1]];
  let best = found;
  for (let tried = 0; tried <= FURTHER_SEEDS; tried += 1) {
    const rows = tried === 0 ? found : yield* keeping(best, searchMoves(kernels, ...ends, seed + tried));
    const fewer = rows && (yield* keeping(best, fewerMoves(kernels, rows)));
    if (fewer && (fewer.length < best.length || (fewer.length === best.length && lengthOf(fewer) < lengthOf(best)))) best = fewer;
    yield best;
  }
}

/** Other work, which gives what there is already wherever it stops. */
function* keeping(best, work) {
  let step = work.next();
  for (; !step.done; step = work.next()) yield best;
  return step.value;
}
