// A robot: groups, one for each joint, nested as the joints are; the shapes that they carry hang on them.
const KINDS = { f8: Float64Array, f4: Float32Array, u1: Uint8Array, u4: Uint32Array };

// An array that Python packed as base64.
function unpack(packed) {
  if (!packed) return null;
  const bytes = Uint8Array.from(atob(packed.data), (character) => character.charCodeAt(0));
  const [rows, columns = 1] = packed.shape;
  return Object.assign(new KINDS[packed.kind](bytes.buffer), { rows, columns });
}

// Placements are written row by row; three.js takes them as arguments in that order.
const matrixOf = (rows) => new THREE.Matrix4().set(...rows);

const CREASE = Math.cos((38 * Math.PI) / 180); // triangles that meet at a larger angle meet at an edge

// Triangles with a normal for each corner: the mean of those around it that no edge separates.
function meshGeometry({ vertices, faces: packedFaces, uv, vertex_colours: colours }) {
  const indexed = new THREE.BufferGeometry();
  const faces = unpack(packedFaces);
  const add = (name, values, size, normalized) =>
    values && indexed.setAttribute(name, new THREE.BufferAttribute(unpack(values), size, normalized));
  indexed.setIndex(new THREE.BufferAttribute(faces, 1));
  add("position", vertices, 3);
  add("uv", uv, 2);
  add("color", colours, 3, true);
  const geometry = indexed.toNonIndexed();
  const { position } = geometry.attributes;
  const corner = (i) => new THREE.Vector3().fromBufferAttribute(position, i);
  const around = [];
  const triangles = Array.from({ length: faces.length / 3 }, (_, i) => {
    const triangle = new THREE.Triangle(corner(3 * i), corner(3 * i + 1), corner(3 * i + 2));
    const found = { normal: triangle.getNormal(new THREE.Vector3()), area: triangle.getArea() };
    for (let j = 0; j < 3; j++) (around[faces[3 * i + j]] ??= []).push(found);
    return found;
  });
  const normals = new Float32Array(position.array.length);
  faces.forEach((vertex, i) => {
    const own = triangles[Math.floor(i / 3)].normal;
    const sum = new THREE.Vector3();
    for (const { normal, area } of around[vertex]) if (normal.dot(own) >= CREASE) sum.addScaledVector(normal, area);
    sum.normalize().toArray(normals, 3 * i);
  });
  return geometry.setAttribute("normal", new THREE.BufferAttribute(normals, 3));
}

function geometryOf({ type, size, ...mesh }) {
  if (type === "box") return new THREE.BoxGeometry(...size);
  if (type === "sphere") return new THREE.SphereGeometry(size[0] / 2, 40, 24);
  if (type === "mesh") return meshGeometry(mesh);
  // three's is along y, a URDF's along z
  return new THREE.CylinderGeometry(size[0] / 2, size[0] / 2, size[2], 48).rotateX(Math.PI / 2);
}

const colourOf = (...values) => new THREE.Color(...values).convertSRGBToLinear();
const styled = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const waited = []; // pictures to be decoded before the page is ready

// Colours of shapes may be tinted with a run's, so that its robot is known by it.
function materialOf(shape, [red, green, blue, opacity], tint) {
  const color = colourOf(red, green, blue);
  if (tint) {
    const light = 0.35 + 0.65 * Math.max(color.r, color.g, color.b); // dark and light parts stay so
    color.lerp(colourOf(tint).multiplyScalar(light), 0.78);
  }
  color.multiplyScalar(0.94); // so that white is not blinding
  const side = shape.type === "mesh" ? THREE.DoubleSide : THREE.FrontSide; // meshes may be open
  const look = { shininess: 24, specular: 0x1c1c1c, side, transparent: opacity < 1, opacity };
  const material = new THREE.MeshPhongMaterial({ ...look, color });
  if (tint || !(shape.texture || shape.vertex_colours)) return material;
  material.color.set(0xffffff);
  material.vertexColors = !shape.texture;
  if (shape.texture) {
    shape.picture ??= new THREE.TextureLoader().loadAsync(shape.texture);
    const use = (map) => {
      map.encoding = THREE.sRGBEncoding;
      Object.assign(material, { map, needsUpdate: true });
    };
    waited.push(shape.picture.then(use, () => {}));
  }
  return material;
}

// Draw a material in stripes of the screen alone: x is which of y it has, z is their width (px).
function striped(material, stripe) {
  material.onBeforeCompile = (shader) => {
    shader.uniforms.stripe = stripe;
    const test = "if (stripe.y > 1.5 && floor(mod(floor((gl_FragCoord.x + gl_FragCoord.y) / stripe.z), stripe.y) + 0.5) != stripe.x) discard;";
    shader.fragmentShader = `uniform vec3 stripe;\n${shader.fragmentShader.replace("void main() {", `void main() {\n${test}`)}`;
  };
  return material;
}

// A material that is drawn over everything else.
const over = (color, opacity) =>
  new THREE.MeshBasicMaterial({ color, opacity, transparent: true, depthTest: false });

const COLLISION = new THREE.MeshBasicMaterial({ color: 0xd9480f, wireframe: true, transparent: true, opacity: 0.55 });

const BEYOND = colourOf(0xe03131);

// Red, green and blue arrows along x, y and z.
function triad(length, radius) {
  const group = new THREE.Group();
  const outline = [[0, 0], [radius, 0], [radius, length], [2.4 * radius, length], [0, length + 6 * radius]];
  const arrow = new THREE.LatheGeometry(outline.map((point) => new THREE.Vector2(...point)), 14);
  const turns = [[0, 0, -Math.PI / 2], [0, 0, 0], [Math.PI / 2, 0, 0]];
  [0xd6336c, 0x2f9e44, 0x1c6dd0].forEach((colour, i) => {
    const [color, emissive] = [colourOf(colour), colourOf(colour).multiplyScalar(0.25)];
    const arrowOf = new THREE.Mesh(arrow, new THREE.MeshPhongMaterial({ color, emissive, flatShading: true }));
    arrowOf.rotation.set(...turns[i]);
    group.add(arrowOf);
  });
  return group;
}

class Robot {
  constructor(description, geometries, tint) {
    this.description = description;
    this.root = new THREE.Group();
    this.stripe = { value: new THREE.Vector3(0, 1, 1) }; // all of it
    this.q = Float64Array.from(description.rest);
    this.layers = { visual: [], collision: [], masses: [], frames: [], tip: [] };
    this.named = new Map();
    this.groups = [this.root];
    this.joints = description.joints.map((joint) => {
      const group = Object.assign(new THREE.Group(), { name: joint.name, matrixAutoUpdate: false });
      this.groups[joint.parent].add(group);
      this.groups.push(group);
      this.named.set(joint.name, group);
      const direction = new THREE.Vector3(...joint.axis);
      return { ...joint, group, fixed: matrixOf(joint.placement), direction, beyond: false };
    });
    for (const part of description.parts) {
      const shape = geometries[part.shape];
      const collision = part.role === "collision";
      shape.built ??= geometryOf(shape);
      const mesh = new THREE.Mesh(shape.built, collision ? COLLISION : striped(materialOf(shape, part.colour, tint), this.stripe));
      mesh.castShadow = mesh.receiveShadow = !collision;
      mesh.userData = { role: part.role, joint: part.joint, alpha: part.colour[3] };
      if (!collision) mesh.userData.colour = mesh.material.color.clone();
      this.place(mesh, part, collision ? "collision" : "visual");
    }
    this.setConfiguration(this.q);
    this.root.updateMatrixWorld(true);
    const box = new THREE.Box3();
    for (const mesh of this.layers.visual) box.expandByObject(mesh);
    const size = box.getSize(new THREE.Vector3());
    this.height = box.isEmpty() ? 0.5 : Math.max(size.z, 0.05);
    this.extent = box.isEmpty() ? 1 : size.length();
    this.addMasses();
    this.addFrames();
    for (const layer of ["collision", "masses", "frames"]) this.show(layer, false);
  }

  place(object, { name, joint, placement }, layer) {
    object.name = name;
    object.matrixAutoUpdate = false;
    object.matrix.copy(matrixOf(placement));
    this.groups[joint].add(object);
    this.layers[layer].push(object);
    if (!this.named.has(name)) this.named.set(name, object);
  }

  addMasses() {
    const { masses, joints } = this.description;
    const heaviest = Math.max(...masses.map((body) => body.mass));
    for (const { mass, centre: [x, y, z], joint } of masses) {
      const size = 0.035 * this.extent * Math.max(Math.cbrt(mass / heaviest), 0.15);
      const ball = new THREE.Mesh(new THREE.SphereGeometry(size, 20, 14), over(0xc2255c, 0.7));
      const placement = [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];
      this.place(ball, { name: `mass of ${joints[joint - 1].name}`, joint, placement }, "masses");
    }
  }

  addFrames() {
    const { frames, joints, tip } = this.description;
    const size = 0.06 * this.extent;
    const still = new THREE.Matrix4().toArray();
    const axes = joints.map(({ name }, i) => ({ name: `axes of ${name}`, joint: i + 1, placement: still }));
    for (const frame of [...frames, ...axes]) this.place(triad(size, 0.03 * size), frame, "frames");
    this.place(triad(1.1 * size, 0.036 * size), { ...tip, name: "tip" }, "tip");
  }

  show(layer, visible) {
    for (const object of this.layers[layer]) object.visible = visible;
  }

  // 1 is solid, less is a ghost.
  setOpacity(opacity) {
    for (const mesh of this.layers.visual) {
      const shown = mesh.userData.alpha * opacity;
      Object.assign(mesh.material, { opacity: shown, transparent: shown < 1, needsUpdate: true });
      mesh.receiveShadow = opacity === 1;
    }
  }

  setConfiguration(q) {
    this.q.set(q);
    const move = new THREE.Matrix4();
    for (const joint of this.joints) {
      const { q: index, turns, direction, axis, group, fixed } = joint;
      const value = this.q[index];
      this.mark(joint, value);
      if (turns) move.makeRotationAxis(direction, value);
      else move.makeTranslation(...axis.map((part) => part * value));
      group.matrix.multiplyMatrices(fixed, move);
      group.matrixWorldNeedsUpdate = true;
    }
  }

  // What a joint beyond its limits carries is red.
  mark(joint, value) {
    const [lower, upper] = joint.limits;
    const beyond = (lower !== null && value < lower) || (upper !== null && value > upper);
    if (beyond === joint.beyond) return;
    joint.beyond = beyond;
    for (const { material, userData } of joint.group.children.filter((child) => child.userData.colour))
      material.color.copy(beyond ? BEYOND : userData.colour);
  }

  // The corners of the boxes about everything that it is drawn with, in a group's frame.
  corners(group) {
    group.updateWorldMatrix(true, true);
    return this.layers.visual.flatMap((mesh) => {
      if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
      const { min, max } = mesh.geometry.boundingBox;
      return Array.from({ length: 8 }, (_, i) => {
        const corner = new THREE.Vector3(i & 1 ? max.x : min.x, i & 2 ? max.y : min.y, i & 4 ? max.z : min.z);
        return group.worldToLocal(mesh.localToWorld(corner));
      });
    });
  }
}
