// Cameras that move while something is played, and views that a person keeps. Points are in the world, z up.
const FOLLOWED = 0.12;  // of the film's time: over so much of it the followed point is averaged
const FOLLOW_NEAR = 0.6;  // of the overview's distance
const ORBIT_STEPS = 24;

/** Place the camera; meshcat's picture has y up. */
function placeCamera(eye, target, fov = 32) {
  const { camera, controls } = viewer;
  turnedByHand = true;  // the camera stays there when the picture's size changes
  Object.assign(camera, { fov, near: size / 200, far: size * 60 });
  camera.position.set(eye.x, eye.z, -eye.y);
  controls.target.set(target.x, target.z, -target.y);
  controls.update();
  camera.updateProjectionMatrix();
}

const tangentOf = (fov) => Math.tan((fov * Math.PI) / 360);

/** Once around everything, at the height of the overview. */
function orbit() {
  const first = new THREE.Vector3(...story.overview).normalize();
  const away = (share) => first.clone().applyAxisAngle(new THREE.Vector3(0, 0, 1), 2 * Math.PI * share);
  const eyes = Array.from({ length: ORBIT_STEPS }, (_, k) => fit(away(k / ORBIT_STEPS), tangentOf(32)));
  const distance = Math.max(...eyes.map(({ eye }, k) => eye.sub(centre).dot(away(k / ORBIT_STEPS))));
  return (share) => placeCamera(centre.clone().addScaledVector(away(share), distance), centre);
}

/** Beside the tip, whose way is smoothed. */
function follow() {
  const away = new THREE.Vector3(...story.overview).normalize();
  const { eye } = fit(away, tangentOf(32));
  const offset = away.clone().multiplyScalar(FOLLOW_NEAR * eye.sub(centre).dot(away));
  return (share) => {
    const around = Array.from({ length: 9 }, (_, k) => Math.min(Math.max(share + FOLLOWED * (k / 8 - 0.5), 0), 1));
    const target = around.reduce((sum, at) => sum.add(tipPosition(postureAt(total * at))), new THREE.Vector3()).multiplyScalar(1 / around.length);
    placeCamera(target.clone().add(offset), target);
  };
}

/** From view to view of a file, each at its time [s of the film]. */
function through(views, seconds) {
  const point = (values) => new THREE.Vector3(...values);
  return (share) => {
    const time = share * seconds;
    const after = views.findIndex((view) => view.time > time);
    const [a, b] = [views[after < 0 ? views.length - 1 : Math.max(after - 1, 0)], views[after < 0 ? views.length - 1 : after]];
    const way = b.time > a.time ? Math.min(Math.max((time - a.time) / (b.time - a.time), 0), 1) : 0;
    const eased = way * way * (3 - 2 * way);
    placeCamera(point(a.eye).lerp(point(b.eye), eased), point(a.target).lerp(point(b.target), eased), a.fov + (b.fov - a.fov) * eased);
  };
}

/** A camera by its name, or by the views of a file: a function that places it at a share of the film. */
function cameraOf(wanted, seconds) {
  if (typeof wanted !== "string") return through(wanted, seconds);
  if (wanted === "orbit") return orbit();
  if (wanted === "follow") return robot ? follow() : () => lookFrom("Overview");
  const name = Object.keys(VIEWPOINTS).find((each) => each.toLowerCase() === wanted);
  return () => lookFrom(story.planar && name === "Overview" ? "Top" : name);
}

/** The view as it is now, as a file that `rrtik show --film --camera FILE` reads. */
function viewText() {
  const { camera, controls } = viewer;
  const written = ({ x, y, z }) => `[${[x, -z, y].map((value) => value.toFixed(4)).join(", ")}]`;
  return `version: 1\nviews:\n  - {eye: ${written(camera.position)}, target: ${written(controls.target)}, fov_deg: ${camera.fov}}\n`;
}
