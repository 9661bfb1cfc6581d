// Path constraints of problem files and plans: {frame, fromStart, region, within, bounds, tolerances} each.
//
// `region` is a pose in the world, or in the frame at the start of the path; `within` that of what is bounded in the
// frame, which is null for the tip. Tolerances are those of position [m] and orientation [rad], between waypoints.

const ANYWHERE = [[-1000, 1000], [-1000, 1000], [-1000, 1000], [-Math.PI, Math.PI], [-Math.PI, Math.PI], [-Math.PI, Math.PI]];
const CONSTRAINT_KINDS = ["upright", "on_plane", "on_line", "orientation_of", "inside", "task_region"];
const radians = (degrees) => (degrees * Math.PI) / 180;

/** The path constraints of data; an empty list without any. */
function readConstraints(data, file) {
  return listOf(data, `${file}: path_constraints`).map((each, k) => {
    const where = `${file}: path constraint ${k + 1}`;
    only(each, ["frame", ...CONSTRAINT_KINDS], where);
    const kinds = CONSTRAINT_KINDS.filter((key) => (each[key] ?? null) !== null);
    if (kinds.length !== 1) throw new Error(`${where}: expected one of ${CONSTRAINT_KINDS.join(", ")}`);
    const frame = (each.frame ?? null) === null ? null : words(each.frame, where);
    const usual = { frame, fromStart: false, within: IDENTITY, tolerances: [1e-3, 1e-2] };
    return { ...usual, ...CONSTRAINT_READERS[kinds[0]](each[kinds[0]], where) };
  });
}

const CONSTRAINT_READERS = {
  upright(given, where) {
    only(given, ["axis", "tolerance_deg", "allowance_deg"], where);
    const axis = ["x", "y", "z"].indexOf(given.axis ?? "z");
    if (axis < 0) throw new Error(`${where}: axis: expected x, y or z`);
    const region = poseAlong(IDENTITY.turn[axis], [0, 0, 0]);
    const angle = radians(notNegative(given.tolerance_deg ?? 5, where) + notNegative(given.allowance_deg ?? 0, where));
    const bounds = ANYWHERE.map((pair, k) => (k === 3 || k === 4 ? [0, 0] : pair));
    return { fromStart: true, region, within: region, bounds, tolerances: [1e-3, angle] };
  },
  on_plane(given, where) {
    only(given, ["point", "normal", "tolerance", "allowance"], where);
    const region = poseAlong(numbersOf(given.normal, 3, where), numbersOf(given.point, 3, where));
    return { region, bounds: ANYWHERE.map((pair, k) => (k === 2 ? [0, 0] : pair)), tolerances: [metresOf(given, where), 1e-2] };
  },
  on_line(given, where) {
    only(given, ["point", "direction", "tolerance", "allowance"], where);
    const region = poseAlong(numbersOf(given.direction, 3, where), numbersOf(given.point, 3, where));
    return { region, bounds: ANYWHERE.map((pair, k) => (k < 2 ? [0, 0] : pair)), tolerances: [metresOf(given, where), 1e-2] };
  },
  orientation_of(given, where) {
    only(given, ["pose", "tolerance_deg", "tolerances_deg", "allowance_deg"], where);
    const region = posedBy(given.pose, where);
    const allowance = radians(notNegative(given.allowance_deg ?? 0, where));
    const three = given.tolerances_deg ?? null;
    if (three === null) {
      const angle = radians(notNegative(given.tolerance_deg ?? 1, where)) + allowance;
      return { region, bounds: ANYWHERE.map((pair, k) => (k < 3 ? pair : [0, 0])), tolerances: [1e-3, angle] };
    }
    // The tolerance of ranges is taken from inside the given angles.
    const turns = numbersOf(three, 3, where).map((degrees) => radians(Math.min(notNegative(degrees, where), 180)));
    const isRange = (turn) => turn > 0 && turn < Math.PI;
    const rim = Math.min(1e-2, 0.5 * Math.min(Math.PI, ...turns.filter(isRange)));
    const widths = turns.map((turn) => (isRange(turn) ? turn - rim : turn));
    const bounds = [...ANYWHERE.slice(0, 3), ...widths.map((width) => [-width, width])];
    return { region, bounds, tolerances: [1e-3, rim + allowance] };
  },
  inside(given, where) {
    only(given, ["pose", "sides", "tolerance", "allowance"], where);
    const sides = numbersOf(given.sides, 3, where).map((side) => notNegative(side, where));
    const bounds = [...sides.map((side) => [-side / 2, side / 2]), ...ANYWHERE.slice(3)];
    return { region: posedBy(given.pose, where), bounds, tolerances: [metresOf(given, where), 1e-2] };
  },
  task_region(given, where) {
    const positions = ["x", "y", "z"];
    const turns = ["roll", "pitch", "yaw"];
    const amounts = ["position_tolerance", "orientation_tolerance", "position_allowance", "orientation_allowance_deg"];
    only(given, ["frame", "tip", ...positions, ...turns, ...turns.map((key) => `${key}_deg`), ...amounts], where);
    const pairOfAngles = (key) => (given[key] ?? null) === null ? numbersOf(given[`${key}_deg`] ?? [0, 0], 2, where).map(radians) : numbersOf(given[key], 2, where);
    const bounds = [...positions.map((key) => numbersOf(given[key] ?? [0, 0], 2, where)), ...turns.map(pairOfAngles)];
    const metres = notNegative(given.position_tolerance ?? 1e-3, where) + notNegative(given.position_allowance ?? 0, where);
    const angle = notNegative(given.orientation_tolerance ?? 1e-2, where) + radians(notNegative(given.orientation_allowance_deg ?? 0, where));
    return { region: posedBy(given.frame, where), within: inverse(posedBy(given.tip ?? null, where)), bounds, tolerances: [metres, angle] };
  },
};

const metresOf = (given, where) => notNegative(given.tolerance ?? 1e-3, where) + notNegative(given.allowance ?? 0, where);

/** A pose at a point whose z axis has a direction, turned by the shortest rotation; half a turn about x if it is -z. */
function poseAlong(direction, at) {
  const [x, y, z] = scaled(direction, 1 / length(direction));
  return poseOfQuaternion(at, z < -1 + 1e-12 ? [1, 0, 0, 0] : [-y, x, 0, 1 + z]);
}
