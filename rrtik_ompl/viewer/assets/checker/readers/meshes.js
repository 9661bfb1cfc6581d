// Meshes of STL, OBJ and COLLADA files: {corners: [[x, y, z]], triangles: [[a, b, c]]}, in metres where the file says so.

/** The mesh in the bytes of a file, an ArrayBuffer; the name tells the format. Links often share files. */
const readMesh = once((buffer, file) => {
  const ending = file.slice(file.lastIndexOf(".") + 1).toLowerCase();
  const reader = { stl: readStl, obj: readObj, dae: readDae }[ending];
  if (reader === undefined) throw new Error(`${file}: unknown kind of mesh; have STL, OBJ, DAE`);
  const mesh = welded(reader(buffer, file));
  if (mesh.triangles.length === 0) throw new Error(`${file}: no triangles in it`);
  if (!mesh.corners.every((corner) => corner.every(Number.isFinite))) throw new Error(`${file}: a number is not finite`);
  if (!mesh.triangles.every((each) => each.every((k) => Number.isInteger(k) && k >= 0 && k < mesh.corners.length))) {
    throw new Error(`${file}: a triangle names a vertex that is not there`);
  }
  return mesh;
});

const textOf = (buffer) => new TextDecoder().decode(buffer);

/** The same mesh with each corner once, and without corners that no triangle has. */
function welded({ corners, triangles }) {
  const kept = [];
  // A table of their numbers at places that follow from the bits of their coordinates; -1 where none is.
  const places = new Int32Array(2 ** Math.ceil(Math.log2(2 * corners.length + 2))).fill(-1);
  const doubles = new Float64Array(3);
  const bits = new Uint32Array(doubles.buffer);
  const number = (k) => {
    const corner = corners[k];
    if (corner === undefined) return -1;
    let place = 0;
    for (let axis = 0; axis < 3; axis += 1) doubles[axis] = corner[axis] + 0; // -0 is 0
    for (let word = 0; word < 6; word += 1) place = Math.imul(place ^ bits[word] ^ (place >>> 15), 0x9e3779b1);

    for (place = (place ^ (place >>> 15)) & (places.length - 1); places[place] >= 0; place = (place + 1) & (places.length - 1)) {
      const [x, y, z] = kept[places[place]];
      if (x === corner[0] && y === corner[1] && z === corner[2]) return places[place];
    }
    places[place] = kept.length;
    kept.push(corner);
    return places[place];
  };
  const renumbered = triangles.map((each) => each.map(number));
  return { corners: kept, triangles: renumbered };
}

const inThrees = (values) => Array.from({ length: values.length / 3 }, (_, k) => values.slice(3 * k, 3 * k + 3));

function readStl(buffer, file) {
  const view = new DataView(buffer);
  const stated = buffer.byteLength >= 84 ? view.getUint32(80, true) : -1;
  const binary = buffer.byteLength === 84 + 50 * stated;
  if (!binary && /^\s*solid/i.test(textOf(buffer.slice(0, 200)))) {
    const values = [...textOf(buffer).matchAll(/\bvertex\s+(\S+)\s+(\S+)\s+(\S+)/gi)].map((found) => found.slice(1, 4).map(Number));
    if (values.length > 0 && values.length % 3 === 0) {
      return { corners: values, triangles: inThrees(values.map((_, k) => k)) };
    }
  }

  const room = Math.floor((buffer.byteLength - 84) / 50);
  const count = stated === 0 || stated === 2 ** 32 - 1 ? room : stated;
  if (!(count >= 0 && count <= room)) throw new Error(`${file}: it states ${count} triangles and holds ${Math.max(0, room)}`);
  const corners = [];
  for (let k = 0; k < count; k += 1) {
    for (let corner = 0; corner < 3; corner += 1) {
      const at = 84 + 50 * k + 12 + 12 * corner;
      corners.push([view.getFloat32(at, true), view.getFloat32(at + 4, true), view.getFloat32(at + 8, true)]);
    }
  }
  return { corners, triangles: inThrees(corners.map((_, k) => k)) };
}

/** Numbers of OBJ and COLLADA are taken in single precision, as assimp, which most programs use, takes them. */
const single = (words) => words.map((word) => Math.fround(Number(word)));

function readObj(buffer, file) {
  const corners = [];
  const triangles = [];
  for (const line of textOf(buffer).replace(/\\\r?\n/g, " ").split("\n")) {
    const [word, ...rest] = line.trim().split(/\s+/);
    if (word === "v") corners.push(single(rest.slice(0, 3)));
    if (word !== "f") continue;
    const face = rest.map((each) => {
      const number = Number(each.split("/")[0]);
      return number < 0 ? corners.length + number : number - 1;
    });
    if (face.length < 3) throw new Error(`${file}: a face with ${face.length} corners`);
    for (let k = 1; k + 1 < face.length; k += 1) triangles.push([face[0], face[k], face[k + 1]]);
  }
  return { corners, triangles };
}

function readDae(buffer, file) {
  const top = readXml(textOf(buffer), file);
  const byId = new Map();
  const learn = (each) => {
    if (each.attributes.id !== undefined) byId.set(each.attributes.id, each);
    each.children.forEach(learn);
  };
  learn(top);
  const named = (url) => {
    const found = byId.get((url ?? "").replace(/^#/, ""));
    if (found === undefined) throw new Error(`${file}: nothing has the id '${url}'`);
    return found;
  };

  const asset = element(top, "asset");
  const unit = asset === undefined ? undefined : element(asset, "unit");
  const metres = unit === undefined ? 1 : Number(unit.attributes.meter ?? "1");
  if (!(metres > 0)) throw new Error(`${file}: its unit must be greater than 0 metres`);

  const corners = [];
  const triangles = [];
  const place = (matrix, part) => {
    const first = corners.length;
    corners.push(...part.corners.map((corner) => scaled(carried(matrix, corner), metres)));
    triangles.push(...part.triangles.map((each) => each.map((k) => first + k)));
  };
  const walk = (node, around) => {
    const matrix = node.children.reduce((product, each) => multiplied(product, daeTransform(each, file)), around);
    for (const each of elements(node, "instance_geometry")) {
      for (const mesh of elements(named(each.attributes.url), "mesh")) {
        for (const part of daeParts(mesh, named, file)) place(matrix, part);
      }
    }
    for (const each of elements(node, "instance_node")) walk(named(each.attributes.url), matrix);
    for (const each of elements(node, "node")) walk(each, matrix);
  };

  const shown = element(top, "scene");
  const instance = shown === undefined ? undefined : element(shown, "instance_visual_scene");
  if (instance === undefined) throw new Error(`${file}: it shows no scene`);
  for (const node of elements(named(instance.attributes.url), "node")) walk(node, UNMOVED);
  return { corners, triangles };
}

const UNMOVED = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]];
const multiplied = (a, b) => a.map((row) => [0, 1, 2, 3].map((k) => row.reduce((sum, value, j) => sum + value * b[j][k], 0)));
const carried = (matrix, [x, y, z]) => matrix.slice(0, 3).map((row) => row[0] * x + row[1] * y + row[2] * z + row[3]);

function daeTransform(each, file) {
  const values = (count) => single(numbersIn(each.text, count, `${file}: <${each.name}>`));
  if (each.name === "matrix") {
    const rows = values(16);
    return [0, 1, 2, 3].map((k) => rows.slice(4 * k, 4 * k + 4));
  }
  if (each.name === "translate") {
    const at = values(3);
    return UNMOVED.map((row, k) => [...row.slice(0, 3), k < 3 ? at[k] : 1]);
  }
  if (each.name === "scale") {
    const sizes = [...values(3), 1];
    return UNMOVED.map((row, k) => row.map((value) => value * sizes[k]));
  }
  if (each.name === "rotate") {
    const [x, y, z, degrees] = values(4);
    const turn = turnAbout(scaled([x, y, z], 1 / Math.hypot(x, y, z)), (degrees * Math.PI) / 180);
    return [...turn.map((row) => [...row, 0]), [0, 0, 0, 1]];
  }
  if (["skew", "lookat"].includes(each.name)) throw new Error(`${file}: <${each.name}> is not known here`);
  return UNMOVED;
}

function* daeParts(mesh, named, file) {
  for (const kind of ["triangles", "polylist", "polygons"]) {
    for (const each of elements(mesh, kind)) {
      const inputs = elements(each, "input");
      const vertex = inputs.find((input) => input.attributes.semantic === "VERTEX");
      if (vertex === undefined) throw new Error(`${file}: <${kind}> without vertices`);
      const stride = 1 + Math.max(...inputs.map((input) => Number(input.attributes.offset)));
      const offset = Number(vertex.attributes.offset);

      const position = elements(named(vertex.attributes.source), "input").find((input) => input.attributes.semantic === "POSITION");
      const source = named(position === undefined ? "" : position.attributes.source);
      const floats = element(source, "float_array");
      const values = single(numbersIn(floats === undefined ? "" : floats.text, undefined, file));
      const technique = element(source, "technique_common");
      const accessor = technique === undefined ? undefined : element(technique, "accessor");
      const step = Number((accessor === undefined ? undefined : accessor.attributes.stride) ?? "3");
      const corners = Array.from({ length: Math.floor(values.length / step) }, (_, k) => values.slice(step * k, step * k + 3));

      const lists = elements(each, "p").map((list) => numbersIn(list.text, undefined, file));
      const counted = element(each, "vcount");
      const counts = counted === undefined ? null : numbersIn(counted.text, undefined, file);
      const faces = lists.flatMap((list) => {
        const numbers = Array.from({ length: Math.floor(list.length / stride) }, (_, k) => list[stride * k + offset]);
        if (kind === "triangles") return inThrees(numbers);
        if (kind === "polygons") return [numbers];
        let at = 0;
        return (counts ?? []).map((count) => numbers.slice(at, (at += count)));
      });
      const triangles = faces.flatMap((face) => Array.from({ length: Math.max(0, face.length - 2) }, (_, k) => [face[0], face[k + 1], face[k + 2]]));
      yield { corners, triangles };
    }
  }
  for (const kind of ["tristrips", "trifans"]) {
    if (elements(mesh, kind).length > 0) throw new Error(`${file}: <${kind}> is not known here`);
  }
}
