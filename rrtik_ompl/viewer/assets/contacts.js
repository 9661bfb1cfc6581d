// Where bodies touch along the path: they are red while they do, and a ball marks the deepest place.
let contactShown = null;
const coloursBefore = new Map();  // of the meshes that are red now

/** The contact at a place, a number of a motion plus the share of it, or null. */
function contactAt(place) {
  return story.contacts.find((contact) => contact.begin <= place && place <= contact.end) ?? null;
}

function showContact(place) {
  const contact = contactAt(place);
  if (contact === contactShown) return;
  contactShown = contact;
  for (const [mesh, color] of coloursBefore) mesh.material.color.copy(color);
  coloursBefore.clear();
  for (const path of contact ? contact.nodes : []) {
    node(...path).traverse((mesh) => {
      if (!mesh.isMesh || coloursBefore.has(mesh)) return;
      coloursBefore.set(mesh, mesh.material.color.clone());
      mesh.material.color.set(story.colors.touching);
    });
  }
  viewer.set_object([...ROOT, "contact"], contact && contact.point ? contactBall(contact.point) : new THREE.Group());
  viewer.set_dirty();
}

/** A ball that is seen through everything. */
function contactBall(point) {
  const material = new THREE.MeshBasicMaterial({ color: story.colors.touching, depthTest: false, transparent: true });
  const ball = new THREE.Mesh(new THREE.SphereGeometry(0.008 * size, 24, 16), material);
  ball.position.set(...point);
  ball.renderOrder = 10;
  return ball;
}

/** The stretches of the bar below the picture in which bodies touch. */
function contactTicks(timeAt) {
  return story.contacts.map(({ begin, end }) => {
    const mark = make("i", { className: "contact" });
    mark.style.left = `${(100 * timeAt(begin)) / (total || 1)}%`;
    mark.style.width = `max(3px, ${(100 * (timeAt(end) - timeAt(begin))) / (total || 1)}%)`;
    return mark;
  });
}
