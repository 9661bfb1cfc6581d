// Obstacles put elsewhere in the tables of the kernels: the same numbers as Python packs for them (scene_tables.py,
// solid_tables.py). Poses are 16 numbers row by row.
const column = (pose, k) => [pose[k], pose[4 + k], pose[8 + k]];
const largest = (values) => Math.max(...values.map(Math.abs));
const norm = (values) => Math.sqrt(values.reduce((sum, value) => sum + value * value, 0));
const single = new Float32Array(1);
const bits = new Int32Array(single.buffer);

/** The next number of single precision after a value, upwards or downwards. */
function nextFloat(value, up) {
  single[0] = value;
  if (single[0] === 0) bits[0] = up ? 1 : 0x80000001 | 0;
  else bits[0] += single[0] > 0 === up ? 1 : -1;
  return single[0];
}

/** What a primitive is for the kernels: its numbers, half the sides of its bounds, and how thick it is. */
function primitiveOf(kernels, obstacle, pose, grow) {
  const names = kernels.plan.names.table;
  const slackOf = (size) => kernels.plan.slack.primitive * (1 + largest(column(pose, 3)) + size);
  const { kind, half, length, margin } = obstacle;
  const [centre, z] = [column(pose, 3), column(pose, 2)];
  const beside = grow > 0 || kind === names.BALL || kind === names.CAPSULE ? margin : 0;
  if (kind === names.BOX) {
    const sides = half.map((h) => h + (grow * slackOf(norm(half)) + beside));
    const spread = [0, 1, 2].map((i) => [0, 1, 2].reduce((sum, k) => sum + Math.abs(pose[4 * i + k]) * sides[k], 0));
    return { numbers: [...centre, ...column(pose, 0), ...column(pose, 1), ...z, ...sides], spread, thickness: Math.min(...sides) };
  }
  if (kind === names.BALL) {
    const radius = obstacle.radius + grow * slackOf(obstacle.radius) + beside;
    return { numbers: [...centre, radius], spread: [radius, radius, radius], thickness: radius };
  }
  if (kind === names.CAPSULE) {
    const radius = obstacle.radius + grow * slackOf(obstacle.radius + length) + beside;
    const axis = z.map((value) => 2 * length * value);
    const share = length > 1e-9 ? 1 / axis.reduce((sum, value) => sum + value * value, 0) : 0;
    const end = centre.map((value, i) => value - 0.5 * axis[i]);
    return { numbers: [...end, ...axis, share, radius], spread: z.map((value) => length * Math.abs(value) + radius), thickness: radius };
  }
  const radius = obstacle.disc + grow * slackOf(obstacle.disc + length) + beside;
  const tall = length + grow * slackOf(radius + length) + beside;
  const spread = z.map((value) => tall * Math.abs(value) + radius * Math.sqrt(Math.max(1 - value * value, 0)));
  return { numbers: [...centre, ...z, tall, radius], spread, thickness: Math.min(radius, tall) };
}

/** Boxes around neighbours, of which one has moved. */
function placeBlock(kernels, table, row) {
  const [boxes, padded, blocks, count] = ["BOXES", "PADDED_COUNT", "BLOCK_BOXES", "BLOCK_COUNT"].map((name) => table.get(name));
  if (count === 0) return;
  const size = kernels.plan.names.table.BLOCK;
  const block = Math.floor(row / size);
  for (let side = 0; side < 6; side += 1) {
    const first = boxes / LANE_BYTES + side * padded + block * size;
    const own = kernels.floats.subarray(first, first + size);
    kernels.floats[blocks / LANE_BYTES + side * count + block] = side % 2 === 0 ? Math.min(...own) : Math.max(...own);
  }
}

function placePrimitive(kernels, tableName, obstacle, pose, grow) {
  const names = kernels.plan.names.table;
  const table = kernels.table(kernels.world.get(tableName), kernels.plan.names.primitives);
  const row = kernels.ints[table.get("OWN") / LANE_BYTES + obstacle.place];
  if (row < 0) return;
  const { numbers, spread, thickness } = primitiveOf(kernels, obstacle, pose, grow);
  const centre = column(pose, 3);
  const more = kernels.plan.slack.primitive * (1 + largest(centre) + Math.max(...spread));
  const shape = table.get("SHAPES") / LANE_BYTES + row * names.SHAPE_FLOATS;
  kernels.floats.fill(0, shape, shape + names.SHAPE_FLOATS);
  kernels.floats.set(numbers, shape);
  const [boxes, padded] = [table.get("BOXES") / LANE_BYTES, table.get("PADDED_COUNT")];
  for (let i = 0; i < 3; i += 1) {
    const [low, high] = thickness < 0 ? [kernels.plan.far, -kernels.plan.far] : [centre[i] - (spread[i] + more), centre[i] + (spread[i] + more)];
    kernels.floats[boxes + 2 * i * padded + row] = nextFloat(low, false);
    kernels.floats[boxes + (2 * i + 1) * padded + row] = nextFloat(high, true);
  }
  placeBlock(kernels, table, row);
}

/** The corners of an obstacle's core where it is. */
function placedCorners({ corners }, pose) {
  return corners.map((corner) => [0, 1, 2].map(
    (i) => pose[4 * i] * corner[0] + pose[4 * i + 1] * corner[1] + pose[4 * i + 2] * corner[2] + pose[4 * i + 3],
  ));
}

function placeSolid(kernels, obstacle, pose) {
  const names = kernels.plan.names.table;
  const table = kernels.table(kernels.world.get("STANDING_SOLIDS"), kernels.plan.names.solids);
  const span = table.get("SPANS") / LANE_BYTES + names.SPAN_INTS * obstacle.place;
  const solid = kernels.ints[span + names.AROUND_FIRST];
  const block = kernels.ints[table.get("SOLIDS") / LANE_BYTES + names.SOLID_INTS * solid + names.FIRST_BLOCK];
  const corners = placedCorners(obstacle, pose);
  const radius = obstacle.radius + obstacle.margin;
  const [low, high] = [Math.min, Math.max].map((pick) => [0, 1, 2].map((i) => pick(...corners.map((corner) => corner[i]))));
  const middle = low.map((value, i) => 0.5 * (value + high[i]));
  const away = Math.max(...corners.map((corner) => norm(corner.map((value, i) => value - middle[i]))));
  const slack = kernels.plan.slack.solid * (1 + largest(corners.flat()) + obstacle.disc + radius);
  const sizes = table.get("SIZES") / NUMBER_BYTES + names.SIZE_COUNT * solid;
  kernels.doubles.set([obstacle.disc, ...column(pose, 2), radius, slack, ...middle, away + obstacle.disc + radius], sizes);
  const lanes = kernels.plan.width;
  const first = table.get("CORNERS") / LANE_BYTES + 3 * lanes * block;
  for (let lane = 0; lane < Math.ceil(corners.length / lanes) * lanes; lane += 1) {
    const at = first + 3 * lanes * Math.floor(lane / lanes) + (lane % lanes);
    (corners[lane] ?? corners[0]).forEach((value, i) => { kernels.floats[at + i * lanes] = value; });
  }
}

/** Put an obstacle of the planner's list elsewhere, or make it another size, in the tables. */
function placeObstacle(kernels, obstacle, pose) {
  placePrimitive(kernels, "OUTER_PRIMITIVES", obstacle, pose, 1);
  placePrimitive(kernels, "INNER_PRIMITIVES", obstacle, pose, -1);
  placeSolid(kernels, obstacle, pose);
  kernels.touched.set(obstacle.name, partTouched(kernels.plan, obstacle, pose));
}
