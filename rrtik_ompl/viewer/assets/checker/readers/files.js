// What a heap of files says: which is the certificate, the robot, the scene, the path, and what they refer to.

/**
 * What was given, {certificate, robot, srdf, scene, names, waypoints, timed, parts, padding, told}, each null if no file has it.
 *
 * `files` are {name, buffer} of all files that were named by themselves; `lookup(name, from)` returns the buffer of a
 * mesh or a cloud that the file `from` refers to, or null. `told` says in words which file was taken for what.
 */
function readFiles(files, lookup) {
  const found = { certificate: null, robot: null, srdf: null, scene: null, names: null, waypoints: null, timed: null, parts: null, padding: {}, told: [] };
  const take = (key, value, what, name) => {
    if (found[key] !== null) throw new Error(`${name}: a second ${what}; give one`);
    found[key] = value;
    found.told.push(`${what}: ${name}`);
  };

  for (const { name, buffer } of files) {
    const ending = name.slice(name.lastIndexOf(".") + 1).toLowerCase();
    if (ending === "json") readJsonFile(readJson(textOf(buffer), name), name, found, take, lookup);
    else if (["yaml", "yml"].includes(ending)) take("scene", sceneWithFiles(readScene(textOf(buffer), name), name, lookup), "scene", name);
    else if (ending === "srdf") take("srdf", readSrdf(textOf(buffer), name), "SRDF", name);
    else if (["urdf", "xml"].includes(ending)) {
      take("robot", withMeshes(readUrdf(textOf(buffer), name), (mesh) => readMesh(fileOf(mesh, name, lookup), mesh)), "robot", name);
    }
  }
  if (found.scene !== null) Object.assign(found, stanceOf(found.scene.robot, "robot"), { padding: paddingOf(found.scene.robot) });
  return found;
}

function readJsonFile(data, name, found, take, lookup) {
  if (["joint_path", "joint_motion", "joint_trajectory", "task_plan"].includes(data?.kind) && Object.hasOwn(data, "joint_names")) {
    found.names = listOf(data.joint_names, name).map((each) => words(each, `${name}: joint_names`));
  }
  if (data !== null && ["path_certificate", "task_certificate"].includes(data.kind)) take("certificate", data, "certificate", name);
  else if (data !== null && data.kind === "joint_path") {
    take("waypoints", data.waypoints, "path", name);
    if ((data.certificate ?? null) !== null) take("certificate", data.certificate, "certificate", name);
  } else if (data !== null && data.kind === "task_plan") {
    take("parts", partsOfPlan(data, name, lookup), "plan of a task", name);
  } else if (data !== null && data.kind === "joint_motion") {
    take("waypoints", data.waypoints, "motion", name);
    found.timed = { times: data.times, rates: data.rates };
  } else if (data !== null && data.kind === "joint_trajectory") {
    take("waypoints", data.points.map((point) => point.positions), "trajectory", name);
    found.timed = cubicsOf(data.points);
  } else if (data !== null && Object.hasOwn(data, "scene")) {
    take("scene", sceneWithFiles(sceneOf(data, name), name, lookup), "scene", name);
  } else throw new Error(`${name}: neither a certificate, nor a path, nor a scene`);
}

/** The cubics of a trajectory, {times, rates}: each reaches the velocity at the next point. */
function cubicsOf(points) {
  const times = points.map((point) => point.time_from_start);
  const rates = points.slice(1).map((next, k) => {
    const { positions, velocities, accelerations } = points[k];
    const h = times[k + 1] - times[k];
    const bends = accelerations ?? velocities.map((v, j) => (6 * (next.positions[j] - positions[j])) / h ** 2 - (4 * v + 2 * next.velocities[j]) / h);
    return [velocities, bends, velocities.map((v, j) => (2 * (next.velocities[j] - v - h * bends[j])) / h ** 2)];
  });
  return { times, rates };
}

function fileOf(name, from, lookup) {
  const buffer = lookup(name, from);
  if (buffer === null) throw new Error(`${from}: no file '${name}' here; give it too, or its folder`);
  return buffer;
}

/** Where a robot stands, which joints it holds, and its tip if that is named, by a problem or a plan: {held, base, tip}. */
function stanceOf(robot, where) {
  if (robot === null || typeof robot !== "object") return { held: {}, base: IDENTITY, tip: null };
  return { held: robot.locked ?? {}, base: posedBy(robot.base_pose ?? null, `${where}: base_pose`), tip: robot.tip ?? null };
}

/** The thickness that a problem file gives links: a number for all, or numbers by name. */
function paddingOf(robot) {
  if (robot === null || typeof robot !== "object") return {};
  if ((robot.scale ?? null) !== null) throw new Error("scale of links, in a problem file, is not known here");
  return robot.padding ?? {};
}

/** The scene with the meshes, clouds, heights and octrees of its files in place of their names. */
function sceneWithFiles(scene, from, lookup) {
  const loaded = (each) => ({ ...each, shape: shapeOfFile(each.shape, from, lookup) });
  return { ...scene, obstacles: scene.obstacles.map(loaded), attached: scene.attached.map(loaded) };
}

function shapeOfFile(shape, from, lookup) {
  if (!shape.kind.endsWith(" file")) return shape;
  const buffer = fileOf(shape.name, from, lookup);
  const kind = shape.kind.slice(0, -" file".length);
  if (kind === "mesh") {
    const { corners, triangles } = readMesh(buffer, shape.name);
    return { kind, corners: corners.map((corner) => scaled(corner, shape.scale[0])), triangles };
  }
  if (kind === "cloud") {
    const points = readPoints(buffer, shape.name).map((point) => point.map((value) => Math.fround(value * shape.scale)));
    return { kind: "points", points, radius: shape.radius ?? POINT_RADIUS };
  }
  if (kind === "heights") return { kind: "boxes", boxes: readHeights(buffer, shape.name, shape) };
  const cells = readOctree(buffer, shape.name).map(({ centre, side }) => ({ centre: scaled(centre, shape.scale), half: Array(3).fill((side * shape.scale) / 2) }));
  return { kind: "boxes", boxes: cells };
}

const POINT_RADIUS = 0.01; // [m] of a cloud whose file of the scene states none
