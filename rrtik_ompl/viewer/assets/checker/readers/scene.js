// Scenes of rrtik-ompl, in YAML or JSON: obstacles, attached objects, pairs that may touch, contacts.
const SHAPE_KINDS = ["box", "sphere", "cylinder", "capsule", "half_space", "polygon", "mesh", "cloud", "heights", "octree"];
const SHAPE_KEYS = [...SHAPE_KINDS, "height", "scale"];
const OBSTACLE_KEYS = ["name", "pose", "margin", "motion"];
const ATTACHED_KEYS = ["name", "pose", "margin", "link", "allow", "padding"];
const SETTING_KEYS = ["accuracy", "motion_resolution", "self_margin", "clearance", "inflation", "proving", "path_constraints"];
const PROBLEM_KEYS = ["version", "scene", "robot", "start", "goal", "planner", "run", ...SETTING_KEYS];

/** A scene of YAML text; see `sceneOf`. */
const readScene = (text, file) => sceneOf(readYaml(text, file), file);

/** A scene {obstacles, attached, allowed, contacts, constraints, selfMargin, robot} of data; `robot` is what a problem file says of it. */
function sceneOf(data, file) {
  only(data, PROBLEM_KEYS, file);
  if (data.version !== 1) throw new Error(`${file}: version: expected 1`);
  const scene = data.scene ?? {};
  only(scene, ["margin", "obstacles", "attached", "allowed_collisions", "contacts"], `${file}: scene`);
  const margin = notNegative(scene.margin ?? 0, `${file}: margin`);

  const obstacles = listOf(scene.obstacles, file).map((each) => {
    const where = `${file}: obstacle '${each.name}'`;
    only(each, [...OBSTACLE_KEYS, ...SHAPE_KEYS], where);
    const motion = motionOf(each.motion ?? null, where);
    const solid = namedSolid(each, where);
    // An obstacle whose poses are stated with times needs none of its own.
    const placement = motion !== null && motion.velocity === null && (each.pose ?? null) === null ? poseAt(motion, IDENTITY, 0) : solid.placement;
    return { ...solid, placement, motion, margin: notNegative(each.margin ?? margin, where) };
  });
  const attached = listOf(scene.attached, file).map((each) => {
    const where = `${file}: attached '${each.name}'`;
    only(each, [...ATTACHED_KEYS, ...SHAPE_KEYS], where);
    const padding = (each.padding ?? null) === null ? null : notNegative(each.padding, where);
    const allow = listOf(each.allow, where).map((name) => words(name, where));
    return { ...namedSolid(each, where), link: words(each.link, where), allow, padding, margin: notNegative(each.margin ?? 0, where) };
  });

  const names = [...obstacles, ...attached].map((each) => each.name);
  if (new Set(names).size !== names.length) throw new Error(`${file}: two obstacles or attached objects have one name`);
  return {
    obstacles,
    attached,
    allowed: listOf(scene.allowed_collisions, file).map((pair) => namePair(pair, file)),
    contacts: listOf(scene.contacts, file).map((each) => {
      only(each, ["pair", "distance"], `${file}: contact`);
      return { pair: namePair(each.pair, file), distance: finite(each.distance, `${file}: distance`) };
    }),
    constraints: readConstraints(data.path_constraints, file),
    selfMargin: notNegative(data.self_margin ?? 0, `${file}: self_margin`),
    robot: data.robot ?? null,
  };
}

/** How an obstacle moves: {velocity, times, poses}, of which velocity or the other two are there; null at rest. */
function motionOf(given, where) {
  if (given === null) return null;
  only(given, ["velocity", "waypoints"], `${where}: motion`);
  if ((given.velocity ?? null) !== null) return { velocity: numbersOf(given.velocity, 3, `${where}: velocity`), times: [], poses: [] };
  const stations = listOf(given.waypoints, where);
  const times = stations.map((each) => finite(each.time, `${where}: time`));
  if (times.length === 0 || times.some((time, k) => k > 0 && !(time > times[k - 1]))) throw new Error(`${where}: motion: times must increase`);
  return { velocity: null, times, poses: stations.map((each) => posedBy(each.pose, where)) };
}

function only(data, keys, where) {
  if (data === null || typeof data !== "object" || Array.isArray(data)) throw new Error(`${where}: expected keys with values`);
  for (const key of Object.keys(data)) if (!keys.includes(key)) throw new Error(`${where}: unknown key '${key}'`);
}

function listOf(value, where) {
  if ((value ?? null) === null) return [];
  if (!Array.isArray(value)) throw new Error(`${where}: expected a list`);
  return value;
}

function finite(value, where) {
  if (typeof value !== "number" || !Number.isFinite(value)) throw new Error(`${where}: expected a number`);
  return value;
}

function notNegative(value, where) {
  if (finite(value, where) < 0) throw new Error(`${where}: it must not be negative`);
  return value;
}

function words(value, where) {
  if (typeof value !== "string" || value === "") throw new Error(`${where}: expected a name`);
  return value;
}

function numbersOf(value, count, where) {
  const list = listOf(value, where).map((each) => finite(each, where));
  if (list.length !== count) throw new Error(`${where}: expected ${count} numbers`);
  return list;
}

function namePair(value, where) {
  const list = listOf(value, where).map((each) => words(each, where));
  if (list.length !== 2) throw new Error(`${where}: expected two names`);
  return list;
}

function posedBy(value, where) {
  if ((value ?? null) === null) return IDENTITY;
  only(value, ["xyz", "quat_xyzw", "quat_wxyz", "rpy_deg"], where);
  const given = ["quat_xyzw", "quat_wxyz", "rpy_deg"].filter((key) => (value[key] ?? null) !== null);
  if (given.length > 1) throw new Error(`${where}: give one orientation`);
  const at = numbersOf(value.xyz, 3, `${where}: xyz`);
  if (given.length === 0) return { ...IDENTITY, at };
  const list = numbersOf(value[given[0]], given[0] === "rpy_deg" ? 3 : 4, `${where}: ${given[0]}`);
  if (given[0] === "rpy_deg") return poseOfAngles(at, list.map((degrees) => (degrees * Math.PI) / 180));
  const [a, b, c, d] = list;
  return poseOfQuaternion(at, given[0] === "quat_xyzw" ? list : [b, c, d, a]);
}

function namedSolid(each, where) {
  return { name: words(each.name, where), placement: posedBy(each.pose, where), shape: sceneShape(each, where) };
}

/** The shape of an entry; of meshes, clouds, heights and octrees {kind: "... file", name, ...}. */
function sceneShape(each, where) {
  const kinds = SHAPE_KINDS.filter((key) => (each[key] ?? null) !== null);
  if (kinds.length !== 1) throw new Error(`${where}: expected one shape, found ${kinds.join(", ") || "none"}`);
  const [kind] = kinds;
  const given = each[kind];
  const sized = (key, source) => {
    const value = finite(source[key], `${where}: ${key}`);
    if (!(value > 0)) throw new Error(`${where}: ${key} must be greater than 0`);
    return value;
  };

  if (kind === "box") return { kind, half: numbersOf(given, 3, where).map((size) => size / 2) };
  if (kind === "sphere") return { kind, radius: sized("sphere", each) };
  if (kind === "cylinder" || kind === "capsule") {
    only(given, ["radius", "length"], where);
    return { kind, radius: sized("radius", given), half: sized("length", given) / 2 };
  }
  if (kind === "half_space") {
    only(given, ["normal", "offset"], where);
    const normal = numbersOf(given.normal, 3, where);
    const size = length(normal);
    if (!(size > 0)) throw new Error(`${where}: its normal is the zero vector`);
    return { kind, normal: scaled(normal, 1 / size), offset: finite(given.offset ?? 0, where) / size };
  }
  if (kind === "polygon") {
    const corners = listOf(given, where).map((point) => numbersOf(point, 2, where));
    return { kind, corners, height: sized("height", { height: 1, ...each }) };
  }
  if (kind === "mesh") return { kind: "mesh file", name: words(given, where), scale: Array(3).fill(finite(each.scale ?? 1, where)) };
  only(given, ["file", "radius", "scale", "invalid", "cell", "floor", "nodata"], where);
  return { ...given, kind: `${kind} file`, name: words(given.file, where), scale: finite(given.scale ?? 1, where) };
}
