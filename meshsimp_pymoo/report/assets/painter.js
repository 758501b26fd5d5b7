// What draws the meshes where there is no WebGL: of three.js's renderer what the viewer asks for, computed point by point
// with a depth for each. It needs nothing but a canvas, and a tenth of a second for a hundred thousand triangles.

const POINTS_TO_A_PIXEL = 2; // along each side: edges are as soft as a graphics card has them
const MOST_POINTS = 4_000_000; // of one picture; above that, one point is one pixel
const OFFSET_UNIT = 2 ** -22; // of the depth from 0 to 1, as polygonOffsetUnits counts

// A picture as it is drawn: colours with their opacity, depths, row 0 at the bottom.
class Raster {
  constructor(width, height) {
    Object.assign(this, { width, height });
    this.colour = new Uint32Array(width * height); // as the bytes of an image lie: red first
    this.depth = new Float32Array(width * height);
  }
}

const packed = (r, g, b, a) => ((a << 24) | (b << 16) | (g << 8) | r) >>> 0;
const byte = (value) => (value <= 0 ? 0 : value >= 1 ? 255 : (value * 255 + 0.5) | 0);

// A texture's points, of an image or of what was drawn before.
class Texels {
  constructor({ width, height, colour }, { isFlipped, isRepeated }) {
    Object.assign(this, { width, height, colour, isFlipped, isRepeated });
    this.found = [0, 0, 0];
  }

  // The colour at (u, v), mixed of the four nearest points.
  at(u, v) {
    const { width, height, colour, found } = this;
    const x = u * width - 0.5;
    const y = (this.isFlipped ? 1 - v : v) * height - 0.5;
    const [i, j] = [Math.floor(x), Math.floor(y)];
    const [fx, fy] = [x - i, y - j];
    const wrap = (k, size) => (this.isRepeated ? ((k % size) + size) % size : Math.min(size - 1, Math.max(0, k)));
    const [left, right, low, high] = [wrap(i, width), wrap(i + 1, width), wrap(j, height) * width, wrap(j + 1, height) * width];
    const [a, b, c, d] = [colour[low + left], colour[low + right], colour[high + left], colour[high + right]];
    for (let k = 0, shift = 0; k < 3; k++, shift += 8) {
      const below = (1 - fx) * ((a >>> shift) & 255) + fx * ((b >>> shift) & 255);
      const above = (1 - fx) * ((c >>> shift) & 255) + fx * ((d >>> shift) & 255);
      found[k] = ((1 - fy) * below + fy * above) / 255;
    }
    return found;
  }
}

// m: (16) as three.js has matrices, column by column.
const product = (a, b) => Array.from({ length: 16 }, (_, at) => {
  const [row, column] = [at % 4, at >> 2];
  return [0, 1, 2, 3].reduce((sum, k) => sum + a[row + 4 * k] * b[k + 4 * column], 0);
});

class SoftwareRenderer {
  constructor(canvas) {
    this.domElement = canvas;
    this.pen = canvas.getContext("2d");
    this.hidden = document.createElement("canvas");
    Object.assign(this, { ratio: 1, autoClear: true, target: null, ground: 0, scissor: null, isScissored: false });
    this.drawn = new WeakMap(); // the texture of a target -> its raster
    this.texels = new WeakMap();
    this.size = [1, 1];
    this.viewport = [0, 0, 1, 1];
  }

  setPixelRatio(ratio) {
    this.ratio = ratio;
    this.setSize(...this.size);
  }

  getPixelRatio() {
    return this.ratio;
  }

  setSize(width, height) {
    this.size = [width, height];
    const { domElement } = this;
    [domElement.width, domElement.height] = [width, height].map((size) => Math.max(1, Math.floor(size * this.ratio)));
    const pixels = domElement.width * domElement.height;
    this.points = POINTS_TO_A_PIXEL ** 2 * pixels <= MOST_POINTS ? POINTS_TO_A_PIXEL : 1;
    this.screen = new Raster(this.points * domElement.width, this.points * domElement.height);
    [this.hidden.width, this.hidden.height] = [this.screen.width, this.screen.height];
  }

  setViewport(...rectangle) {
    this.viewport = rectangle;
  }

  setScissor(...rectangle) {
    this.scissor = rectangle;
  }

  setScissorTest(on) {
    this.isScissored = on;
  }

  setClearColor(colour, opacity) {
    const { r, g, b } = new THREE.Color(colour);
    this.ground = packed(byte(r), byte(g), byte(b), byte(opacity));
  }

  setRenderTarget(target) {
    this.target = target;
    if (!target) return;
    if (!this.drawn.has(target.texture)) this.drawn.set(target.texture, new Raster(target.width, target.height));
  }

  // What is drawn on, and which part of it: [left, bottom, right, top] of the whole view and of what may change.
  place() {
    const raster = this.target ? this.drawn.get(this.target.texture) : this.screen;
    const whole = [0, 0, raster.width, raster.height];
    if (this.target) return { raster, view: whole, inside: whole };
    const scale = this.points * this.ratio;
    const box = ([left, bottom, width, height]) => [left, bottom, left + width, bottom + height].map((value) => Math.round(value * scale));
    const view = box(this.viewport);
    const limits = [whole, ...(this.isScissored ? [view, box(this.scissor)] : [])];
    const inside = [0, 1].map((k) => Math.max(...limits.map((limit) => limit[k])));
    return { raster, view, inside: [...inside, ...[2, 3].map((k) => Math.min(...limits.map((limit) => limit[k])))] };
  }

  clear() {
    const { raster, inside } = this.place();
    for (let y = inside[1]; y < inside[3]; y++) {
      raster.colour.fill(this.ground, y * raster.width + inside[0], y * raster.width + inside[2]);
      raster.depth.fill(Infinity, y * raster.width + inside[0], y * raster.width + inside[2]);
    }
  }

  // The picture goes to the canvas once all of it is there.
  flush() {
    const { screen, hidden, pen, domElement } = this;
    const image = new ImageData(screen.width, screen.height);
    const pixels = new Uint32Array(image.data.buffer);
    for (let y = 0; y < screen.height; y++) {
      pixels.set(screen.colour.subarray((screen.height - 1 - y) * screen.width, (screen.height - y) * screen.width), y * screen.width);
    }
    hidden.getContext("2d").putImageData(image, 0, 0);
    pen.clearRect(0, 0, domElement.width, domElement.height);
    pen.imageSmoothingEnabled = true;
    pen.imageSmoothingQuality = "high";
    pen.drawImage(hidden, 0, 0, domElement.width, domElement.height);
  }

  render(scene, camera) {
    if (this.autoClear) this.clear();
    scene.updateMatrixWorld();
    if (!camera.parent) camera.updateMatrixWorld();
    const place = this.place();
    const view = camera.matrixWorldInverse.elements;
    const lights = this.lightsOf(scene, view);
    const things = [];
    scene.traverseVisible((one) => (one.isMesh || one.isLineSegments) && things.push(one));
    // what is seen through is drawn over the rest
    things.sort((a, b) => Number(a.material.transparent) - Number(b.material.transparent));
    for (const one of things) {
      const toView = product(view, one.matrixWorld.elements);
      const geometry = this.project(one.geometry, toView, camera.projectionMatrix.elements, place);
      if (one.isLineSegments) this.drawSegments(geometry, one, place);
      else if (one.material.wireframe) this.drawWires(geometry, one, place);
      else this.drawFaces(geometry, one, toView, lights, place);
    }
  }

  // Light in the frame of the camera: what is everywhere, and what comes from a direction.
  lightsOf(scene, view) {
    const found = { everywhere: [0, 0, 0], from: [] };
    const position = (one) => {
      const [x, y, z] = one.matrixWorld.elements.slice(12, 15);
      return [0, 1, 2].map((k) => view[k] * x + view[k + 4] * y + view[k + 8] * z + view[k + 12]);
    };
    scene.traverseVisible((one) => {
      if (!one.isLight) return;
      const strength = [one.color.r, one.color.g, one.color.b].map((value) => (value * one.intensity) / Math.PI);
      if (one.isAmbientLight) strength.forEach((value, k) => (found.everywhere[k] += value));
      if (!one.isDirectionalLight) return;
      const [here, there] = [position(one), position(one.target)];
      const way = here.map((value, k) => value - there[k]);
      const size = Math.hypot(...way) || 1;
      found.from.push({ way: way.map((value) => value / size), strength });
    });
    return found;
  }

  // Where vertices are: in the frame of the camera, and on the raster with their depth; 1 / w is 0 behind the camera.
  project(geometry, toView, projection, { view: [left, bottom, right, top] }) {
    const position = geometry.getAttribute("position").array;
    const count = position.length / 3;
    const [seen, at] = [new Float32Array(3 * count), new Float32Array(4 * count)];
    const [halfWidth, halfHeight] = [(right - left) / 2, (top - bottom) / 2];
    const m = toView;
    const p = projection;
    for (let i = 0, j = 0; i < 3 * count; i += 3, j += 4) {
      const [x, y, z] = [position[i], position[i + 1], position[i + 2]];
      const a = m[0] * x + m[4] * y + m[8] * z + m[12];
      const b = m[1] * x + m[5] * y + m[9] * z + m[13];
      const c = m[2] * x + m[6] * y + m[10] * z + m[14];
      seen[i] = a;
      seen[i + 1] = b;
      seen[i + 2] = c;
      const w = p[3] * a + p[7] * b + p[11] * c + p[15];
      const depth = p[2] * a + p[6] * b + p[10] * c + p[14];
      if (w <= 0 || depth < -w) continue; // nearer than the camera sees
      at[j] = left + halfWidth * (1 + (p[0] * a + p[4] * b + p[8] * c + p[12]) / w);
      at[j + 1] = bottom + halfHeight * (1 + (p[1] * a + p[5] * b + p[9] * c + p[13]) / w);
      at[j + 2] = 0.5 + (0.5 * depth) / w;
      at[j + 3] = 1 / w;
    }
    return { seen, at, index: geometry.index?.array ?? Uint32Array.from({ length: count }, (_, k) => k) };
  }

  textureOf(material) {
    const { map } = material;
    if (!map) return null;
    const drawn = this.drawn.get(map);
    if (drawn) return new Texels(drawn, { isFlipped: false, isRepeated: false });
    if (!this.texels.has(map)) {
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [map.image.naturalWidth || map.image.width, map.image.naturalHeight || map.image.height];
      const pen = copy.getContext("2d");
      pen.drawImage(map.image, 0, 0);
      const colour = new Uint32Array(pen.getImageData(0, 0, copy.width, copy.height).data.buffer);
      const look = { isFlipped: map.flipY, isRepeated: map.wrapS === THREE.RepeatWrapping };
      this.texels.set(map, new Texels({ width: copy.width, height: copy.height, colour }, look));
    }
    return this.texels.get(map);
  }

  drawFaces({ seen, at, index }, { geometry, material }, toView, lights, { raster, inside }) {
    const texture = this.textureOf(material);
    const attribute = (name) => geometry.getAttribute(name)?.array;
    const colours = material.vertexColors ? attribute("color") : null;
    const uv = texture && attribute(material.map.channel ? `uv${material.map.channel}` : "uv");
    const normals = material.isMeshLambertMaterial && !material.flatShading ? this.turnedNormals(attribute("normal"), toView) : null;
    const isLit = Boolean(material.isMeshLambertMaterial);
    const own = [material.color.r, material.color.g, material.color.b];
    const offset = material.polygonOffset ? material.polygonOffsetUnits * OFFSET_UNIT : 0;
    const steep = material.polygonOffset ? material.polygonOffsetFactor : 0;
    const { width, colour, depth } = raster;
    const [left, bottom, right, top] = inside;
    const flat = [0, 0, 0];
    const shade = [0, 0, 0];
    const light = (nx, ny, nz, into) => {
      for (let k = 0; k < 3; k++) into[k] = lights.everywhere[k];
      for (const { way, strength } of lights.from) {
        const falls = nx * way[0] + ny * way[1] + nz * way[2];
        if (falls > 0) for (let k = 0; k < 3; k++) into[k] += falls * strength[k];
      }
    };
    for (let t = 0; t + 2 < index.length; t += 3) {
      const [a, b, c] = [index[t], index[t + 1], index[t + 2]];
      const [wa, wb, wc] = [at[4 * a + 3], at[4 * b + 3], at[4 * c + 3]];
      if (wa === 0 || wb === 0 || wc === 0) continue;
      const [ax, ay, bx, by, cx, cy] = [at[4 * a], at[4 * a + 1], at[4 * b], at[4 * b + 1], at[4 * c], at[4 * c + 1]];
      const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
      if (area === 0 || (area > 0 ? material.side === THREE.BackSide : material.side === THREE.FrontSide)) continue;
      const lowest = Math.max(bottom, Math.ceil(Math.min(ay, by, cy) - 0.5));
      const highest = Math.min(top - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
      if (lowest > highest || Math.max(ax, bx, cx) < left || Math.min(ax, bx, cx) > right) continue;
      // the depth as a plane over the raster, and the shares of the corners b and c
      const [az, bz, cz] = [at[4 * a + 2], at[4 * b + 2], at[4 * c + 2]];
      const [sbx, sby, scx, scy] = [(cy - ay) / area, (ax - cx) / area, (ay - by) / area, (bx - ax) / area];
      const zx = (bz - az) * sbx + (cz - az) * scx;
      const zy = (bz - az) * sby + (cz - az) * scy;
      const lifted = offset + steep * Math.max(Math.abs(zx), Math.abs(zy));
      if (isLit && !normals) {
        const [i, j, k] = [3 * a, 3 * b, 3 * c];
        const [ux, uy, uz] = [seen[j] - seen[i], seen[j + 1] - seen[i + 1], seen[j + 2] - seen[i + 2]];
        const [vx, vy, vz] = [seen[k] - seen[i], seen[k + 1] - seen[i + 1], seen[k + 2] - seen[i + 2]];
        const [nx, ny, nz] = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
        const size = (Math.sqrt(nx * nx + ny * ny + nz * nz) || 1) * Math.sign(area); // to the viewer
        light(nx / size, ny / size, nz / size, flat);
      }
      for (let y = lowest; y <= highest; y++) {
        // where the row crosses the sides
        let [from, to] = [Infinity, -Infinity];
        const middle = y + 0.5;
        for (let side = 0; side < 3; side++) {
          const [px, py, qx, qy] = side === 0 ? [ax, ay, bx, by] : side === 1 ? [bx, by, cx, cy] : [cx, cy, ax, ay];
          if (py <= middle === qy <= middle) continue;
          const x = px + ((middle - py) / (qy - py)) * (qx - px);
          if (x < from) from = x;
          if (x > to) to = x;
        }
        const first = Math.max(left, Math.ceil(from - 0.5));
        const last = Math.min(right - 1, Math.ceil(to - 0.5) - 1);
        for (let x = first; x <= last; x++) {
          const [dx, dy] = [x + 0.5 - ax, middle - ay];
          const z = az + dx * zx + dy * zy + lifted;
          const pixel = y * width + x;
          if (!(z < depth[pixel])) continue;
          depth[pixel] = z;
          let [sb, sc] = [dx * sbx + dy * sby, dx * scx + dy * scy];
          let sa = 1 - sb - sc;
          if (colours || uv || normals) { // shares in space
            [sa, sb, sc] = [sa * wa, sb * wb, sc * wc];
            const sum = sa + sb + sc;
            [sa, sb, sc] = [sa / sum, sb / sum, sc / sum];
          }
          let [r, g, blue] = own;
          if (colours) {
            r *= sa * colours[3 * a] + sb * colours[3 * b] + sc * colours[3 * c];
            g *= sa * colours[3 * a + 1] + sb * colours[3 * b + 1] + sc * colours[3 * c + 1];
            blue *= sa * colours[3 * a + 2] + sb * colours[3 * b + 2] + sc * colours[3 * c + 2];
          }
          if (uv) {
            const texel = texture.at(
              sa * uv[2 * a] + sb * uv[2 * b] + sc * uv[2 * c],
              sa * uv[2 * a + 1] + sb * uv[2 * b + 1] + sc * uv[2 * c + 1],
            );
            [r, g, blue] = [r * texel[0], g * texel[1], blue * texel[2]];
          }
          if (isLit) {
            if (normals) {
              const [i, j, k] = [3 * a, 3 * b, 3 * c];
              const nx = sa * normals[i] + sb * normals[j] + sc * normals[k];
              const ny = sa * normals[i + 1] + sb * normals[j + 1] + sc * normals[k + 1];
              const nz = sa * normals[i + 2] + sb * normals[j + 2] + sc * normals[k + 2];
              const size = (Math.sqrt(nx * nx + ny * ny + nz * nz) || 1) * Math.sign(area); // to the viewer
              light(nx / size, ny / size, nz / size, shade);
            }
            const falls = normals ? shade : flat;
            [r, g, blue] = [r * falls[0], g * falls[1], blue * falls[2]];
          }
          colour[pixel] = packed(byte(r), byte(g), byte(blue), 255);
        }
      }
    }
  }

  // Normals in the frame of the camera: heights may be multiplied.
  turnedNormals(normals, toView) {
    const m = toView;
    const [sx, sy, sz] = [0, 4, 8].map((k) => m[k] ** 2 + m[k + 1] ** 2 + m[k + 2] ** 2 || 1);
    const found = new Float32Array(normals.length);
    for (let i = 0; i < normals.length; i += 3) {
      const [x, y, z] = [normals[i] / sx, normals[i + 1] / sy, normals[i + 2] / sz];
      for (let k = 0; k < 3; k++) found[i + k] = m[k] * x + m[k + 4] * y + m[k + 8] * z;
    }
    return found;
  }

  drawWires({ at, index }, { material }, place) {
    const edges = new Set();
    const rows = at.length / 4;
    for (let t = 0; t + 2 < index.length; t += 3) {
      for (let k = 0; k < 3; k++) {
        const [a, b] = [index[t + k], index[t + ((k + 1) % 3)]];
        const edge = Math.min(a, b) * rows + Math.max(a, b);
        if (edges.has(edge)) continue;
        edges.add(edge);
        this.drawLine(at, a, b, material, place);
      }
    }
  }

  drawSegments({ at, index }, { material }, place) {
    for (let k = 0; k + 1 < index.length; k += 2) this.drawLine(at, index[k], index[k + 1], material, place);
  }

  // As wide as a pixel of the page, whatever lies behind it.
  drawLine(at, a, b, material, { raster, inside }) {
    if (at[4 * a + 3] === 0 || at[4 * b + 3] === 0) return;
    const { width, colour, depth } = raster;
    const [left, bottom, right, top] = inside;
    const [ax, ay, az, bx, by, bz] = [at[4 * a], at[4 * a + 1], at[4 * a + 2], at[4 * b], at[4 * b + 1], at[4 * b + 2]];
    if (Math.max(ax, bx) < left || Math.min(ax, bx) > right || Math.max(ay, by) < bottom || Math.min(ay, by) > top) return;
    const isWide = Math.abs(bx - ax) > Math.abs(by - ay);
    const steps = Math.max(1, Math.ceil(Math.max(Math.abs(bx - ax), Math.abs(by - ay))));
    const wide = this.target ? 1 : this.points;
    const opacity = material.transparent ? material.opacity : 1;
    const { r, g, b: blue } = material.color;
    const full = packed(byte(r), byte(g), byte(blue), 255);
    for (let step = 0; step <= steps; step++) {
      const share = step / steps;
      const z = az + share * (bz - az);
      for (let beside = 0; beside < wide; beside++) {
        const shift = beside - (wide - 1) / 2;
        const x = Math.floor(ax + share * (bx - ax) + (isWide ? 0 : shift));
        const y = Math.floor(ay + share * (by - ay) + (isWide ? shift : 0));
        if (x < left || x >= right || y < bottom || y >= top) continue;
        const pixel = y * width + x;
        if (z > depth[pixel]) continue;
        colour[pixel] = opacity === 1 ? full : mixed(colour[pixel], full, opacity);
        depth[pixel] = z;
      }
    }
  }
}

function mixed(below, above, share) {
  const part = (shift) => Math.round((1 - share) * ((below >>> shift) & 255) + share * ((above >>> shift) & 255));
  return packed(part(0), part(8), part(16), Math.max(below >>> 24, Math.round(255 * share)));
}

// The renderer that this browser has.
function openRenderer(canvas) {
  const context = canvas.getContext("webgl2", { antialias: true, alpha: true });
  return context ? new THREE.WebGLRenderer({ canvas, context, antialias: true, alpha: true }) : new SoftwareRenderer(canvas);
}
