// A robot: groups, one for each joint, nested as the joints are; the shapes that they carry hang on them.
const KINDS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array, u2: Uint16Array, u4: Uint32Array };

// An array that Python packed as base64.
function unpack(packed) {
  if (!packed) return null;
  const bytes = Uint8Array.from(atob(packed.data), (character) => character.charCodeAt(0));
  const [rows, columns = 1] = packed.shape;
  return Object.assign(new KINDS[packed.kind](bytes.buffer), { rows, columns });
}

// Placements are written row by row; three.js takes them as arguments in that order.
const matrixOf = (rows) => new THREE.Matrix4().set(...rows);

// The geometry of a description, built once.
function geometryOf(shape) {
  return (shape.built ??= buildGeometry(shape));
}

function buildGeometry({ type, size, ...mesh }) {
  if (type === "box") return new THREE.BoxGeometry(...size);
  if (type === "sphere") return new THREE.SphereGeometry(size[0] / 2, 40, 24);
  if (type === "cylinder") // three's is along y, a URDF's along z
    return new THREE.CylinderGeometry(size[0] / 2, size[0] / 2, size[2], 48).rotateX(Math.PI / 2);
  const geometry = new THREE.BufferGeometry();
  const add = (name, values, count, normalized) =>
    values && geometry.setAttribute(name, new THREE.BufferAttribute(unpack(values), count, normalized));
  geometry.setIndex(new THREE.BufferAttribute(unpack(mesh.faces), 1));
  add("position", mesh.vertices, 3);
  add("uv", mesh.uv, 2);
  add("color", mesh.vertex_colours, 3, true);
  geometry.computeVertexNormals(); // vertices are apart where an edge is to be seen
  return geometry;
}

const textures = new Map();
const waited = [];

// Pictures are decoded when they are loaded; the page is ready when all of them are.
function textureOf(address) {
  if (!textures.has(address))
    waited.push(
      new Promise((resolve) => {
        const texture = new THREE.TextureLoader().load(address, resolve, undefined, resolve);
        texture.encoding = THREE.sRGBEncoding;
        textures.set(address, texture);
      })
    );
  return textures.get(address);
}

const colourOf = (...values) => new THREE.Color(...values).convertSRGBToLinear();

// Colours of shapes may be tinted with a run's, so that its robot is known by it.
function materialOf(shape, [red, green, blue, alpha], tint) {
  const color = colourOf(red, green, blue);
  if (tint) {
    const light = 0.35 + 0.65 * Math.max(color.r, color.g, color.b); // dark and light parts stay so
    color.lerp(colourOf(tint).multiplyScalar(light), 0.78);
  }
  color.multiplyScalar(0.94); // so that white is not blinding
  const side = shape.open ? THREE.DoubleSide : THREE.FrontSide;
  const options = { shininess: 24, specular: 0x1c1c1c, side, color, transparent: alpha < 1, opacity: alpha };
  if (!tint && (shape.texture || shape.vertex_colours)) {
    color.set(0xffffff);
    if (shape.texture) options.map = textureOf(shape.texture);
    else options.vertexColors = true;
  }
  return new THREE.MeshPhongMaterial(options);
}

// A material that is drawn over everything else.
const over = (color, opacity) =>
  new THREE.MeshBasicMaterial({ color, opacity, transparent: true, depthTest: false });

const COLLISION = new THREE.MeshBasicMaterial({ color: 0xd9480f, wireframe: true, transparent: true, opacity: 0.55 });

// Red, green and blue arrows along x, y and z.
function triad(length, radius) {
  const group = new THREE.Group();
  const outline = [[0, 0], [radius, 0], [radius, length], [2.4 * radius, length], [0, length + 6 * radius]];
  const arrow = new THREE.LatheGeometry(outline.map((point) => new THREE.Vector2(...point)), 14);
  const turns = [[0, 0, -Math.PI / 2], [0, 0, 0], [Math.PI / 2, 0, 0]];
  [0xd6336c, 0x2f9e44, 0x1c6dd0].forEach((colour, i) => {
    const [color, emissive] = [colourOf(colour), colourOf(colour).multiplyScalar(0.25)];
    const material = new THREE.MeshPhongMaterial({ color, emissive, flatShading: true });
    group.add(new THREE.Mesh(arrow, material));
    group.children[i].rotation.set(...turns[i]);
  });
  return group;
}

class Robot {
  constructor(description, geometries, tint) {
    this.description = description;
    this.root = new THREE.Group();
    this.q = Float64Array.from(description.rest);
    this.layers = { visual: [], collision: [], masses: [], frames: [], tip: [] };
    this.named = new Map();
    this.groups = [this.root];
    this.joints = description.joints.map((joint) => {
      const group = new THREE.Group();
      group.name = joint.name;
      group.matrixAutoUpdate = false;
      this.groups[joint.parent].add(group);
      this.groups.push(group);
      this.named.set(joint.name, group);
      return { ...joint, group, fixed: matrixOf(joint.placement), direction: new THREE.Vector3(...joint.axis) };
    });
    for (const { name, role, joint, placement, shape: index, colour } of description.parts) {
      const shape = geometries[index];
      const collision = role === "collision";
      const mesh = new THREE.Mesh(geometryOf(shape), collision ? COLLISION : materialOf(shape, colour, tint));
      mesh.castShadow = mesh.receiveShadow = !collision;
      mesh.userData = { role, joint, alpha: colour[3] };
      this.place(mesh, name, joint, matrixOf(placement), collision ? "collision" : "visual");
    }
    this.setConfiguration(this.q);
    this.measure();
    this.addMasses();
    this.addFrames();
    for (const layer of ["collision", "masses", "frames"]) this.show(layer, false);
  }

  place(object, name, joint, placement, layer) {
    object.name = name;
    object.matrixAutoUpdate = false;
    object.matrix.copy(placement);
    this.groups[joint].add(object);
    this.layers[layer].push(object);
    if (!this.named.has(name)) this.named.set(name, object);
  }

  measure() {
    this.root.updateMatrixWorld(true);
    const box = new THREE.Box3();
    for (const mesh of this.layers.visual) box.expandByObject(mesh);
    const size = box.getSize(new THREE.Vector3());
    this.height = box.isEmpty() ? 0.5 : Math.max(size.z, 0.05);
    this.extent = box.isEmpty() ? 1 : size.length();
  }

  addMasses() {
    const heaviest = Math.max(...this.description.masses.map((body) => body.mass));
    const ball = new THREE.SphereGeometry(1, 20, 14);
    for (const { mass, centre, joint } of this.description.masses) {
      const size = 0.035 * this.extent * Math.max(Math.cbrt(mass / heaviest), 0.15);
      const placement = new THREE.Matrix4().makeScale(size, size, size).setPosition(...centre);
      const name = `mass of ${this.description.joints[joint - 1].name}`;
      this.place(new THREE.Mesh(ball, over(0xc2255c, 0.7)), name, joint, placement, "masses");
    }
  }

  addFrames() {
    const size = 0.06 * this.extent;
    const still = new THREE.Matrix4();
    for (const { name, joint, placement } of this.description.frames)
      this.place(triad(size, 0.03 * size), name, joint, matrixOf(placement), "frames");
    this.joints.forEach(({ name }, i) => this.place(triad(size, 0.03 * size), `axes of ${name}`, i + 1, still, "frames"));
    const { joint, placement } = this.description.tip;
    this.place(triad(1.1 * size, 0.036 * size), "tip", joint, matrixOf(placement), "tip");
  }

  show(layer, visible) {
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
    for (const { q: index, turns, direction, axis, group, fixed } of this.joints) {
      const value = this.q[index];
      if (turns) move.makeRotationAxis(direction, value);
      else move.makeTranslation(...axis.map((part) => part * value));
      group.matrix.multiplyMatrices(fixed, move);
      group.matrixWorldNeedsUpdate = true;
    }
  }
}
