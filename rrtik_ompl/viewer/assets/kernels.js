// The kernels of the library as WebAssembly, on an image of the tables that Python packed: searches, shortcuts, inverse
// kinematics, distances. What they leave undecided counts as colliding, so that what they call free is free.
const LANE_BYTES = 4;
const NUMBER_BYTES = 8;
const STACK_ROOM = 64;  // bytes between the stack and the image
const FREE_ROOM = 1 << 20;  // bytes behind the image
const MOTIONS_AT_ONCE = 256n;  // of a search, until it may be left: about a millisecond
const TRIES_AT_ONCE = 16n;  // of shortcuts

/** Whether this browser has what the kernels need: vectors in WebAssembly and whole numbers of 64 bits. */
function hasKernels() {
  const vectors = [0, 97, 115, 109, 1, 0, 0, 0, 1, 5, 1, 96, 0, 1, 123, 3, 2, 1, 0, 10, 10, 1, 8, 0, 65, 0, 253, 15, 253, 98, 11];
  return typeof BigInt64Array === "function"
    && typeof WebAssembly === "object" && WebAssembly.validate(new Uint8Array(vectors));
}

/** The kernels of a plan, or else in words why there are none. */
async function loadedKernels(plan) {
  if (!hasKernels()) return { kernels: null, fault: "this browser cannot plan in the page: it lacks WebAssembly with SIMD" };
  try {
    return { kernels: await Kernels.load(plan), fault: "" };
  } catch (error) {
    return { kernels: null, fault: `the page cannot plan: ${error.message}` };
  }
}

class Kernels {
  /** From the planner's part of a story; see page_planner.py. */
  static async load(plan) {
    const [code, image] = await Promise.all([unpacked(plan.module), unpacked(plan.image), unpackSurfaces(plan)]);
    const memory = new WebAssembly.Memory({ initial: Math.ceil((plan.end + FREE_ROOM) / 65536) });
    const stack = new WebAssembly.Global({ value: "i32", mutable: true }, plan.base - STACK_ROOM);
    const env = { __linear_memory: memory, __stack_pointer: stack, sin: Math.sin, cos: Math.cos };
    const { instance } = await WebAssembly.instantiate(code, { env });
    new Uint8Array(memory.buffer).set(image, plan.base);
    return new Kernels(plan, instance.exports, memory.buffer);
  }

  constructor(plan, entries, buffer) {
    Object.assign(this, { plan, entries, buffer, dof: plan.dof });
    this.whole = new BigInt64Array(buffer);
    this.doubles = new Float64Array(buffer);
    this.floats = new Float32Array(buffer);
    this.ints = new Int32Array(buffer);
    const { places, names } = plan;
    this.search = this.table(places.search, names.connect);
    this.shortcuts = this.table(places.shortcuts, names.shortcut);
    this.crdt = this.table(places.crdt, names.crdt);
    this.motions = this.table(places.motions, names.motion);
    this.world = this.table(places.world, names.world);
    this.spare = plan.end;
    this.touched = new Map();  // by the names of obstacles that were moved: the part of the base that each touches, or null
    const joints = this.motions.get("JOINTS");
    this.room = { values: this.reserve(2 * NUMBER_BYTES * joints), steps: this.reserve(LANE_BYTES), found: this.reserve(NUMBER_BYTES), pair: this.reserve(LANE_BYTES), answer: this.reserve(LANE_BYTES) };
  }

  /** The fields of a table by their names: table.get("COUNT"), table.set("COUNT", 3). */
  table(address, names) {
    const first = address / NUMBER_BYTES;
    return {
      address,
      get: (name) => Number(this.whole[first + names[name]]),
      set: (name, value) => { this.whole[first + names[name]] = BigInt(value); },
    };
  }

  /** Memory behind the image, for arrays of a fixed size. */
  reserve(bytes) {
    const place = this.spare;
    this.spare += Math.ceil(bytes / 64) * 64;
    return place;
  }

  writeRow(address, row) {
    this.doubles.set(row, address / NUMBER_BYTES);
  }

  readRows(address, count) {
    const first = address / NUMBER_BYTES;
    const row = (k) => Array.from(this.doubles.subarray(first + k * this.dof, first + (k + 1) * this.dof));
    return Array.from({ length: count }, (_, k) => row(k));
  }

  inBox(q) {
    return q.every((value, k) => value >= this.plan.lower[k] && value <= this.plan.upper[k]);
  }

  /** An obstacle and the part of the base that it touches, or undefined. */
  get contact() {
    return [...this.touched].find(([, part]) => part !== null);
  }

  /** Whether a configuration is inside the limits and proven free. */
  free(q) {
    if (!this.inBox(q) || this.contact) return false;
    this.setValues(q);
    const { values, answer } = this.room;
    this.entries.check_classify(...[this.world.address, values, 1, answer, 1].map(BigInt));
    return this.ints[answer / LANE_BYTES] === this.plan.names.table.FREE;
  }

  /** Whether a straight motion is proven free at the configurations at which Python checks it. */
  motionFree(a, b) {
    if (!this.inBox(a) || !this.inBox(b) || this.contact) return false;
    const { values, steps, answer } = this.room;
    this.setValues(a);
    this.setValues(b, 1);
    this.ints[steps / LANE_BYTES] = this.stepCount(a, b);
    const ends = [values, values + NUMBER_BYTES * this.motions.get("JOINTS")];
    this.entries.check_classify_edges(...[this.world.address, ...ends, steps, 1, answer, 1].map(BigInt));
    return this.ints[answer / LANE_BYTES] === this.plan.names.table.FREE;
  }

  /** In how many steps a motion is checked; see motion_table.py. */
  stepCount(a, b) {
    const weights = this.motions.get("WEIGHTS") / NUMBER_BYTES;
    const resolution = this.doubles[this.motions.address / NUMBER_BYTES + this.plan.names.motion.RESOLUTION];
    const travel = a.reduce((sum, value, k) => sum + this.doubles[weights + k] * Math.abs(b[k] - value), 0);
    return Math.max(1, Math.ceil(travel / resolution - STEP_TOLERANCE));
  }

  /** Write the joint values of a configuration where single answers are found, or behind it (row 1). */
  setValues(q, row = 0) {
    const joints = this.motions.get("JOINTS");
    const [gain, offset] = ["GAIN", "OFFSET"].map((name) => this.motions.get(name) / NUMBER_BYTES);
    for (let j = 0; j < joints; j += 1) {
      let sum = this.doubles[offset + j];
      for (let k = 0; k < this.dof; k += 1) sum += this.doubles[gain + j * this.dof + k] * q[k];
      this.doubles[this.room.values / NUMBER_BYTES + row * joints + j] = sum;
    }
  }

  /** A path from start to goal, rows of joint values, or null; `seed` as in Python. It stops where it may be left. */
  * searchPath(start, goal, seed) {
    const { search, plan } = this;
    const names = plan.names.connect;
    this.writeRow(search.get("START_ROWS"), start);
    this.writeRow(search.get("GOAL_ROWS"), goal);
    search.set("RESOLVE", 1);  // the solids are compared too; what they leave undecided is asked, at once
    search.set("PATIENCE", 0);
    search.set("LIMIT", plan.samples);
    search.set("PATH_CAPACITY", plan.places.pathRows);
    const address = BigInt(search.address);
    let status = Number(this.entries.connect_solve(address, 1n, 1n, BigInt(seed), MOTIONS_AT_ONCE));
    while (status === names.RUNNING || status === names.ASKING) {
      yield;
      if (status === names.ASKING) this.refuse(search);
      status = Number(this.entries.connect_resume(address, MOTIONS_AT_ONCE));
    }
    const count = search.get("PATH_ROWS");
    return status === names.SOLVED && count <= plan.places.pathRows ? this.readRows(search.get("PATH"), count) : null;
  }

  /** Answer that none of the motions that a search asks about is free. */
  refuse(search) {
    const first = search.get("ANSWERS") / LANE_BYTES;
    this.ints.fill(0, first, first + search.get("QUESTIONS"));
  }

  /** Make a path shorter by random shortcuts; gives what it is by then wherever it may be left. The seed as in Python. */
  * shortened(rows, seed) {
    const { shortcuts, plan } = this;
    const names = plan.names.shortcut;
    const route = shortcuts.get("ROUTE");
    rows.forEach((row, k) => this.writeRow(route + k * this.dof * NUMBER_BYTES, row));
    for (const name of ["TRIES", "FAILURES", "GAINS", "QUESTIONS", "FIRST", "SECOND", "CUTS"]) shortcuts.set(name, 0);
    shortcuts.set("RESOLVE", 1);
    shortcuts.set("COUNT", rows.length);
    shortcuts.set("RANDOM", seed);
    shortcuts.set("MAX_TRIES", rows.length < 3 ? 0 : plan.tries);
    shortcuts.set("PATIENCE", Math.ceil(plan.tries / 4));
    shortcuts.set("ANSWERED", names.NO_ANSWER);
    let status = names.RUNNING;
    while (status !== names.DONE) {
      status = Number(this.entries.shortcut_resume(BigInt(shortcuts.address), TRIES_AT_ONCE));
      if (status === names.ASKING) shortcuts.set("ANSWERED", names.ANSWER_NO);
      yield this.readRows(route, shortcuts.get("COUNT"));
    }
  }

  /** Joint values near `from` that bring a tip of the plan to a pose (12 numbers: the rotation row by row, the origin), or null. */
  reach(pose, from, tip = this.plan.tips[0]) {
    const { names } = this.plan;
    if (tip === undefined) return null;
    const call = this.table(tip.ik, names.call);
    const aim = call.get("AIMS") / NUMBER_BYTES;
    this.doubles.fill(0, aim, aim + names.ik.AIM_FLOATS);
    this.doubles.set(pose, aim);
    this.doubles[aim + names.ik.POSITION_TOLERANCE] = 1e-5;
    this.doubles[aim + names.ik.CHORD_TOLERANCE] = 1e-5;
    this.doubles[aim + names.ik.FREE_TURN] = names.ik.NO_TURN;
    this.writeRow(call.get("NEAR"), from);
    this.whole[call.get("NEXT") / NUMBER_BYTES] = 0n;
    const solved = this.entries.ik_solve(BigInt(tip.limb), BigInt(tip.ik));
    return solved === 1n ? this.readRows(call.get("Q"), 1)[0] : null;
  }

  /** A lower bound of the distance from contact at a configuration [m], by the covers, and the pair that it is of. */
  nearest(q) {
    this.setValues(q);
    const { values, found, pair } = this.room;
    const tables = [this.world.address, this.world.get("OUTER_BALLS"), this.world.get("OUTER_PRIMITIVES"), values, 1, this.plan.places.probe, found, pair];
    this.entries.distance_measure(...tables.map(BigInt));
    const flag = this.ints[pair / LANE_BYTES];
    return { metres: flag < 0 ? Infinity : this.doubles[found / NUMBER_BYTES], pair: flag < 0 ? null : this.pairOf(flag) };
  }

  /** Names of the bodies that a flag of the kernels stands for. */
  pairOf(flag) {
    const { moving, standing, names } = this.plan;
    const crossing = moving.length * standing.length;
    if (flag < crossing) return [moving[Math.floor(flag / standing.length)], standing[flag % standing.length]];
    const pairs = this.table(this.world.get("OUTER_BALLS"), names.balls).get("PAIRS") / LANE_BYTES;
    const first = pairs + names.table.PAIR_INTS * (flag - crossing);
    return [moving[this.ints[first + names.table.PAIR_ONE]], moving[this.ints[first + names.table.PAIR_OTHER]]];
  }

  /** Why a configuration is not free, in a few words. */
  blame(q) {
    if (!this.inBox(q)) return "outside the joint limits";
    const pair = this.contact ?? this.nearest(q).pair;
    return pair === null ? "not proven free" : `${pair.join(" and ")} are too near each other`;
  }
}
