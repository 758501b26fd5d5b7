// A chart of fronts, error against triangles, drawn as SVG on the scales of D3. One front can be picked from; others stand
// beside it as series.

const SVG = "http://www.w3.org/2000/svg";
const plainNumber = d3.format(",");
const shortNumber = d3.format(".4~g");

// Values below this share of the largest are drawn as 0: rounding would stretch the axis.
const ROUNDING = 1e-6;
// Of so many points the marks would hide each other: they are drawn smaller, those of a series not at all.
const MANY = 150;
const MANY_BESIDE = 40;
// Width of a digit on an axis, rounded up [pixels].
const LETTER = 8;

// 12,300 and 0.0123, but 1.2e+7
function readable(value) {
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e6 || size < 1e-4) return d3.format(".3~e")(value);
  return size >= 1000 ? plainNumber(Math.round(value)) : shortNumber(value);
}

// Marks around the current point of a path.
const MARKS = {
  circle: (r) => `m${-r},0a${r},${r} 0 1,0 ${2 * r},0a${r},${r} 0 1,0 ${-2 * r},0z`,
  square: (r) => `m${-r},${-r}h${2 * r}v${2 * r}h${-2 * r}z`,
  up: (r) => `m0,${-1.2 * r}l${1.1 * r},${2 * r}h${-2.2 * r}z`,
  down: (r) => `m0,${1.2 * r}l${1.1 * r},${-2 * r}h${-2.2 * r}z`,
  left: (r) => `m${-1.2 * r},0l${2 * r},${1.1 * r}v${-2.2 * r}z`,
  diamond: (r) => `m0,${-1.3 * r}l${1.3 * r},${1.3 * r}l${-1.3 * r},${1.3 * r}l${-1.3 * r},${-1.3 * r}z`,
  plus: (r) => `m${-r},0h${2 * r}m${-r},${-r}v${2 * r}`,
  cross: (r) => `m${-r},${-r}l${2 * r},${2 * r}m${-2 * r},0l${2 * r},${-2 * r}`,
  star: (r) => {
    const corner = (k) => [Math.sin, (angle) => -Math.cos(angle)].map((f) => (k % 2 ? 0.45 : 1) * r * f((k * Math.PI) / 5));
    const steps = Array.from({ length: 9 }, (_, k) => corner(k + 1).map((value, axis) => value - corner(k)[axis]));
    return `m0,${-r}${steps.map(([dx, dy]) => `l${dx},${dy}`).join("")}z`;
  },
};

function svgPart(parent, name, attributes = {}, text = null) {
  const part = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, value);
  if (text !== null) part.textContent = text;
  parent.append(part);
  return part;
}

class FrontChart {
  // host: where it goes. front: {x, y, hollow} arrays to pick from, or null; y is null where it is not known.
  // series: [{name, x, y, colour, mark, line, half}], line being "thick" or "thin", half another {x, y} drawn as a thin line.
  // special: [{row, mark, name}] of the front. log: {x, y}.
  constructor(host, { front = null, series = [], special = [], labels, log, describe = null, onPick = null, name }) {
    Object.assign(this, { host, front, series, special, labels, log, describe, onPick, name });
    this.hidden = new Set();
    this.picked = null;
    this.svg = svgPart(host, "svg", { role: "img", "aria-label": name });
    this.list = document.createElement("ul");
    this.list.className = "legend";
    this.tip = document.createElement("div");
    this.tip.className = "tip";
    this.tip.hidden = true;
    host.append(this.tip);
    host.append(this.list);
    this.legend();
    if (front) {
      this.svg.addEventListener("click", (event) => {
        const row = this.nearest(event);
        if (row !== null) this.onPick(row);
      });
      this.svg.addEventListener("pointermove", (event) => this.hover(event));
      this.svg.addEventListener("pointerleave", () => (this.tip.hidden = true));
    }
    new ResizeObserver(() => this.draw()).observe(host);
    this.draw();
  }

  setLog(axis, on) {
    this.log[axis] = on;
    this.draw();
  }

  pick(row) {
    this.picked = row;
    this.draw();
  }

  // Another quantity upwards: the front's y and whether it falls in steps, the series that have it, the name of the axis.
  show({ y, steps, series, label, log }) {
    Object.assign(this.front, { y, steps });
    this.series = series;
    this.labels.y = label;
    this.log.y = log;
    this.tip.hidden = true;
    this.legend();
    this.draw();
  }

  legend() {
    const list = this.list;
    list.replaceChildren();
    const entry = (look, name, toggled) => {
      const item = document.createElement("li");
      const label = document.createElement(toggled ? "label" : "span");
      if (toggled) {
        const box = document.createElement("input");
        box.type = "checkbox";
        box.checked = !this.hidden.has(toggled.name);
        box.addEventListener("change", () => {
          this.hidden[box.checked ? "delete" : "add"](toggled.name);
          this.draw();
        });
        label.append(box);
      }
      const swatch = svgPart(label, "svg", { class: "swatch", viewBox: "-8 -8 16 16", "aria-hidden": "true" });
      svgPart(swatch, "path", look);
      label.append(name);
      item.append(label);
      list.append(item);
    };
    const mark = (name, r) => `M0,0${MARKS[name](r)}`;
    if (this.front) entry({ d: mark("circle", 3.5), class: "front-dot" }, "solutions");
    if (this.front && this.front.hollow.some(Boolean)) {
      entry({ d: mark("circle", 3.5), class: "front-dot hollow" }, "without a mesh in this page");
    }
    for (const one of this.special) entry({ d: mark(one.mark, 6), class: `special ${one.mark}` }, one.name);
    for (const one of this.series) {
      const line = { ...this.look(one, "M-8,0H8"), class: `series ${one.line}` };
      entry(one.line === "thick" || !one.mark ? line : this.look(one, mark(one.mark, 4)), one.name, one);
    }
    list.hidden = list.childElementCount < 2;
  }

  look(series, d) {
    return { d, stroke: series.colour || "currentColor", fill: "none", class: series.faint ? "series faint" : "series" };
  }

  scale(axis, values, from, to) {
    const top = Math.max(...values, 0) || 1;
    const positive = values.filter((value) => value > ROUNDING * top);
    if (!this.log[axis] || !positive.length) {
      const low = axis === "x" ? 0.97 * Math.min(...values) : 0;
      const scale = d3.scaleLinear([low, top + 0.04 * (top - low)], [from, to]);
      return { at: scale, ticks: scale.ticks(axis === "x" ? this.width / 90 : 6).map((value) => [value, readable(value)]) };
    }
    // 0 has no place on a logarithmic axis: it stands on the axis itself
    const zeros = positive.length < values.length;
    const least = Math.min(...positive);
    const reach = Math.log10(top / least) || 1;
    const low = least / 10 ** (0.04 * reach + 0.02);
    const gap = zeros ? 18 * Math.sign(to - from) : 0;
    const scale = d3.scaleLog([low, top * 10 ** (0.04 * reach + 0.02)], [from + gap, to]);
    const all = scale.ticks().filter((value) => value >= low && value > ROUNDING * top);
    const lead = (value) => Math.round(value / 10 ** Math.floor(Math.log10(value) + 1e-9));
    const kept = reach > 3.2 ? [1] : reach > 1.2 ? [1, 2, 5] : reach > 0.5 ? [1, 2, 3, 4, 5, 7] : [1, 2, 3, 4, 5, 6, 7, 8, 9];
    let ticks = all.filter((value) => kept.includes(lead(value)));
    if (ticks.length < 3) ticks = d3.scaleLinear([low, top], [0, 1]).ticks(5).filter((value) => value > 0);
    const room = axis === "x" ? this.width / 48 : this.height / 26;
    while (ticks.length > room) ticks = ticks.filter((_, k) => k % 2 === 0);
    const labelled = ticks.map((value) => [value, readable(value)]);
    return {
      at: (value) => (value > ROUNDING * top ? scale(value) : from),
      ticks: zeros ? [[0, "0"], ...labelled] : labelled,
    };
  }

  draw() {
    const visible = this.series.filter((one) => !this.hidden.has(one.name));
    this.width = Math.max(260, this.host.clientWidth);
    this.height = Math.round(Math.max(260, Math.min(450, 0.8 * this.width)));
    const box = { right: this.width - 12, top: 28, bottom: this.height - 42 };
    const svg = this.svg;
    svg.replaceChildren();
    svg.setAttribute("viewBox", `0 0 ${this.width} ${this.height}`);
    svg.setAttribute("height", this.height);
    const known = this.front && [...this.front.y.keys()].filter((row) => this.front.y[row] !== null);
    const front = this.front && { x: known.map((row) => this.front.x[row]), y: known.map((row) => this.front.y[row]) };
    const parts = [...(front ? [front] : []), ...visible, ...visible.flatMap((one) => one.half || [])];
    if (!parts.length) return;
    const y = this.scale("y", parts.flatMap((part) => Array.from(part.y)), box.bottom, box.top);
    box.left = Math.max(58, 14 + LETTER * Math.max(...y.ticks.map(([, text]) => text.length)));
    const x = this.scale("x", parts.flatMap((part) => Array.from(part.x)), box.left, box.right);
    const grid = svgPart(svg, "g", { class: "axes" });
    let free = 0; // where there is room for the next number
    for (const [value, text] of x.ticks) {
      const at = x.at(value);
      svgPart(grid, "line", { x1: at, x2: at, y1: box.top, y2: box.bottom });
      const half = (LETTER * text.length) / 2;
      const within = Math.min(at, this.width - half);
      if (within - half < free) continue;
      free = within + half;
      svgPart(grid, "text", { x: within, y: box.bottom + 16, "text-anchor": "middle" }, text);
    }
    for (const [value, text] of y.ticks) {
      const at = y.at(value);
      svgPart(grid, "line", { x1: box.left, x2: box.right, y1: at, y2: at });
      svgPart(grid, "text", { x: box.left - 6, y: at + 4, "text-anchor": "end" }, text);
    }
    svgPart(grid, "text", { x: (box.left + box.right) / 2, y: this.height - 8, "text-anchor": "middle", class: "name" }, this.labels.x);
    svgPart(grid, "text", { x: 4, y: 14, class: "name" }, this.labels.y);
    // a solution holds until the next larger one: between two points the better of both is the left one
    const steps = (part) =>
      Array.from(part.x, (value, k) => {
        const [px, py] = [x.at(value).toFixed(1), y.at(part.y[k]).toFixed(1)];
        return k ? `H${px}V${py}` : `M${px},${py}`;
      }).join("");
    for (const one of visible) {
      const drawn = (steps, line) => svgPart(svg, "path", { ...this.look(one, steps), fill: "none", class: `series ${line}` });
      if (one.line) drawn(steps(one), one.line);
      if (one.half) drawn(steps(one.half), "thin");
      if (!one.mark) continue;
      const shape = MARKS[one.mark](3.2);
      const marks = Array.from(one.x, (value, k) => `M${x.at(value).toFixed(1)},${y.at(one.y[k]).toFixed(1)}${shape}`);
      svgPart(svg, "path", this.look(one, marks.join("")));
    }
    if (!front) return;
    this.places = Array.from(this.front.x, (value, row) => (this.front.y[row] === null ? null : [x.at(value), y.at(this.front.y[row])]));
    const seen = known.map((row) => this.places[row]);
    const direct = seen.map(([px, py], k) => `${k ? "L" : "M"}${px.toFixed(1)},${py.toFixed(1)}`).join("");
    svgPart(svg, "path", { d: this.front.steps ? steps(front) : direct, class: "front-line" });
    const r = this.places.length > MANY ? 2.4 : 3.5;
    for (const row of known) {
      const [cx, cy] = this.places[row];
      svgPart(svg, "circle", { cx, cy, r, class: this.front.hollow[row] ? "front-dot hollow" : "front-dot", "data-row": row });
    }
    // a ring, so that a mark below it is seen; where the quantity is not known, a line says which one it is
    if (this.picked !== null) {
      const place = this.places[this.picked];
      const [px, py] = place || [x.at(this.front.x[this.picked]), box.top];
      svgPart(svg, "path", { d: `M${px},${box.bottom}V${py}${place ? `H${box.left}` : ""}`, class: "picked-lines" });
      if (place) {
        svgPart(svg, "circle", { cx: px, cy: py, r: 4.5, class: "picked-dot" });
        svgPart(svg, "circle", { cx: px, cy: py, r: 11, class: "picked-ring" });
      }
    }
    for (const { row, mark } of this.special) {
      if (!this.places[row]) continue;
      const [px, py] = this.places[row];
      svgPart(svg, "path", { d: `M0,0${MARKS[mark](8)}`, transform: `translate(${px},${py})`, class: `special ${mark}` });
    }
  }

  nearest(event) {
    const frame = this.svg.getBoundingClientRect();
    const shrunk = this.width / frame.width;
    const [px, py] = [(event.clientX - frame.left) * shrunk, (event.clientY - frame.top) * shrunk];
    let best = null;
    let least = Infinity;
    this.places.forEach((place, row) => {
      if (!place) return;
      const distance = (place[0] - px) ** 2 + (place[1] - py) ** 2;
      if (distance < least) [least, best] = [distance, row];
    });
    return best;
  }

  hover(event) {
    const row = this.nearest(event);
    if (row === null) return;
    const [px, py] = this.places[row];
    const shrunk = this.svg.getBoundingClientRect().width / this.width;
    this.tip.textContent = this.describe(row);
    this.tip.hidden = false;
    const room = this.host.clientWidth - this.tip.offsetWidth;
    this.tip.style.left = `${Math.max(0, Math.min(room, px * shrunk + 10))}px`;
    this.tip.style.top = `${Math.max(0, py * shrunk - this.tip.offsetHeight - 10)}px`;
  }
}
