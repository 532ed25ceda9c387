// The stage: MeshCat's viewer with light, ground, axes and a camera that has everything in view.
const BACKGROUND = 0xf3f5f8;

class Stage {
  constructor(pane, bounds) {
    const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFShadowMap;
    renderer.outputEncoding = THREE.sRGBEncoding;
    pane.appendChild(renderer.domElement);
    this.viewer = new MeshCat.Viewer(pane, false, renderer);
    for (const path of [["Lights"], ["Grid"], ["Axes"]]) this.viewer.set_property(path, "visible", false);
    this.viewer.scene.background = new THREE.Color(BACKGROUND); // three.js takes it as it is
    this.root = new THREE.Group();
    this.root.name = "mobman";
    this.viewer.set_object(["mobman"], this.root);
    this.frame(bounds);
    this.addLights();
    this.addGround();
    this.setShadows(!drawnByProcessor(renderer));
  }

  // Shadows cost half of the time where there is no graphics card.
  setShadows(on) {
    this.sun.castShadow = on;
    this.floor.visible = on;
  }

  frame([low, high]) {
    this.box = new THREE.Box3(new THREE.Vector3(...low), new THREE.Vector3(...high));
    this.centre = this.box.getCenter(new THREE.Vector3());
    this.radius = Math.max(0.5 * this.box.getSize(new THREE.Vector3()).length(), 0.25);
  }

  addLights() {
    const sky = new THREE.HemisphereLight(0xffffff, 0xaab2bf, 0.5);
    sky.position.set(0, 0, 1);
    const sun = new THREE.DirectionalLight(0xffffff, 0.5);
    const reach = 1.5 * this.radius;
    sun.position.copy(this.centre).add(new THREE.Vector3(-0.5, -0.75, 1.6).multiplyScalar(2 * reach));
    sun.target.position.copy(this.centre);
    sun.shadow.mapSize.set(1536, 1536);
    Object.assign(sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * reach, far: 8 * reach });
    sun.shadow.bias = -0.0005;
    sun.shadow.normalBias = 0.01 * this.radius * 0.2;
    const fill = new THREE.DirectionalLight(0xffffff, 0.14);
    fill.position.set(1, 0.6, 0.5);
    this.root.add(sky, sun, sun.target, fill);
    this.sun = sun;
  }

  addGround() {
    const cell = this.radius > 12 ? 5 : this.radius > 0.6 ? 1 : 0.1;
    const reach = cell * Math.ceil((5 * this.radius) / cell);
    const [x, y] = [this.centre.x, this.centre.y].map((value) => cell * Math.round(value / cell));
    const fog = new THREE.Fog(new THREE.Color(BACKGROUND).convertSRGBToLinear(), 3.2 * this.radius, 8 * this.radius);
    this.viewer.scene.fog = fog;
    for (const [step, colour, height] of [[cell / 5, 0xe9ecf0, -0.0006], [cell, 0xd0d6de, -0.0003]]) {
      const grid = new THREE.GridHelper(2 * reach, Math.round((2 * reach) / step), colourOf(colour), colourOf(colour));
      grid.rotation.x = Math.PI / 2;
      grid.position.set(x, y, height * this.radius);
      grid.name = "grid";
      this.root.add(grid);
    }
    const floor = new THREE.Mesh(new THREE.PlaneGeometry(2 * reach, 2 * reach), new THREE.ShadowMaterial({ opacity: 0.16 }));
    floor.position.set(x, y, -0.0009 * this.radius);
    floor.receiveShadow = true;
    floor.name = "ground";
    this.root.add(floor);
    this.floor = floor;
    this.axes = triad(0.11 * this.radius, 0.0026 * this.radius);
    this.axes.name = "world axes";
    this.root.add(this.axes);
  }

  // Look at points from the front, a little from above, so that they fill what the panels leave free.
  look(points, direction, free) {
    const viewer = this.viewer;
    const camera = viewer.camera;
    camera.fov = 32;
    const away = new THREE.Vector3(...direction).normalize();
    const right = new THREE.Vector3(-away.y, away.x, 0).normalize();
    const up = new THREE.Vector3().crossVectors(away, right);
    const vertical = Math.tan((camera.fov * Math.PI) / 360);
    const horizontal = vertical * Math.max(camera.aspect, 0.2);
    const local = points.map((p) => [p.dot(right), p.dot(up), p.dot(away)]);
    const nearest = Math.max(...local.map((p) => p[2]));
    // the eye (x, y along right and up, z along away) from where every point is inside the free part
    const eye = [0, 0, nearest + 1];
    for (let round = 0; round < 40; round++) {
      const seen = [[Infinity, -Infinity], [Infinity, -Infinity]];
      for (const p of local)
        [horizontal, vertical].forEach((tangent, i) => {
          const place = (p[i] - eye[i]) / ((eye[2] - p[2]) * tangent);
          seen[i] = [Math.min(seen[i][0], place), Math.max(seen[i][1], place)];
        });
      const wide = [free.right - free.left, free.top - free.bottom];
      const growth = Math.max(...seen.map(([low, high], i) => (high - low) / wide[i]));
      const depth = eye[2] - nearest;
      [horizontal, vertical].forEach((tangent, i) => {
        const middle = i === 0 ? (free.left + free.right) / 2 : (free.bottom + free.top) / 2;
        eye[i] += ((seen[i][0] + seen[i][1]) / 2 - middle) * tangent * (eye[2] - this.middleDepth(local));
      });
      eye[2] = nearest + Math.max(depth * (1 + 0.8 * (growth - 1)), 0.05 * this.radius);
    }
    const distance = eye[2] - this.middleDepth(local);
    const at = new THREE.Vector3().addScaledVector(right, eye[0]).addScaledVector(up, eye[1]).addScaledVector(away, eye[2]);
    const target = at.clone().addScaledVector(away, -distance);
    camera.near = distance / 200;
    camera.far = distance * 30 + 20 * this.radius;
    Object.assign(viewer.scene.fog, { near: 1.2 * distance, far: 1.2 * distance + 6 * this.radius });
    // MeshCat's camera and its controls have y up
    camera.position.set(at.x, at.z, -at.y);
    viewer.controls.target.set(target.x, target.z, -target.y);
    camera.updateProjectionMatrix();
    viewer.controls.update();
    viewer.set_dirty();
  }

  middleDepth(local) {
    let low = Infinity, high = -Infinity;
    for (const p of local) {
      low = Math.min(low, p[2]);
      high = Math.max(high, p[2]);
    }
    return (low + high) / 2;
  }

  // A point of the world in pixels; null if it is behind the camera.
  project(point, size) {
    const p = point.clone().project(this.viewer.camera);
    return p.z > 1 ? null : [(0.5 + 0.5 * p.x) * size.width, (0.5 - 0.5 * p.y) * size.height];
  }

  render() {
    this.viewer.render();
  }
}

// Whether the processor draws, in software.
function drawnByProcessor(renderer) {
  const context = renderer.getContext();
  const names = context.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}
