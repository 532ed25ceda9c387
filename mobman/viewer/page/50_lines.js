// Lines with a width: tubes, that can be shown up to a point.
const SIDES = 6;
const CIRCLE = Array.from({ length: SIDES }, (_, k) => [Math.cos((2 * Math.PI * k) / SIDES), Math.sin((2 * Math.PI * k) / SIDES)]);

// points: x, y, z one after the other; colours: the same of red, green and blue, or null.
function tube(points, radius, colours, material) {
  const n = points.length / 3;
  const position = new Float32Array(3 * SIDES * n);
  const normal = new Float32Array(3 * SIDES * n);
  const colour = colours ? new Float32Array(3 * SIDES * n) : null;
  const tangent = new THREE.Vector3(1, 0, 0), step = new THREE.Vector3();
  const side = new THREE.Vector3(0, 0, 1), other = new THREE.Vector3();
  for (let i = 0; i < n; i++) {
    const [a, b] = [Math.max(i - 1, 0), Math.min(i + 1, n - 1)];
    step.set(points[3 * b] - points[3 * a], points[3 * b + 1] - points[3 * a + 1], points[3 * b + 2] - points[3 * a + 2]);
    if (step.lengthSq() > 1e-18) tangent.copy(step).normalize();
    side.addScaledVector(tangent, -side.dot(tangent)); // carried along, so that it does not twist
    if (side.lengthSq() < 1e-6) side.set(tangent.y, tangent.z, tangent.x).addScaledVector(tangent, -(tangent.y * tangent.x + tangent.z * tangent.y + tangent.x * tangent.z));
    side.normalize();
    other.crossVectors(tangent, side);
    for (let k = 0; k < SIDES; k++) {
      const c = CIRCLE[k][0], d = CIRCLE[k][1];
      const place = 3 * (SIDES * i + k);
      normal[place] = c * side.x + d * other.x;
      normal[place + 1] = c * side.y + d * other.y;
      normal[place + 2] = c * side.z + d * other.z;
      for (let j = 0; j < 3; j++) {
        position[place + j] = points[3 * i + j] + radius * normal[place + j];
        if (colour) colour[place + j] = colours[3 * i + j];
      }
    }
  }
  const index = new Uint32Array(6 * SIDES * Math.max(n - 1, 0));
  let w = 0;
  for (let i = 0; i + 1 < n; i++)
    for (let k = 0; k < SIDES; k++) {
      const a = SIDES * i + k, b = SIDES * i + ((k + 1) % SIDES);
      index[w++] = a;
      index[w++] = b;
      index[w++] = a + SIDES;
      index[w++] = b;
      index[w++] = b + SIDES;
      index[w++] = a + SIDES;
    }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(normal, 3));
  if (colour) geometry.setAttribute("color", new THREE.BufferAttribute(colour, 3));
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false; // parts of it may be far away or not finite
  return mesh;
}

// Show a tube up to its frame; one without end where frame is its last.
function showUpTo(mesh, frame) {
  mesh.geometry.setDrawRange(0, 6 * SIDES * frame);
}

// Errors as colours, from small to large.
const SCALE = ["#2b3a92", "#1c86c0", "#2fae7a", "#e9b92f", "#e2572b", "#9e0b23"];

function errorColour(error, [low, high]) {
  const place = error > 0 ? (Math.log10(error) - low) / (high - low) : 0;
  const x = Math.min(Math.max(Number.isNaN(place) ? 1 : place, 0), 1) * (SCALE.length - 1);
  const i = Math.min(Math.floor(x), SCALE.length - 2);
  return colourOf(SCALE[i]).lerp(colourOf(SCALE[i + 1]), x - i);
}

function errorColours(errors, decades) {
  const colours = new Float32Array(3 * errors.length);
  errors.forEach((error, i) => errorColour(error, decades).toArray(colours, 3 * i));
  return colours;
}
