// The stage: MeshCat's viewer with light, ground, axes and a camera that has everything in view.
class Stage {
  constructor(pane, [low, high]) {
    const renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    renderer.outputEncoding = THREE.sRGBEncoding;
    pane.appendChild(renderer.domElement);
    this.viewer = new MeshCat.Viewer(pane, false, renderer);
    for (const path of ["Lights", "Grid", "Axes"]) this.viewer.set_property([path], "visible", false);
    this.viewer.scene.fog = new THREE.Fog();
    this.root = new THREE.Group();
    this.viewer.set_object(["mobman"], this.root);
    this.box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    this.centre = this.box.getCenter(new THREE.Vector3());
    this.radius = Math.max(0.5 * this.box.getSize(new THREE.Vector3()).length(), 0.25);
    this.addLights();
    this.addGround();
    // shadows cost half of the time where there is no graphics card
    const context = renderer.getContext();
    const names = context.getExtension("WEBGL_debug_renderer_info");
    const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
    this.setShadows(!/swiftshader|llvmpipe|software|basic render/i.test(name));
  }

  // Colours are those of the style sheet.
  setColours() {
    const { scene } = this.viewer;
    scene.background = new THREE.Color(styled("page")); // three.js takes it and the fog's as they are
    scene.fog.color.copy(scene.background);
    for (const { name, material } of this.ground) if (name) material.color.copy(colourOf(styled(name)));
  }

  // Without background and ground, for a picture on a page of another colour.
  clear() {
    for (const object of this.ground) object.visible = false;
    this.viewer.scene.background = this.viewer.scene.fog = null;
    this.viewer.renderer.setClearColor(0, 0);
  }

  setShadows(on) {
    this.sun.castShadow = on;
    this.floor.visible = on;
  }

  addLights() {
    const reach = 1.5 * this.radius;
    const sky = new THREE.HemisphereLight(0xffffff, 0xaab2bf, 0.5);
    sky.position.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xffffff, 0.5);
    this.sun.position.set(-0.5, -0.75, 1.6).multiplyScalar(2 * reach).add(this.centre);
    this.sun.target.position.copy(this.centre);
    const { shadow } = this.sun;
    shadow.mapSize.set(1536, 1536);
    Object.assign(shadow, { bias: -0.0005, normalBias: 0.002 * this.radius });
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * reach, far: 8 * reach });
    const fill = new THREE.DirectionalLight(0xffffff, 0.14);
    fill.position.set(1, 0.6, 0.5);
    this.root.add(sky, this.sun, this.sun.target, fill);
  }

  addGround() {
    const { radius, centre } = this;
    const cell = radius > 12 ? 5 : radius > 0.6 ? 1 : 0.1;
    const reach = cell * Math.ceil((5 * radius) / cell);
    const put = (object, height) =>
      object.position.set(cell * Math.round(centre.x / cell), cell * Math.round(centre.y / cell), height * radius);
    this.ground = [[0.2, "grid", -0.0006], [1, "cells", -0.0003]].map(([step, name, height]) => {
      const count = Math.round((2 * reach) / (step * cell));
      const grid = Object.assign(new THREE.GridHelper(2 * reach, count).rotateX(Math.PI / 2), { name });
      grid.material.vertexColors = false;
      put(grid, height);
      return grid;
    });
    this.ground.push(triad(0.11 * radius, 0.0026 * radius));
    this.floor = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), new THREE.ShadowMaterial({ opacity: 0.16 }));
    put(this.floor, -0.0009);
    this.floor.receiveShadow = true;
    this.root.add(...this.ground, this.floor);
  }

  // Look at points from a direction, from as near as they all are in one of the free parts of the picture.
  look(points, direction, parts) {
    const { viewer, radius } = this;
    const { camera } = viewer;
    viewer.set_3d_pane_size();
    camera.fov = 32;
    const away = new THREE.Vector3(...direction).normalize();
    if (Math.hypot(away.x, away.y) < 1e-4) away.setY(-1e-4).normalize(); // from above, x is to the right
    const right = new THREE.Vector3(-away.y, away.x, 0).normalize();
    const up = new THREE.Vector3().crossVectors(away, right);
    const depths = points.map((point) => point.dot(away));
    const [nearest, farthest] = [Math.max(...depths), Math.min(...depths)];
    const vertical = Math.tan((camera.fov * Math.PI) / 360);
    // along each axis of the picture: how far the outermost lines of sight are apart, at depth 0
    const fitted = (free) => {
      const sides = [
        [right, free.left, free.right, vertical * Math.max(camera.aspect, 0.2)],
        [up, free.bottom, free.top, vertical],
      ].map(([axis, low, high, tangent]) => {
        const at = (side) => points.map((point, i) => point.dot(axis) + side * tangent * depths[i]);
        return { axis, low: low * tangent, high: high * tangent, least: Math.min(...at(low)), most: Math.max(...at(high)) };
      });
      const depth = Math.max(nearest + 0.05 * radius, ...sides.map((s) => (s.most - s.least) / (s.high - s.low)));
      return { sides, depth };
    };
    const { sides, depth } = parts.map(fitted).reduce((best, one) => (one.depth < best.depth ? one : best));
    const eye = away.clone().multiplyScalar(depth);
    for (const { axis, low, high, least, most } of sides)
      eye.addScaledVector(axis, (least + most - (low + high) * depth) / 2);
    const distance = depth - (nearest + farthest) / 2;
    const target = eye.clone().addScaledVector(away, -distance);
    camera.near = distance / 200;
    camera.far = distance * 30 + 20 * radius;
    Object.assign(viewer.scene.fog || {}, { near: 1.2 * distance, far: 1.2 * distance + 6 * radius });
    // MeshCat's camera and its controls have y up
    camera.position.set(eye.x, eye.z, -eye.y);
    viewer.controls.target.set(target.x, target.z, -target.y);
    camera.updateProjectionMatrix();
    viewer.controls.update();
    camera.updateWorldMatrix(true, false); // so that points can be projected before it is drawn
    viewer.set_dirty();
  }

  // The largest parts of the picture that some rectangles (px) leave free, -1 to 1; the margins (px) within
  // them are kept free, too. All of it, if they leave none that is worth looking at.
  freeParts(taken, { side, top }) {
    const { clientWidth: width, clientHeight: height } = this.viewer.dom_element;
    const edges = (low, high, end) =>
      [...new Set([0, end, ...taken.flatMap((box) => [box[low], box[high]])])].filter((at) => at >= 0 && at <= end);
    const pairs = (values) => values.flatMap((a) => values.filter((b) => b > a).map((b) => [a, b]));
    const overlap = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
    const inside = (a, b) => a.left >= b.left && a.right <= b.right && a.top >= b.top && a.bottom <= b.bottom;
    const rows = pairs(edges("top", "bottom", height));
    const empty = pairs(edges("left", "right", width))
      .flatMap(([left, right]) => rows.map(([top, bottom]) => ({ left, right, top, bottom })))
      .filter((part) => !taken.some((box) => overlap(part, box)));
    const large = empty
      .filter((part) => !empty.some((other) => other !== part && inside(part, other)))
      .map((part) => ({ left: part.left + side, right: part.right - side, top: part.top + top, bottom: part.bottom - side }))
      .filter((part) => part.right - part.left >= 0.2 * width && part.bottom - part.top >= 0.2 * height);
    return (large.length ? large : [{ left: 0, right: width, top: 0, bottom: height }]).map(({ left, right, top: high, bottom }) => ({
      left: (2 * left) / width - 1,
      right: (2 * right) / width - 1,
      top: 1 - (2 * high) / height,
      bottom: 1 - (2 * bottom) / height,
    }));
  }

  // A point of the world in pixels; null if it is behind the camera.
  project(point) {
    const { clientWidth: width, clientHeight: height } = this.viewer.dom_element;
    const { x, y, z } = point.clone().project(this.viewer.camera);
    return z > 1 ? null : [(0.5 + 0.5 * x) * width, (0.5 - 0.5 * y) * height];
  }
}
