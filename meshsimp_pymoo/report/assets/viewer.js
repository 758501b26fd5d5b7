// Two meshes in two windows of one WebGL canvas, or in one window with a divider, seen by one camera, so that they turn together.

THREE.ColorManagement.enabled = false; // colours go to the screen as they are given

const CLAY = "#e6d6c4";
const NO_VERTEX = "#9aa0a6"; // simplified surface where the original has none
const TURN_STEP = Math.PI / 36;
const TEXTURE_SIZE = 1024; // of the map of the error
const INK = "#2a3442"; // edges over colours that are read, whatever the page's own colours
const [DARK_WIRES, FAINTEST_WIRE] = [6_000, 0.12]; // triangles whose edges are as dark as any; opacity of those of very many
const FILLED = 0.94; // of the window, by the original as it is first seen
const CREASE = Math.cos((55 * Math.PI) / 180); // edges at which faces turn by more stay sharp on smooth surfaces
const VIEWER_LIGHT = [-0.5, 0.6, 0.75]; // from the upper left, in front of the picture
const MAP_LIGHT = [-0.5, 0.5, Math.SQRT1_2]; // from the north-west, at 45 degrees
// Brightness of shadows, and what the light adds: colours that are read off a bar must be told from the light.
const LIGHTS = { plain: [0.3, 0.78], read: [0.72, 0.36], hillshade: [0.2, 0.92], readHillshade: [0.52, 0.62] };
// Where textures look for their coordinates: the map of the error, the image of the model, the colours of heights.
const [MAP_CHANNEL, IMAGE_CHANNEL, HEIGHT_CHANNEL] = [0, 1, 2];

// The mean of the faces around each corner of each face, weighted by their angles there, but none beyond a crease:
// (9 T) of triangles (3 T) of points (3 V). They are smooth where heights are multiplied by a factor.
function cornerNormals(points, faces, factor) {
  const count = faces.length / 3;
  const ofFace = new Float32Array(3 * count);
  const angle = new Float32Array(3 * count);
  const first = new Uint32Array(points.length / 3 + 1);
  const edge = (from, to) => [
    points[3 * to] - points[3 * from], points[3 * to + 1] - points[3 * from + 1], factor * (points[3 * to + 2] - points[3 * from + 2]),
  ];
  for (let t = 0; t < count; t++) {
    const corners = faces.subarray(3 * t, 3 * t + 3);
    const sides = [0, 1, 2].map((k) => edge(corners[k], corners[(k + 1) % 3]));
    const [u, v] = [sides[0], sides[2]];
    const normal = [v[1] * u[2] - v[2] * u[1], v[2] * u[0] - v[0] * u[2], v[0] * u[1] - v[1] * u[0]];
    const size = Math.hypot(...normal) || 1;
    for (let k = 0; k < 3; k++) {
      ofFace[3 * t + k] = normal[k] / size;
      const [on, back] = [sides[k], sides[(k + 2) % 3]];
      angle[3 * t + k] = Math.atan2(size, -(on[0] * back[0] + on[1] * back[1] + on[2] * back[2]));
      first[corners[k] + 1]++;
    }
  }
  for (let row = 0; row + 1 < first.length; row++) first[row + 1] += first[row];
  const around = new Uint32Array(faces.length); // the corners at each vertex
  const next = first.slice();
  for (let corner = 0; corner < faces.length; corner++) around[next[faces[corner]]++] = corner;
  const normals = new Float32Array(9 * count);
  for (let corner = 0; corner < faces.length; corner++) {
    const own = 3 * Math.floor(corner / 3);
    const [x, y, z] = [ofFace[own], ofFace[own + 1], ofFace[own + 2]];
    let [sx, sy, sz] = [0, 0, 0];
    for (let at = first[faces[corner]]; at < first[faces[corner] + 1]; at++) {
      const other = 3 * Math.floor(around[at] / 3);
      if (x * ofFace[other] + y * ofFace[other + 1] + z * ofFace[other + 2] < CREASE) continue;
      const weight = angle[around[at]];
      sx += weight * ofFace[other];
      sy += weight * ofFace[other + 1];
      sz += weight * ofFace[other + 2];
    }
    const size = Math.hypot(sx, sy, factor * sz) || 1; // normals stretch by the inverse
    normals.set([sx / size, sy / size, (factor * sz) / size], 3 * corner);
  }
  return normals;
}

class MeshPair {
  // positions: (V, 3) upright from a local origin; extent: [low, high] of the original; paint: (V, k) uint8 or null;
  // lines: ends of the original's break lines, (2 S, 3) in the same frame, or null; image: {canvas or img, uv, colour} or null;
  // ramp: canvas with the colours of heights, or null; first: where a body is looked at from; open: how the inside of a body
  // with holes looks, or null
  constructor(canvas, windows, { positions, faces, lines, paint, channels, image, ramp, exaggeration, relief, first, open, onDraw }) {
    Object.assign(this, { canvas, windows, image, ramp, first, open, onDraw, exaggeration, relief });
    const count = positions.length / 3;
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const row of faces) {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], positions[3 * row + k]);
        high[k] = Math.max(high[k], positions[3 * row + k]);
      }
    }
    this.heights = [low[2], high[2]];
    const size = Math.max(high[0] - low[0], high[1] - low[1]) || 1;
    this.size = size; // model units to one of the scene
    this.extent = [0, 1, 2].map((k) => (high[k] - low[k]) / size);
    const local = new Float32Array(3 * count);
    const uv = new Float32Array(2 * count);
    const level = new Float32Array(2 * count);
    for (let i = 0; i < count; i++) {
      for (let k = 0; k < 3; k++) local[3 * i + k] = (positions[3 * i + k] - (low[k] + high[k]) / 2) / size;
      for (let k = 0; k < 2; k++) uv[2 * i + k] = (positions[3 * i + k] - low[k]) / (high[k] - low[k]);
      level[2 * i] = (positions[3 * i + 2] - low[2]) / (high[2] - low[2] || 1);
      level[2 * i + 1] = 0.5;
    }
    const own = new Float32Array(3 * count);
    for (let i = 0; paint && i < own.length; i++) own[i] = paint[channels * Math.floor(i / 3) + (i % 3)] / 255;
    this.own = own;
    this.arrays = { position: local, uv };
    if (image) this.arrays.uv1 = image.uv;
    if (ramp) this.arrays.uv2 = level;
    this.creased = exaggeration; // creases are those of heights as they are first drawn

    this.renderer = openRenderer(canvas);
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.setClearColor(0x000000, 0);
    this.camera = new THREE.PerspectiveCamera(28, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.sun = new THREE.DirectionalLight(0xffffff, 1);
    this.sun.target.position.set(0, 0, 0);
    this.sky = new THREE.AmbientLight(0xffffff, 1);

    this.lifted = { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 };
    this.materials = {
      line: new THREE.LineBasicMaterial(),
      rim: new THREE.LineBasicMaterial(),
      paper: new THREE.MeshBasicMaterial({ side: THREE.DoubleSide, ...this.lifted }),
    };
    this.textures = {
      texture: image && this.textureOf(image.picture, IMAGE_CHANNEL),
      height: ramp && this.textureOf(ramp, HEIGHT_CHANNEL),
    };
    const ends = lines && new Float32Array(lines.length);
    for (let i = 0; ends && i < ends.length; i++) ends[i] = (lines[i] - (low[i % 3] + high[i % 3]) / 2) / size;
    this.linesShown = true;
    Object.assign(this, { colours: "plain", shading: "flat", hillshaded: false, wiped: false, divider: 0.5 });
    this.original = this.part(faces, ends);
    this.pinned = this.simplified = null;

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
    this.controls.addEventListener("start", () => (this.moved = true));
    this.controls.addEventListener("change", () => this.request());
    this.controls.minDistance = 0.05;
  }

  textureOf(picture, channel) {
    const texture = new THREE.CanvasTexture(picture);
    texture.channel = channel;
    if (channel === IMAGE_CHANNEL) texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
    return texture;
  }

  // -------------------------------------------------------------------------------------------------------- the meshes

  // Every geometry has attributes of its own: disposing of one deletes its buffers on the graphics card.
  geometry(faces) {
    const geometry = new THREE.BufferGeometry();
    for (const [name, array] of Object.entries(this.arrays)) {
      geometry.setAttribute(name, new THREE.BufferAttribute(array, name === "position" ? 3 : 2));
    }
    geometry.setIndex(new THREE.BufferAttribute(faces, 1));
    return geometry;
  }

  // What one window shows; ends: of its break lines, (2 S, 3), or null.
  part(faces, ends) {
    const scene = new THREE.Scene();
    const mesh = new THREE.Mesh(this.geometry(faces), this.materials.paper);
    const wire = new THREE.Mesh(mesh.geometry, new THREE.MeshBasicMaterial({ wireframe: true, side: THREE.DoubleSide, transparent: true }));
    mesh.frustumCulled = wire.frustumCulled = false;
    scene.add(mesh, wire);
    const own = new THREE.BufferAttribute(this.own, 3);
    const errors = new THREE.BufferAttribute(new Float32Array(this.own.length), 3);
    return { faces, scene, mesh, wire, lines: ends && this.linesOf(ends), own, errors, indexed: mesh.geometry, smooth: null, map: null };
  }

  // Its triangles one by one, with normals of their own at each corner.
  smoothed(part) {
    if (part.smooth) return part.smooth;
    const { faces } = part;
    part.smooth = new THREE.BufferGeometry();
    for (const [name, array] of Object.entries(this.arrays)) {
      part.smooth.setAttribute(name, this.spread(array, faces, name === "position" ? 3 : 2));
    }
    part.smooth.setAttribute("normal", new THREE.BufferAttribute(cornerNormals(this.arrays.position, faces, this.creased), 3));
    return part.smooth;
  }

  // An attribute of vertices as one of corners.
  spread(array, faces, width) {
    const corners = new Float32Array(width * faces.length);
    for (let corner = 0; corner < faces.length; corner++) {
      for (let k = 0; k < width; k++) corners[width * corner + k] = array[width * faces[corner] + k];
    }
    return new THREE.BufferAttribute(corners, width);
  }

  // Colours of vertices on either geometry of a part.
  paint(part, colours) {
    if (part.mesh.geometry !== part.smooth) {
      part.mesh.geometry.setAttribute("color", colours);
      return;
    }
    const is = part.painted;
    if (is && is.colours === colours && is.version === colours.version && is.on === part.smooth) return;
    part.smooth.setAttribute("color", this.spread(colours.array, part.faces, 3));
    part.painted = { colours, version: colours.version, on: part.smooth };
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

  // The mesh on the right; or, if it is pinned, on the left, where no mesh means the original.
  // faces: Uint32Array or null for no mesh; edges: the ends of its break lines as rows of the vertices, or null
  show(faces, edges, isPinned = false) {
    const name = isPinned ? "pinned" : "simplified";
    if (this[name]) this.dispose(this[name]);
    const ends = edges && new Float32Array(3 * edges.length);
    for (let i = 0; ends && i < ends.length; i++) ends[i] = this.arrays.position[3 * edges[Math.floor(i / 3)] + (i % 3)];
    this[name] = faces ? this.part(faces, ends) : null;
    this.request();
  }

  dispose(part) {
    part.indexed.dispose();
    part.wire.material.dispose();
    part.smooth?.dispose();
    part.map?.target.dispose();
    part.map?.material.forEach((material) => material.dispose());
    for (const lines of [part.lines, part.rims]) lines?.segments.geometry.dispose();
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

  // ---------------------------------------------------------------------------------------------------- how they look

  // colours: (V, 3) float, of the error of a mesh at every vertex of the original
  setErrors(colours, isPinned = false) {
    for (const part of isPinned ? [this.pinned] : [this.original, this.simplified]) {
      if (!part) continue;
      part.errors.array.set(colours);
      part.errors.needsUpdate = true;
      part.isMapOld = true;
    }
    this.request();
  }

  // The map of the error, as seen from above, which covers a simplified mesh: its triangles have no vertices between.
  mapOf(part) {
    if (!this.above) {
      this.above = new THREE.OrthographicCamera(-this.extent[0] / 2, this.extent[0] / 2, this.extent[1] / 2, -this.extent[1] / 2, -10, 10);
      this.flat = new THREE.Scene();
      this.flat.add(new THREE.Mesh(this.geometry(this.original.faces), new THREE.MeshBasicMaterial({ vertexColors: true, side: THREE.DoubleSide })));
    }
    if (!part.map) {
      const longest = Math.max(this.extent[0], this.extent[1]);
      const pixels = [0, 1].map((k) => Math.max(16, Math.round((TEXTURE_SIZE * this.extent[k]) / longest)));
      const target = new THREE.WebGLRenderTarget(pixels[0], pixels[1], { minFilter: THREE.LinearFilter });
      part.map = { target, material: [true, false].map((flatShading) => this.lit({ flatShading, map: target.texture })) };
    }
    if (part.isMapOld) {
      part.isMapOld = false;
      this.flat.children[0].geometry.setAttribute("color", part.errors);
      this.renderer.setScissorTest(false);
      this.renderer.setRenderTarget(part.map.target);
      this.renderer.setClearColor(NO_VERTEX, 1);
      this.renderer.clear();
      this.renderer.render(this.flat, this.above);
      this.renderer.setRenderTarget(null);
      this.renderer.setClearColor(0x000000, 0);
    }
    return part.map.material[this.isSmooth ? 1 : 0];
  }

  get isSmooth() {
    return this.shading === "smooth";
  }

  lit(look) {
    return new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, ...this.lifted, ...look });
  }

  // The material of a kind of colours, made when it is first asked for.
  material(colours) {
    const name = `${colours} ${this.isSmooth ? "smooth" : "flat"}`;
    if (!this.materials[name]) {
      const look = { flatShading: !this.isSmooth };
      if (colours === "plain") look.color = CLAY;
      else if (this.textures[colours]) look.map = this.textures[colours];
      else look.vertexColors = true;
      if (colours === "texture") look.color = this.image.colour;
      this.materials[name] = this.lit(look);
    }
    return this.materials[name];
  }

  // colours: plain, own, texture, height or error; shading: flat, smooth or wireframe; hillshaded: lit from the north-west
  setLook({ colours = this.colours, shading = this.shading, hillshaded = this.hillshaded }) {
    Object.assign(this, { colours, shading, hillshaded });
    this.request();
  }

  // Whether what is drawn is coloured by numbers.
  get isRead() {
    return this.colours === "error" || this.colours === "height";
  }

  setExaggeration(factor) {
    this.exaggeration = factor;
    this.refit();
  }

  // wiped: both meshes in one window, left and right of a divider, which stands at a share of its width
  arrange({ wiped = this.wiped, divider = this.divider }) {
    const isOther = wiped !== this.wiped;
    Object.assign(this, { wiped, divider });
    if (isOther) this.refit();
    else this.request();
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    this.materials.paper.color.set(style.getPropertyValue("--card").trim());
    this.wireColour = style.getPropertyValue("--wire").trim();
    this.lineColours = { shaded: "#00574b", wireframe: style.getPropertyValue("--breakline").trim() };
    this.rimColours = { shaded: this.open?.rim, wireframe: style.getPropertyValue("--rim").trim() };
    this.request();
  }

  // --------------------------------------------------------------------------------------------------- where from

  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(this.canvas.clientWidth, this.canvas.clientHeight, false);
    this.refit();
  }

  // What was fitted into the windows is so again, unless somebody has moved it since.
  refit() {
    if (this.view && !this.moved) this.look(...this.view);
    else this.request();
  }

  // Look from the direction (azimuth from the south, polar angle from above), at all of it, as near as it can be.
  look(azimuth, polar) {
    this.view = [azimuth, polar];
    this.moved = false;
    const tilt = Math.max(1e-3, polar);
    const [sine, cosine, east, south] = [Math.sin(tilt), Math.cos(tilt), Math.sin(azimuth), Math.cos(azimuth)];
    const arm = new THREE.Vector3(sine * east, -sine * south, cosine);
    const up = new THREE.Vector3(-cosine * east, cosine * south, sine);
    const right = new THREE.Vector3(south, east, 0);
    const [width, height] = this.window(0).slice(2);
    const tall = FILLED * Math.tan((this.camera.fov * Math.PI) / 360);
    const wide = (tall * Math.max(1, width)) / Math.max(1, height);
    // each side of the window is a plane through the camera; the furthest point beyond it decides
    const reach = { right: -Infinity, left: -Infinity, up: -Infinity, down: -Infinity };
    const point = new THREE.Vector3();
    for (const row of this.original.faces) {
      point.fromArray(this.arrays.position, 3 * row);
      point.z *= this.exaggeration;
      const [x, y, near] = [point.dot(right), point.dot(up), point.dot(arm)];
      reach.right = Math.max(reach.right, x + wide * near);
      reach.left = Math.max(reach.left, wide * near - x);
      reach.up = Math.max(reach.up, y + tall * near);
      reach.down = Math.max(reach.down, tall * near - y);
    }
    const distance = Math.max((reach.right + reach.left) / (2 * wide), (reach.up + reach.down) / (2 * tall));
    this.controls.target
      .copy(right.multiplyScalar((reach.right - reach.left) / 2))
      .addScaledVector(up, (reach.up - reach.down) / 2);
    this.controls.maxDistance = 6 * distance;
    this.place(azimuth, tilt, distance);
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
    this.moved = true;
    const arm = this.camera.position.clone().sub(this.controls.target);
    const distance = arm.length();
    const tilt = Math.acos(arm.z / distance);
    this.place(Math.atan2(arm.x, -arm.y) + azimuth, tilt + polar, distance * zoom);
  }

  // A relief as high as a face is seen nearly from the front, terrain from a hill beside it.
  reset() {
    this.look(0, this.relief > 0.2 ? 0.25 : 0.6);
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

  // All of the model lies between the limits of sight.
  clip() {
    const { camera } = this;
    const radius = 0.51 * Math.hypot(this.extent[0], this.extent[1], this.extent[2] * this.exaggeration);
    const distance = camera.position.length();
    camera.far = distance + radius;
    camera.near = Math.max(2e-3 * camera.far, distance - radius);
  }

  // The rectangle (left, bottom, width, height) of a window on the canvas; of both where there is one.
  window(which) {
    const canvas = this.canvas.getBoundingClientRect();
    const [from, to] = (this.wiped ? [0, 1] : [which, which]).map((k) => this.windows[k].getBoundingClientRect());
    return [from.left - canvas.left, canvas.bottom - from.bottom, to.right - from.left, from.height].map(Math.round);
  }

  request() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  // What a mesh looks like now.
  dress(part) {
    const isOriginal = part === this.original;
    const { colours, isRead } = this;
    const isWire = this.shading === "wireframe";
    part.wire.visible = isWire;
    // the more edges, the paler each, or they would cover everything
    part.wire.material.opacity = Math.max(FAINTEST_WIRE, Math.min(1, (3 * DARK_WIRES) / part.faces.length)) * (isRead ? 0.5 : 1);
    part.wire.material.color.set(isRead ? INK : this.wireColour);
    part.mesh.geometry = this.isSmooth ? this.smoothed(part) : part.indexed;
    if (isWire && !isRead) part.mesh.material = this.materials.paper;
    else if (colours === "error" && !isOriginal) this.dressInErrors(part);
    else {
      part.mesh.material = this.material(colours);
      if (colours === "error") this.paint(part, part.errors);
      if (colours === "own") this.paint(part, part.own);
    }
  }

  dressInErrors(part) {
    part.mesh.material = this.mapOf(part);
  }

  draw() {
    const { renderer, camera, sun } = this;
    const onHeights = this.colours === "height" ? "readHillshade" : "read"; // shadows are no errors
    const lights = LIGHTS[this.isRead ? (this.hillshaded ? onHeights : "read") : this.hillshaded ? "hillshade" : "plain"];
    this.sky.intensity = Math.PI * lights[0];
    sun.intensity = Math.PI * lights[1];
    sun.position.set(...(this.hillshaded ? MAP_LIGHT : VIEWER_LIGHT));
    const ground = this.shading === "wireframe" && !this.isRead ? "wireframe" : "shaded";
    this.materials.line.color.set(this.lineColours[ground]);
    if (this.open) this.materials.rim.color.set(this.rimColours[ground]);
    this.clip();
    const parts = [this.pinned ?? this.original, this.simplified];
    parts.forEach((part) => part && this.dress(part));
    renderer.setScissorTest(false);
    renderer.clear();
    renderer.setScissorTest(true);
    parts.forEach((part, which) => {
      if (!part) return;
      const rectangle = this.window(which);
      if (rectangle[2] < 1 || rectangle[3] < 1) return;
      renderer.setViewport(...rectangle);
      const [left, bottom, width, height] = rectangle;
      const split = this.wiped ? Math.round(this.divider * width) : null;
      if (split === null) renderer.setScissor(...rectangle);
      else if (which === 0) renderer.setScissor(left, bottom, split, height);
      else renderer.setScissor(left + split, bottom, width - split, height);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      part.mesh.scale.z = part.wire.scale.z = this.exaggeration;
      (this.hillshaded ? part.scene : camera).add(sun, sun.target);
      part.scene.add(camera, this.sky);
      renderer.render(part.scene, camera);
      if (part.rims) this.drawLines(part.rims, width, height);
      if (part.lines && this.linesShown) this.drawLines(part.lines, width, height);
    });
    if (renderer instanceof SoftwareRenderer) renderer.flush();
    this.onDraw();
  }

  get middle() {
    return this.controls.target;
  }

  // Pixels of the page to a model unit across the picture, where the camera looks at.
  get pixelsPerUnit() {
    const { camera } = this;
    const distance = camera.position.distanceTo(this.middle);
    return (this.window(0)[3] * camera.zoom) / (2 * Math.tan((camera.fov * Math.PI) / 360) * distance * this.size);
  }

  // How far north is turned from upwards in the picture, clockwise.
  get north() {
    const arm = this.camera.position.clone().sub(this.middle);
    return Math.atan2(arm.x, (-arm.y * arm.z) / arm.length());
  }

  // What the canvas shows now, drawn with so many pixels to one of the page.
  picture(ratio) {
    const before = this.renderer.getPixelRatio();
    const copy = document.createElement("canvas");
    this.renderer.setPixelRatio(ratio);
    this.draw();
    [copy.width, copy.height] = [this.canvas.width, this.canvas.height];
    copy.getContext("2d").drawImage(this.canvas, 0, 0);
    this.renderer.setPixelRatio(before);
    this.draw();
    return copy;
  }
}
