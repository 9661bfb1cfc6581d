// URDF and SRDF: the tree of links and joints, the solids of links, and the pairs of links that are never compared.
const MOVING = ["revolute", "continuous", "prismatic"];
const HELD_STILL = ["fixed", "floating", "planar"];
const THIN = 1e-4; // [m] taken for a size of 0 of a solid that has other sizes

/**
 * A robot {name, links, joints, solids, meshes} of URDF text.
 *
 * A joint has {name, kind, parent, child, placement, axis, lower, upper, follows}, a solid {link, placement, shape};
 * a shape of a mesh is {kind: "mesh file", name, scale} until `withMeshes` has put the mesh in its place.
 */
function readUrdf(text, file) {
  const top = readXml(text, file);
  if (top.name !== "robot") throw new Error(`${file}: the top element is <${top.name}>, expected <robot>`);

  const links = elements(top, "link").map((each) => needed(each, "name", file));
  const joints = elements(top, "joint").map((each) => jointOf(each, file));
  const names = [...links, ...joints.map((joint) => joint.name)];
  if (new Set(links).size !== links.length || new Set(joints.map((joint) => joint.name)).size !== joints.length) {
    throw new Error(`${file}: a link or joint has the name of another one`);
  }
  for (const joint of joints) {
    for (const link of [joint.parent, joint.child]) {
      if (!links.includes(link)) throw new Error(`${file}: joint '${joint.name}': no link '${link}'`);
    }
    if (joints.some((other) => other !== joint && other.child === joint.child)) {
      throw new Error(`${file}: link '${joint.child}' has two parents`);
    }
  }
  if (names.length === 0) throw new Error(`${file}: a robot without links`);

  const solids = elements(top, "link").flatMap((each) => linkSolids(each, file));
  return { name: top.attributes.name ?? "", links, joints, solids };
}

function needed(each, key, file) {
  const value = each === undefined ? "" : each.attributes[key] ?? "";
  if (value === "") throw new Error(`${file}: <${each === undefined ? "?" : each.name}> has no ${key}`);
  return value;
}

function attributeNumbers(each, key, fallback, file) {
  const text = each === undefined ? undefined : each.attributes[key];
  if (text === undefined && fallback === undefined) throw new Error(`${file}: <${each.name}> has no ${key}`);
  return text === undefined ? fallback : numbersIn(text, fallback === undefined ? undefined : fallback.length, `${file}: ${key}`);
}

function originOf(each, file) {
  const origin = element(each, "origin");
  return poseOfAngles(attributeNumbers(origin, "xyz", [0, 0, 0], file), attributeNumbers(origin, "rpy", [0, 0, 0], file));
}

function jointOf(each, file) {
  const name = needed(each, "name", file);
  const where = `${file}: joint '${name}'`;
  const type = needed(each, "type", where);
  if (!MOVING.includes(type) && !HELD_STILL.includes(type)) throw new Error(`${where}: unknown type '${type}'`);
  const kind = MOVING.includes(type) ? type : "fixed";

  const axis = kind === "fixed" ? [1, 0, 0] : attributeNumbers(element(each, "axis"), "xyz", [1, 0, 0], where);
  const size = length(axis);
  if (size < 1e-9) throw new Error(`${where}: its axis is the zero vector`);

  const mimic = kind === "fixed" ? undefined : element(each, "mimic");
  const follows = mimic === undefined ? null : {
    joint: needed(mimic, "joint", where),
    multiplier: attributeNumbers(mimic, "multiplier", [1], where)[0],
    offset: attributeNumbers(mimic, "offset", [0], where)[0],
  };

  const limit = element(each, "limit");
  const bounded = kind === "revolute" || kind === "prismatic";
  if (bounded && limit === undefined) throw new Error(`${where}: it needs a <limit>`);
  const [lower] = bounded ? attributeNumbers(limit, "lower", [0], where) : [-Infinity];
  const [upper] = bounded ? attributeNumbers(limit, "upper", [0], where) : [Infinity];

  return {
    name,
    kind,
    parent: needed(element(each, "parent"), "link", where),
    child: needed(element(each, "child"), "link", where),
    placement: originOf(each, where),
    axis: scaled(axis, 1 / size),
    lower,
    upper,
    follows,
  };
}

function linkSolids(each, file) {
  const link = each.attributes.name;
  const where = `${file}: link '${link}'`;
  // Pinocchio's word for a cylinder with round caps.
  const capped = elements(each, "collision_checking").flatMap((list) => elements(list, "capsule").map((one) => one.attributes.name ?? ""));
  return elements(each, "collision").flatMap((collision) => {
    const geometry = element(collision, "geometry");
    if (geometry === undefined || geometry.children.length !== 1) throw new Error(`${where}: <collision> needs one shape`);
    const shape = urdfShape(geometry.children[0], capped.includes(collision.attributes.name ?? ""), where);
    return shape === null ? [] : [{ link, placement: originOf(collision, where), shape }];
  });
}

function urdfShape(each, capped, where) {
  const sizes = (key, count) => numbersIn(needed(each, key, where), count, `${where}: ${key}`);
  const one = (key) => sizes(key, 1)[0];
  if (each.name === "mesh") {
    const scale = attributeNumbers(each, "scale", [1, 1, 1], where);
    return { kind: "mesh file", name: needed(each, "filename", where), scale };
  }

  const given = { box: () => sizes("size", 3), sphere: () => [one("radius")], cylinder: () => [one("radius"), one("length")], capsule: () => [one("radius"), one("length")] }[each.name];
  if (given === undefined) throw new Error(`${where}: unknown shape <${each.name}>`);
  const found = given();
  if (found.every((size) => size === 0)) return null;
  if (found.some((size) => size < 0)) throw new Error(`${where}: a size is negative`);
  const [a, b, c] = found.map((size) => (size === 0 ? THIN : size));

  if (each.name === "box") return { kind: "box", half: [a / 2, b / 2, c / 2] };
  if (each.name === "sphere") return { kind: "sphere", radius: a };
  return { kind: each.name === "capsule" || capped ? "capsule" : "cylinder", radius: a, half: b / 2 };
}

const shapesOfMesh = once(() => new Map()); // by scale

function meshShape(mesh, scale) {
  const known = shapesOfMesh(mesh);
  const key = scale.join(" ");
  const corners = () => mesh.corners.map((corner) => [corner[0] * scale[0], corner[1] * scale[1], corner[2] * scale[2]]);
  if (!known.has(key)) known.set(key, { kind: "mesh", corners: corners(), triangles: mesh.triangles });
  return known.get(key);
}

/** The robot with each "mesh file" replaced by what `meshOf(name)` returns: {corners, triangles}. */
function withMeshes(robot, meshOf) {
  const solids = robot.solids.map((solid) => {
    if (solid.shape.kind !== "mesh file") return solid;
    return { ...solid, shape: meshShape(meshOf(solid.shape.name), solid.shape.scale) };
  });
  return { ...robot, solids };
}

/** What an SRDF says: {name, never: pairs of links that are never compared, disabled: links compared only if enabled}. */
function readSrdf(text, file) {
  const top = readXml(text, file);
  if (top.name !== "robot") throw new Error(`${file}: the top element is <${top.name}>, expected <robot>`);
  const pairs = (name) => elements(top, name).map((each) => [needed(each, "link1", file), needed(each, "link2", file)]);
  return {
    name: top.attributes.name ?? "",
    never: pairs("disable_collisions"),
    enabled: pairs("enable_collisions"),
    disabled: elements(top, "disable_default_collisions").map((each) => needed(each, "link", file)),
  };
}
