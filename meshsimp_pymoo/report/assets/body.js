// Closed meshes side by side: like MeshPair, but turned freely, since a body has neither an above nor heights.

const LEAST_ZOOM = 0.25;
const MOST_ZOOM = 60;
const MOST_SAMPLES = 300_000; // of the error on a simplified mesh
const MOST_PARTS = 48; // of one edge of it

// Which of some points in space is nearest to another one: a tree of halves.
class NearestPoint {
  // points: (V, 3); rows: those that count
  constructor(points, rows) {
    this.points = points;
    this.order = Uint32Array.from(rows);
    this.halve(0, this.order.length, 0);
  }

  halve(low, high, axis) {
    if (high - low < 2) return;
    this.order.subarray(low, high).sort((a, b) => this.points[3 * a + axis] - this.points[3 * b + axis]);
    const middle = (low + high) >> 1;
    this.halve(low, middle, (axis + 1) % 3);
    this.halve(middle + 1, high, (axis + 1) % 3);
  }

  // near: a row that is not far, such as the answer for a place beside
  find(place, near) {
    this.place = place;
    this.best = near;
    this.square = this.squareTo(near);
    this.visit(0, this.order.length, 0);
    return this.best;
  }

  squareTo(row) {
    let sum = 0;
    for (let k = 0; k < 3; k++) sum += (this.points[3 * row + k] - this.place[k]) ** 2;
    return sum;
  }

  visit(low, high, axis) {
    if (low >= high) return;
    const middle = (low + high) >> 1;
    const row = this.order[middle];
    const square = this.squareTo(row);
    if (square < this.square) [this.square, this.best] = [square, row];
    const beyond = this.place[axis] - this.points[3 * row + axis];
    const next = (axis + 1) % 3;
    if (beyond < 0) this.visit(low, middle, next);
    else this.visit(middle + 1, high, next);
    if (beyond * beyond >= this.square) return;
    if (beyond < 0) this.visit(middle + 1, high, next);
    else this.visit(low, middle, next);
  }
}

class BodyPair extends MeshPair {
  steer() {
    const { canvas, camera } = this;
    this.radius = 0.5 * Math.hypot(...this.extent);
    this.target = new THREE.Vector3();
    const pointers = new Map();
    const place = (event) => ({ x: event.clientX, y: event.clientY });
    const release = (event) => pointers.delete(event.pointerId);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, place(event));
      canvas.setPointerCapture(event.pointerId);
      this.moving = event.button !== 0 || event.ctrlKey || event.metaKey || event.shiftKey;
    });
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointermove", (event) => {
      const before = pointers.get(event.pointerId);
      if (!before) return;
      const now = place(event);
      pointers.set(event.pointerId, now);
      const [dx, dy] = [now.x - before.x, now.y - before.y];
      const others = [...pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
      if (others.length) this.pinch(others[0], before, now);
      if (others.length || this.moving) this.move(dx / pointers.size, dy / pointers.size);
      else {
        const step = (2 * Math.PI) / (canvas.clientHeight * Math.max(1, camera.zoom));
        this.turn(-dx * step, -dy * step, 1);
      }
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? 33 : 1;
        this.turn(0, 0, 1.0005 ** (event.deltaY * lines));
      },
      { passive: false },
    );
  }

  get middle() {
    return this.target;
  }

  // Two fingers: one stays, the other one has moved; what is between them grows and turns with them.
  pinch(still, before, now) {
    const [a, b] = [before, now].map((at) => ({ x: at.x - still.x, y: at.y - still.y }));
    const grown = Math.hypot(b.x, b.y) / Math.max(1, Math.hypot(a.x, a.y));
    const axis = this.camera.position.clone().sub(this.target).normalize();
    this.camera.up.applyAxisAngle(axis, Math.atan2(b.y, b.x) - Math.atan2(a.y, a.x));
    this.turn(0, 0, 1 / Math.max(0.1, grown));
  }

  // Pixels to the right and down.
  move(dx, dy) {
    const { camera, target } = this;
    this.moved = true;
    const arm = camera.position.clone().sub(target);
    const pixel = (2 * arm.length() * Math.tan((camera.fov * Math.PI) / 360)) / (this.window(0)[3] * camera.zoom);
    const right = camera.up.clone().cross(arm).normalize();
    target.addScaledVector(right, -dx * pixel).addScaledVector(camera.up, dy * pixel).clampLength(0, this.radius);
    this.stand(arm);
  }

  // The camera at the end of an arm from what it looks at.
  stand(arm) {
    const { camera, target } = this;
    camera.position.copy(target).add(arm);
    camera.lookAt(target);
    this.request();
  }

  // Look from the direction (azimuth about the upright from the front, elevation), upright, at all of it.
  look(azimuth, elevation) {
    const { camera, target } = this;
    this.view = [azimuth, elevation];
    this.moved = false;
    const [sine, cosine] = [Math.sin(elevation), Math.cos(elevation)];
    const [east, south] = [Math.sin(azimuth), Math.cos(azimuth)];
    const arm = new THREE.Vector3(cosine * east, sine, cosine * south);
    const right = new THREE.Vector3(south, 0, -east);
    camera.up.set(-sine * east, cosine, -sine * south);
    const [width, height] = this.window(0).slice(2);
    const tall = FILLED * Math.tan((camera.fov * Math.PI) / 360);
    const wide = (tall * Math.max(1, width)) / Math.max(1, height);
    const point = new THREE.Vector3();
    let distance = 0;
    for (const row of this.original.faces) {
      point.fromArray(this.arrays.position, 3 * row);
      const out = Math.max(Math.abs(point.dot(camera.up)) / tall, Math.abs(point.dot(right)) / wide);
      distance = Math.max(distance, point.dot(arm) + out);
    }
    camera.zoom = 1;
    target.set(0, 0, 0);
    this.stand(arm.multiplyScalar(distance));
  }

  // The camera goes round the body to the right and downwards, however far.
  turn(right, down, zoom) {
    const { camera } = this;
    this.moved = true;
    const arm = camera.position.clone().sub(this.target);
    arm.applyAxisAngle(camera.up, right);
    const across = camera.up.clone().cross(arm).normalize();
    arm.applyAxisAngle(across, down);
    camera.up.crossVectors(arm, across).normalize();
    camera.zoom = Math.min(MOST_ZOOM, Math.max(LEAST_ZOOM, camera.zoom / zoom));
    this.stand(arm);
  }

  reset() {
    this.look(...this.first);
  }

  // Of a body with holes each side is drawn for itself, the inside in another tone, and the rims.
  part(faces, ends) {
    const part = super.part(faces, ends);
    if (!this.open) return part;
    part.inside = new THREE.Mesh(part.indexed, this.materials.paper);
    part.inside.frustumCulled = false;
    part.scene.add(part.inside);
    part.rims = this.linesOf(this.rimsOf(faces), this.materials.rim);
    return part;
  }

  lit(look) {
    if (!this.open) return super.lit(look);
    return super.lit({ side: this.open.winding < 0 ? THREE.BackSide : THREE.FrontSide, ...look });
  }

  material(colours) {
    if (colours !== "inside") return super.material(colours);
    const name = `inside ${this.isSmooth ? "smooth" : "flat"}`;
    const side = this.open.winding < 0 ? THREE.FrontSide : THREE.BackSide;
    this.materials[name] ??= this.lit({ color: this.open.inside, flatShading: !this.isSmooth, side });
    return this.materials[name];
  }

  // The ends of the edges that one triangle only has.
  rimsOf(faces) {
    const rows = this.arrays.position.length / 3;
    const alone = new Map(); // edge -> its two ends
    for (let t = 0; t < faces.length; t += 3) {
      for (let k = 0; k < 3; k++) {
        const [a, b] = [faces[t + k], faces[t + ((k + 1) % 3)]];
        const edge = Math.min(a, b) * rows + Math.max(a, b);
        if (!alone.delete(edge)) alone.set(edge, [a, b]);
      }
    }
    return Float32Array.from([...alone.values()].flat().flatMap((row) => [...this.arrays.position.subarray(3 * row, 3 * row + 3)]));
  }

  dispose(part) {
    super.dispose(part);
    part.fine?.geometry.dispose();
  }

  dress(part) {
    super.dress(part);
    if (!part.inside) return;
    part.inside.visible = this.shading !== "wireframe" || this.isRead;
    part.inside.geometry = part.mesh.geometry;
    part.inside.material = this.material("inside");
  }

  // On the simplified mesh the error is that of the original vertex that is nearest.
  dressInErrors(part) {
    part.fine ??= this.fineOf(part.faces);
    if (part.isMapOld) {
      part.isMapOld = false;
      const colour = part.fine.geometry.getAttribute("color");
      part.fine.sources.forEach((row, at) => {
        for (let k = 0; k < 3; k++) colour.array[3 * at + k] = part.errors.array[3 * row + k];
      });
      colour.needsUpdate = true;
    }
    part.mesh.geometry = part.fine.geometry;
    part.mesh.material = this.material("error");
  }

  // Its triangles in parts as small as the original ones, and the original vertex that is nearest to each corner.
  fineOf(faces) {
    const local = this.arrays.position;
    const original = this.original.faces;
    const normals = cornerNormals(local, faces, this.creased);
    const edge = (i, j) => Math.hypot(...[0, 1, 2].map((k) => local[3 * i + k] - local[3 * j + k]));
    if (!this.nearest) {
      let sum = 0;
      for (let t = 0; t < original.length; t += 3) sum += edge(original[t], original[t + 1]);
      this.spacing = (3 * sum) / original.length;
      this.nearest = new NearestPoint(local, new Set(original));
    }
    const longest = [];
    for (let t = 0; t < faces.length; t += 3) {
      const [a, b, c] = faces.subarray(t, t + 3);
      longest.push(Math.max(edge(a, b), edge(b, c), edge(c, a)));
    }
    let parts;
    let count;
    for (let size = this.spacing; !(count <= MOST_SAMPLES) ; size *= 1.3) {
      parts = longest.map((length) => Math.max(1, Math.min(MOST_PARTS, Math.ceil(length / size))));
      count = parts.reduce((sum, n) => sum + ((n + 1) * (n + 2)) / 2, 0);
      if (parts.every((n) => n === 1)) break;
    }
    const places = new Float32Array(3 * count);
    const index = new Uint32Array(3 * parts.reduce((sum, n) => sum + n * n, 0));
    const directions = new Float32Array(3 * count);
    const sources = new Uint32Array(count);
    let at = 0;
    let next = 0;
    for (let t = 0; t < parts.length; t++) {
      const n = parts[t];
      const corners = faces.subarray(3 * t, 3 * t + 3);
      let near = corners[0];
      for (let i = 0; i <= n; i++) {
        for (let j = 0; j <= n - i; j++, at++) {
          for (let k = 0; k < 3; k++) {
            const [a, b, c] = [0, 1, 2].map((m) => local[3 * corners[m] + k]);
            places[3 * at + k] = a + ((b - a) * i + (c - a) * j) / n;
            const [u, v, w] = [0, 1, 2].map((m) => normals[9 * t + 3 * m + k]);
            directions[3 * at + k] = u + ((v - u) * i + (w - u) * j) / n;
          }
          near = this.nearest.find(places.subarray(3 * at, 3 * at + 3), near);
          sources[at] = near;
          if (i + j === n) continue;
          const above = at + n - i + 1; // the same j in the next row
          index.set([at, above, at + 1], next);
          next += 3;
          if (i + j === n - 1) continue;
          index.set([above, above + 1, at + 1], next);
          next += 3;
        }
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setAttribute("normal", new THREE.BufferAttribute(directions, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(3 * count), 3));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    return { geometry, sources };
  }
}
