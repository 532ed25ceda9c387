// From descriptions of shapes to geometries and materials of three.js.
const CREASE = Math.cos((38 * Math.PI) / 180);

function geometryOf(shape) {
  switch (shape.type) {
    case "box":
      return new THREE.BoxGeometry(...shape.size);
    case "sphere":
      return new THREE.SphereGeometry(shape.radius, 40, 24);
    case "cylinder": // three's is along y, a URDF's along z
      return new THREE.CylinderGeometry(shape.radius, shape.radius, shape.length, 48).rotateX(Math.PI / 2);
    case "capsule":
      return capsuleGeometry(shape.radius, shape.length);
    case "mesh":
      return meshGeometry(shape);
    default:
      throw new Error(`unknown shape ${shape.type}`);
  }
}

function capsuleGeometry(radius, length) {
  const outline = [];
  for (let i = 0; i <= 16; i++) {
    const angle = -Math.PI / 2 + (Math.PI * i) / 16;
    const end = i < 8 ? -length / 2 : length / 2;
    if (i === 8) outline.push(new THREE.Vector2(radius, -length / 2));
    outline.push(new THREE.Vector2(Math.max(radius * Math.cos(angle), 0), end + radius * Math.sin(angle)));
  }
  return new THREE.LatheGeometry(outline, 40).rotateX(Math.PI / 2);
}

// Corners get the mean normal of those of their vertex's triangles that are not behind an edge.
function meshGeometry(shape) {
  const vertices = unpack(shape.vertices);
  const faces = unpack(shape.faces);
  const uv = unpack(shape.uv);
  const colours = unpack(shape.vertex_colours);
  const corners = faces.length;
  const normals = new Float32Array(corners); // of triangles, as long as they are large
  const units = new Float32Array(corners);
  for (let f = 0; f < corners; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = vertices[b] - vertices[a], uy = vertices[b + 1] - vertices[a + 1], uz = vertices[b + 2] - vertices[a + 2];
    const vx = vertices[c] - vertices[a], vy = vertices[c + 1] - vertices[a + 1], vz = vertices[c + 2] - vertices[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    const length = Math.sqrt(x * x + y * y + z * z) || 1;
    normals[f] = x;
    normals[f + 1] = y;
    normals[f + 2] = z;
    units[f] = x / length;
    units[f + 1] = y / length;
    units[f + 2] = z / length;
  }
  const first = new Uint32Array(vertices.length / 3 + 1);
  for (let i = 0; i < corners; i++) first[faces[i] + 1]++;
  for (let i = 1; i < first.length; i++) first[i] += first[i - 1];
  const around = new Uint32Array(corners); // the triangles of each vertex
  const filled = first.slice();
  for (let corner = 0; corner < corners; corner++) around[filled[faces[corner]]++] = corner - (corner % 3);
  // corners of one vertex with one normal are one: most of them
  const index = new Uint32Array(corners);
  const source = []; // the vertex of each
  const position = [], normal = [];
  const latest = new Int32Array(vertices.length / 3).fill(-1);
  const earlier = [];
  for (let corner = 0; corner < corners; corner++) {
    const vertex = faces[corner], own = corner - (corner % 3);
    let x = 0, y = 0, z = 0;
    for (let k = first[vertex]; k < first[vertex + 1]; k++) {
      const other = around[k];
      const alike = units[own] * units[other] + units[own + 1] * units[other + 1] + units[own + 2] * units[other + 2];
      if (alike >= CREASE) {
        x += normals[other];
        y += normals[other + 1];
        z += normals[other + 2];
      }
    }
    const length = Math.sqrt(x * x + y * y + z * z) || 1;
    x /= length;
    y /= length;
    z /= length;
    let same = latest[vertex];
    while (same >= 0 && normal[3 * same] * x + normal[3 * same + 1] * y + normal[3 * same + 2] * z < 0.999) same = earlier[same];
    if (same < 0) {
      same = source.length;
      source.push(vertex);
      earlier.push(latest[vertex]);
      latest[vertex] = same;
      position.push(vertices[3 * vertex], vertices[3 * vertex + 1], vertices[3 * vertex + 2]);
      normal.push(x, y, z);
    }
    index[corner] = same;
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setIndex(new THREE.BufferAttribute(index, 1));
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(normal), 3));
  if (uv) geometry.setAttribute("uv", new THREE.BufferAttribute(picked(uv, 2, source, 1), 2));
  if (colours) geometry.setAttribute("color", new THREE.BufferAttribute(picked(colours, 3, source, 255), 3));
  return geometry;
}

function picked(values, size, source, scale) {
  const result = new Float32Array(size * source.length);
  for (let i = 0; i < source.length; i++)
    for (let j = 0; j < size; j++) result[size * i + j] = values[size * source[i] + j] / scale;
  return result;
}

const textures = new Map();
const waited = [];

// Pictures are decoded when they are loaded; the page is ready when all of them are.
function textureOf(address) {
  if (!textures.has(address)) {
    const texture = new THREE.Texture();
    const image = new Image();
    waited.push(
      new Promise((resolve) => {
        image.onload = () => {
          texture.image = image;
          texture.needsUpdate = true;
          resolve();
        };
        image.onerror = resolve;
      })
    );
    image.src = address;
    texture.encoding = THREE.sRGBEncoding;
    textures.set(address, texture);
  }
  return textures.get(address);
}

function colourOf(values) {
  const colour = Array.isArray(values) ? new THREE.Color(values[0], values[1], values[2]) : new THREE.Color(values);
  return colour.convertSRGBToLinear();
}

// Colours of shapes may be tinted with a run's, so that its robot is known by it.
function materialOf(shape, colour, tint) {
  const options = { shininess: 24, specular: 0x1c1c1c, side: shape.open ? THREE.DoubleSide : THREE.FrontSide };
  const base = colourOf(colour);
  if (tint) {
    const light = 0.35 + 0.65 * Math.max(base.r, base.g, base.b); // dark and light parts stay so
    base.lerp(colourOf(tint).multiplyScalar(light), 0.78);
  }
  options.color = base.multiplyScalar(0.94); // so that white is not blinding
  if (shape.texture && !tint) {
    options.map = textureOf(shape.texture);
    options.color = new THREE.Color(1, 1, 1);
  } else if (shape.vertex_colours && !tint) {
    options.vertexColors = true;
    options.color = new THREE.Color(1, 1, 1);
  }
  if (colour[3] < 1) Object.assign(options, { transparent: true, opacity: colour[3] });
  return new THREE.MeshPhongMaterial(options);
}
