// Section 10: certificates of tasks, whose parts are certificates of their motions.
const SAME_PLACE = 1e-6; // [m], and of entries of rotations: how far things may seem to jump between two parts

/** Verify a certificate of a path or of a task, the value of its JSON; see `checkCertificate`. */
function checkAnyCertificate(file, own) {
  const isTask = isObject(file) && file.kind === "task_certificate";
  return isTask ? checkTask(file, own) : checkCertificate(file, own);
}

/** Verify a certificate of a task. `own.parts` are {scene, waypoints, held, base, padding} of the asker's plan, null without one. */
function checkTask(file, own) {
  try {
    checkKeys(file, ["kind", "version", "parts"], [], "certificate");
    demand(file.version === VERSION, `version ${file.version} is not known here`);
    demand(Array.isArray(file.parts) && file.parts.length > 0 && file.parts.length <= MOST.parts, "parts: expected a list, not too long");
    const asked = own.parts ?? null;
    demand(own.scene === null && own.waypoints === null, "it is of a task: give the plan of the task in place of a scene or a path");
    demand(asked === null || asked.length === file.parts.length, `it has ${file.parts.length} parts, and the task ${asked?.length}`);

    const facts = file.parts.map((part, k) => {
      const given = asked === null ? own : { ...own, ...asked[k] };
      const verdict = checkCertificate(part, given);
      demand(verdict.holds, `part ${k + 1}: ${verdict.fault}`);
      return verdict.facts;
    });
    file.parts.slice(1).forEach((part, k) => checkJunction(file.parts[k], part, `from part ${k + 1} to the next`));
    const unchecked = facts.flatMap((each) => each.unchecked);
    const different = [...new Map(unchecked.map((pair) => [pair.join(" "), pair])).values()];
    return { holds: true, fault: "", facts: { ...facts[0], tips: [...new Set(facts.flatMap((each) => each.tips))], pairs: facts.reduce((sum, each) => sum + each.pairs, 0), unchecked: different } };
  } catch (error) {
    if (error instanceof Fault) return { holds: false, fault: error.message, facts: null };
    throw error;
  }
}

/** A part begins where the one before ends, with the same joints, and all things are where they were left. */
function checkJunction(one, other, where) {
  const named = (part) => JSON.stringify(part.joints.map(({ name, gain }) => [name, gain]));
  demand(named(one) === named(other), `${where}: the joints are others`);
  demand(near(one.waypoints[one.waypoints.length - 1], other.waypoints[0]), `${where}: the arm jumps`);
  const [before, after] = [placesOf(one, one.waypoints.length - 1), placesOf(other, 0)];
  for (const name of [...before.keys(), ...after.keys()]) {
    demand(before.has(name) && after.has(name), `${where}: a thing comes or goes: ${name}`);
    const [was, is] = [before.get(name), after.get(name)];
    demand(near(was.pose, is.pose, SAME_PLACE), `${where}: a thing jumps: ${name}`);
    demand(was.shape === is.shape, `${where}: a thing changes its shape: ${name}`);
  }
}

/** Poses in the world and shapes of the bodies of obstacles and attached objects at a waypoint, by name and number. */
function placesOf(part, waypoint) {
  const joints = statedJoints(part);
  const tracks = (part.tracks ?? []).map((track) => poseOf(track[waypoint]));
  const frames = [...jointFrames(joints, jointValues(joints, part.waypoints[waypoint])), ...tracks];
  const things = part.bodies.filter((body) => body.kind !== "link");
  return new Map(things.map((body) => [`${body.name} ${body.number}`, { pose: poseNumbers(chained(frames[body.joint], poseOf(body.pose))), shape: JSON.stringify(body.shape) }]));
}
