// Original and simplified mesh side by side: two windows of one WebGL canvas, seen by one camera, so that they turn together.

THREE.ColorManagement.enabled = false; // colours go to the screen as they are given

const CLAY = [0.9, 0.84, 0.77];
const NO_VERTEX = "#9aa0a6"; // simplified surface where the original has none
const TURN_STEP = Math.PI / 36;
const TEXTURE_SIZE = 1024;

class MeshPair {
  // positions: (V, 3) upright from a local origin; extent: [low, high] of the original; paint: (V, k) uint8 or null;
  // lines: ends of the original's break lines, (2 S, 3) in the same frame, or null; first: where a body is looked at from;
  // open: how the inside of a body with holes looks, or null
  constructor(canvas, windows, { positions, faces, lines, paint, channels, exaggeration, relief, first, open, onDraw }) {
    Object.assign(this, { canvas, windows, paint, first, open, onDraw });
    const count = positions.length / 3;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const row of faces) {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], positions[3 * row + k]);
        high[k] = Math.max(high[k], positions[3 * row + k]);
      }
    }
    const size = Math.max(high[0] - low[0], high[1] - low[1]);
    this.extent = [0, 1, 2].map((k) => (high[k] - low[k]) / size);
    const local = new Float32Array(3 * count);
    const uv = new Float32Array(2 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 3; k++) local[3 * i + k] = (positions[3 * i + k] - (low[k] + high[k]) / 2) / size;
      for (let k = 0; k < 2; k++) uv[2 * i + k] = (positions[3 * i + k] - low[k]) / (high[k] - low[k]);
    }
    const own = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 3; k++) own[3 * i + k] = paint ? paint[channels * i + k] / 255 : CLAY[k];
    }
    this.arrays = { position: local, uv, color: own };
    this.own = new THREE.BufferAttribute(own, 3);
    this.errorColour = new THREE.BufferAttribute(new Float32Array(3 * count), 3);

    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.setClearColor(0x000000, 0);
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xffffff, 1);
    this.sun.position.set(-0.5, 0.6, 0.75); // from the upper left, in front of the picture
    this.sun.target.position.set(0, 0, 0); // the camera
    this.camera.add(this.sun, this.sun.target);
    this.sky = new THREE.AmbientLight(0xffffff, 1);

    const side = THREE.DoubleSide;
    const lifted = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    const below = lines || open ? lifted : {}; // lines lie in front of the faces that they are edges of
    this.materials = {
      shaded: new THREE.MeshLambertMaterial({ vertexColors: true, flatShading: true, side, ...below }),
      texture: new THREE.MeshLambertMaterial({ flatShading: true, side, ...below }),
      line: new THREE.LineBasicMaterial(),
      rim: new THREE.LineBasicMaterial(),
      paper: new THREE.MeshBasicMaterial({ side, ...lifted }),
      wire: new THREE.MeshBasicMaterial({ wireframe: true, side }),
    };
    const longest = Math.max(this.extent[0], this.extent[1]);
    const pixels = [0, 1].map((k) => Math.max(16, Math.round((TEXTURE_SIZE * this.extent[k]) / longest)));
    this.target = new THREE.WebGLRenderTarget(pixels[0], pixels[1], { minFilter: THREE.LinearFilter });
    this.materials.texture.map = this.target.texture;
    const ends = lines && new Float32Array(lines.length);
    for (let i = 0; ends && i < ends.length; i++) ends[i] = (lines[i] - (low[i % 3] + high[i % 3]) / 2) / size;
    this.linesShown = true;
    this.original = this.scene(faces, ends);
    this.simplified = null;
    this.flat = new THREE.Scene();
    const coloured = this.geometry(faces);
    coloured.setAttribute("color", this.errorColour);
    const map = new THREE.Mesh(coloured, new THREE.MeshBasicMaterial({ vertexColors: true, side }));
    this.flat.add(map);
    this.above = new THREE.OrthographicCamera(-this.extent[0] / 2, this.extent[0] / 2, this.extent[1] / 2, -this.extent[1] / 2, -10, 10);
    this.mode = "shaded";
    this.exaggeration = exaggeration;
    this.relief = relief;

    // the wheel scrolls the page until the view has the focus
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (document.activeElement !== canvas) event.stopImmediatePropagation();
      },
      { capture: true },
    );
    this.steer();
    canvas.addEventListener("pointerdown", () => canvas.focus({ preventScroll: true }));
    canvas.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.theme();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.theme());
    this.resize();
    this.reset();
  }

  // What turns the camera: heights stay upright.
  steer() {
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.request());
    this.controls.maxDistance = 20;
    this.controls.minDistance = 0.05;
  }

  // Every geometry has attributes of its own: disposing of one deletes its buffers on the graphics card.
  geometry(faces) {
    const geometry = new THREE.BufferGeometry();
    for (const [name, array] of Object.entries(this.arrays)) {
      geometry.setAttribute(name, new THREE.BufferAttribute(array, name === "uv" ? 2 : 3));
    }
    geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    return geometry;
  }

  scene(faces, ends) {
    const scene = new THREE.Scene();
    const mesh = new THREE.Mesh(this.geometry(faces), this.materials.shaded);
    const wire = new THREE.Mesh(mesh.geometry, this.materials.wire);
    mesh.frustumCulled = wire.frustumCulled = false;
    scene.add(mesh, wire);
    return { scene, mesh, wire, lines: ends && this.linesOf(ends) };
  }

  // ends: (2 S, 3) Float32Array; the lines have a scene of their own, which is drawn several times to make them wider
  linesOf(ends, material = this.materials.line) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(ends, 3));
    const segments = new THREE.LineSegments(geometry, material);
    segments.frustumCulled = false;
    const scene = new THREE.Scene();
    scene.add(segments);
    return { scene, segments };
  }

  // faces: Uint32Array or null for no mesh; edges: the ends of its break lines as rows of the vertices, or null
  show(faces, edges) {
    if (this.simplified) this.simplified.wire.geometry.dispose();
    for (const lines of [this.simplified?.lines, this.simplified?.rims]) lines?.segments.geometry.dispose();
    const ends = edges && new Float32Array(3 * edges.length);
    for (let i = 0; ends && i < ends.length; i++) ends[i] = this.arrays.position[3 * edges[Math.floor(i / 3)] + (i % 3)];
    this.simplified = faces ? this.scene(faces, ends) : null;
    this.request();
  }

  showLines(shown) {
    this.linesShown = shown;
    this.request();
  }

  // Lines are one pixel wide by WebGL's rules; moved by half a pixel to all sides they are two.
  drawLines(lines, width, height) {
    lines.segments.scale.z = this.exaggeration;
    lines.scene.add(this.camera);
    this.renderer.autoClear = false;
    const step = 0.5;
    for (const [x, y] of [[step, 0], [-step, 0], [0, step], [0, -step]]) {
      this.camera.setViewOffset(width, height, x, y, width, height);
      this.renderer.render(lines.scene, this.camera);
    }
    this.camera.clearViewOffset();
    this.renderer.autoClear = true;
  }

  // colours: (V, 3) float, of the error at every vertex
  setErrors(colours) {
    this.errorColour.array.set(colours);
    this.errorColour.needsUpdate = true;
    this.renderer.setRenderTarget(this.target);
    this.renderer.setClearColor(NO_VERTEX, 1);
    this.renderer.clear();
    this.renderer.render(this.flat, this.above);
    this.renderer.setRenderTarget(null);
    this.renderer.setClearColor(0x000000, 0);
    this.request();
  }

  setMode(mode) {
    this.mode = mode;
    this.request();
  }

  setExaggeration(factor) {
    this.exaggeration = factor;
    this.request();
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    this.materials.paper.color.set(style.getPropertyValue("--card").trim());
    this.materials.wire.color.set(style.getPropertyValue("--wire").trim());
    this.lineColours = { shaded: "#00574b", wireframe: style.getPropertyValue("--breakline").trim() };
    this.rimColours = { shaded: this.open?.rim, wireframe: style.getPropertyValue("--rim").trim() };
    this.request();
  }

  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(this.canvas.clientWidth, this.canvas.clientHeight, false);
    this.request();
  }

  // Look from the direction (azimuth from the south, polar angle from above).
  look(azimuth, polar) {
    const [width, height] = this.window(0).slice(2);
    const fitted = Math.tan((this.camera.fov * Math.PI) / 360);
    const deep = this.extent[1] * Math.cos(polar) + this.extent[2] * this.exaggeration * Math.sin(polar);
    const distance = (0.55 * Math.max(deep, (this.extent[0] * height) / width)) / fitted + 0.5 * this.extent[1] * Math.sin(polar);
    this.controls.target.set(0, 0, 0);
    this.place(azimuth, polar, distance);
  }

  place(azimuth, polar, distance) {
    const tilt = Math.min(Math.PI - 1e-3, Math.max(1e-3, polar));
    const across = distance * Math.sin(tilt);
    this.camera.position
      .set(across * Math.sin(azimuth), -across * Math.cos(azimuth), distance * Math.cos(tilt))
      .add(this.controls.target);
    this.controls.update();
    this.request();
  }

  turn(azimuth, polar, zoom) {
    const arm = this.camera.position.clone().sub(this.controls.target);
    const distance = arm.length();
    const tilt = Math.acos(arm.z / distance);
    this.place(Math.atan2(arm.x, -arm.y) + azimuth, tilt + polar, distance * zoom);
  }

  // A relief as high as a face is seen nearly from the front, terrain from a hill beside it.
  reset() {
    this.look(0, this.relief > 0.2 ? 0.25 : 0.85);
  }

  key(event) {
    const moves = {
      ArrowLeft: [-TURN_STEP, 0, 1],
      ArrowRight: [TURN_STEP, 0, 1],
      ArrowUp: [0, -TURN_STEP, 1],
      ArrowDown: [0, TURN_STEP, 1],
      "+": [0, 0, 1 / 1.1],
      "=": [0, 0, 1 / 1.1],
      "-": [0, 0, 1.1],
    };
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key in moves) this.turn(...moves[event.key]);
    else if (event.key === "Home") this.reset();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  window(which) {
    const canvas = this.canvas.getBoundingClientRect();
    const frame = this.windows[which].getBoundingClientRect();
    return [frame.left - canvas.left, canvas.bottom - frame.bottom, frame.width, frame.height].map(Math.round);
  }

  request() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  // What the original (0) and the simplified mesh (1) look like in this mode.
  dress(part, which) {
    part.wire.visible = this.mode === "wireframe";
    if (which === 0) part.mesh.geometry.setAttribute("color", this.mode === "error" ? this.errorColour : this.own);
    if (this.mode === "wireframe") part.mesh.material = this.materials.paper;
    else if (this.mode === "error" && which === 1) part.mesh.material = this.materials.texture;
    else part.mesh.material = this.materials.shaded;
  }

  draw() {
    const renderer = this.renderer;
    const bright = this.mode === "error" ? 0.72 : 0.3; // colours of the error must be told from the light
    this.sky.intensity = Math.PI * bright;
    this.sun.intensity = Math.PI * (this.mode === "error" ? 0.36 : 0.78);
    const ground = this.mode === "wireframe" ? "wireframe" : "shaded";
    this.materials.line.color.set(this.lineColours[ground]);
    if (this.open) this.materials.rim.color.set(this.rimColours[ground]);
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    [this.original, this.simplified].forEach((part, which) => {
      if (!part) return;
      const rectangle = this.window(which);
      if (rectangle[2] < 1 || rectangle[3] < 1) return;
      renderer.setViewport(...rectangle);
      renderer.setScissor(...rectangle);
      this.camera.aspect = rectangle[2] / rectangle[3];
      this.camera.updateProjectionMatrix();
      this.dress(part, which);
      part.mesh.scale.z = part.wire.scale.z = this.exaggeration;
      part.scene.add(this.camera, this.sky);
      renderer.render(part.scene, this.camera);
      if (part.rims) this.drawLines(part.rims, rectangle[2], rectangle[3]);
      if (part.lines && this.linesShown) this.drawLines(part.lines, rectangle[2], rectangle[3]);
    });
    this.onDraw();
  }
}
