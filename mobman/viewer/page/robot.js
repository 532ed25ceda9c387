// Arrays that Python packed as base64.
const KINDS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };

function unpack(packed) {
  if (!packed) return null;
  const text = atob(packed.data);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
  const values = new KINDS[packed.kind](bytes.buffer);
  values.columns = packed.shape.length > 1 ? packed.shape[1] : 1;
  values.rows = packed.shape[0];
  return values;
}

// Placements are written row by row; three.js takes them as arguments in that order.
function matrixOf(rows) {
  return new THREE.Matrix4().set(...rows);
}

// A rigid placement as rows of numbers, for whoever asks from outside.
function rowsOf(matrix) {
  const e = matrix.elements;
  return [0, 1, 2, 3].map((row) => [0, 1, 2, 3].map((column) => e[4 * column + row]));
}
// From descriptions of shapes to geometries and materials of three.js.

function geometryOf(shape) {
  switch (shape.type) {
    case "box":
      return new THREE.BoxGeometry(...shape.size);
    case "sphere":
      return new THREE.SphereGeometry(shape.size[0] / 2, 40, 24);
    case "cylinder": // three's is along y, a URDF's along z
      return new THREE.CylinderGeometry(shape.size[0] / 2, shape.size[0] / 2, shape.size[2], 48).rotateX(Math.PI / 2);
    case "mesh":
      return meshGeometry(shape);
    default:
      throw new Error(`unknown shape ${shape.type}`);
  }
}

// Vertices are apart where an edge is to be seen, so that a vertex has the mean normal of its triangles.
function meshGeometry(shape) {
  const geometry = new THREE.BufferGeometry();
  const add = (name, values, size, normalized) =>
    values && geometry.setAttribute(name, new THREE.BufferAttribute(unpack(values), size, normalized));
  geometry.setIndex(new THREE.BufferAttribute(unpack(shape.faces), 1));
  add("position", shape.vertices, 3);
  add("uv", shape.uv, 2);
  add("color", shape.vertex_colours, 3, true);
  geometry.computeVertexNormals();
  return geometry;
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
// A robot: groups, one for each joint, nested as the joints are; what they carry hangs on them.
class Robot {
  constructor(description, geometries, tint) {
    this.description = description;
    this.root = new THREE.Group();
    this.root.name = description.name;
    this.q = Float64Array.from(description.rest);
    this.joints = [];
    this.layers = { visual: [], collision: [], masses: [], frames: [], tip: [] };
    this.named = new Map();
    const groups = [this.root];
    for (const joint of description.joints) {
      const group = new THREE.Group();
      group.name = joint.name;
      group.matrixAutoUpdate = false;
      groups[joint.parent].add(group);
      groups.push(group);
      this.joints.push({
        ...joint,
        group,
        fixed: matrixOf(joint.placement),
        direction: new THREE.Vector3(...joint.axis),
      });
      this.named.set(joint.name, group);
    }
    this.groups = groups;
    for (const part of description.parts) this.addPart(part, geometries, tint);
    this.setConfiguration(this.q);
    this.extent = this.measure();
    this.addMasses();
    this.addFrames();
    for (const layer of ["collision", "masses", "frames"]) this.show(layer, false);
  }

  addPart(part, geometries, tint) {
    const shape = geometries[part.shape];
    const collision = part.role === "collision";
    const mesh = new THREE.Mesh(collision ? NOTHING : builtGeometry(shape), collision ? COLLISION : materialOf(shape, part.colour, tint));
    mesh.castShadow = !collision;
    mesh.receiveShadow = !collision;
    this.place(mesh, part.name, part.joint, matrixOf(part.placement), collision ? "collision" : "visual");
    mesh.userData = { role: part.role, joint: part.joint, alpha: part.colour[3], shape };
  }

  place(object, name, joint, placement, layer) {
    object.name = name;
    object.matrixAutoUpdate = false;
    object.matrix.copy(placement);
    this.groups[joint].add(object);
    this.layers[layer].push(object);
    if (!this.named.has(name)) this.named.set(name, object);
    return object;
  }

  measure() {
    this.root.updateMatrixWorld(true);
    const box = new THREE.Box3();
    for (const mesh of this.layers.visual) box.expandByObject(mesh);
    const size = box.getSize(new THREE.Vector3());
    this.height = box.isEmpty() ? 0.5 : Math.max(size.z, 0.05);
    return box.isEmpty() ? 1 : size.length();
  }

  addMasses() {
    const heaviest = Math.max(...this.description.masses.map((body) => body.mass), 1e-9);
    const sphere = new THREE.SphereGeometry(1, 20, 14);
    for (const body of this.description.masses) {
      const size = 0.035 * this.extent * Math.max(Math.cbrt(body.mass / heaviest), 0.15);
      const mesh = new THREE.Mesh(sphere, over(new THREE.MeshBasicMaterial({ color: 0xc2255c, opacity: 0.7 })));
      const placement = new THREE.Matrix4().makeTranslation(...body.centre).scale(new THREE.Vector3(size, size, size));
      this.place(mesh, `mass of ${this.description.joints[body.joint - 1].name}`, body.joint, placement, "masses");
    }
  }

  addFrames() {
    const size = 0.06 * this.extent;
    const joints = this.description.joints.map((joint, i) => ({ name: `axes of ${joint.name}`, joint: i + 1, placement: null }));
    for (const frame of [...this.description.frames, ...joints]) {
      const axes = triad(size, 0.0035 * this.extent * 0.5);
      this.place(axes, frame.name, frame.joint, frame.placement ? matrixOf(frame.placement) : new THREE.Matrix4(), "frames");
    }
    const tip = this.description.tip;
    this.place(triad(1.1 * size, 0.0022 * this.extent), "tip", tip.joint, matrixOf(tip.placement), "tip");
  }

  show(layer, visible) {
    if (layer === "collision" && visible) // built when it is first looked at
      for (const mesh of this.layers.collision) mesh.geometry = builtGeometry(mesh.userData.shape);
    for (const object of this.layers[layer]) object.visible = visible;
  }

  // 1 is solid, less is a ghost.
  setOpacity(opacity) {
    for (const mesh of this.layers.visual) {
      mesh.material.opacity = mesh.userData.alpha * opacity;
      mesh.material.transparent = mesh.material.opacity < 1;
      mesh.receiveShadow = opacity === 1;
      mesh.material.needsUpdate = true;
    }
  }

  setConfiguration(q) {
    this.q.set(q);
    const move = new THREE.Matrix4();
    for (const joint of this.joints) {
      const value = this.q[joint.q];
      if (joint.turns) move.makeRotationAxis(joint.direction, value);
      else move.makeTranslation(joint.axis[0] * value, joint.axis[1] * value, joint.axis[2] * value);
      joint.group.matrix.multiplyMatrices(joint.fixed, move);
      joint.group.matrixWorldNeedsUpdate = true;
    }
  }
}

const NOTHING = new THREE.BufferGeometry();
const COLLISION = new THREE.MeshBasicMaterial({ color: 0xd9480f, wireframe: true, transparent: true, opacity: 0.55 });

function builtGeometry(shape) {
  if (!shape.built) shape.built = geometryOf(shape);
  return shape.built;
}

// Drawn over everything else.
function over(material) {
  material.depthTest = false;
  material.transparent = true;
  return material;
}

// Red, green and blue arrows along x, y and z.
function triad(length, radius) {
  const group = new THREE.Group();
  const shaft = new THREE.CylinderGeometry(radius, radius, length, 10).translate(0, length / 2, 0);
  const head = new THREE.ConeGeometry(2.4 * radius, 6 * radius, 14).translate(0, length + 3 * radius, 0);
  const turns = [[0, 0, -Math.PI / 2], [0, 0, 0], [Math.PI / 2, 0, 0]];
  [0xd6336c, 0x2f9e44, 0x1c6dd0].forEach((colour, i) => {
    const material = new THREE.MeshPhongMaterial({ color: colourOf(colour), emissive: colourOf(colour).multiplyScalar(0.25) });
    for (const geometry of [shaft, head]) {
      const mesh = new THREE.Mesh(geometry, material);
      mesh.rotation.set(...turns[i]);
      group.add(mesh);
    }
  });
  return group;
}
