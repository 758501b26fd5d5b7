// What the windows of the meshes show, and what steers them. The solution that is shown is picked in simplification.js.

const UNCOVERED_LEVEL = 255; // other levels q mean an error of (q / 254)^2 times the largest of the solution
const errorAt = (row, level) => data.solutions[row].largest * (level / 254) ** 2;
const TICK_ROOM = 74; // pixels that a tick of the colour bar takes
const LEAST_PICTURE_RATIO = 2; // pixels of a saved picture to one of the page, at least
const KEY_NAME = 130; // pixels of its width for what the colours are
const DIVIDER_STEP = 0.05;
const RULER_SHARE = 0.4; // of a window, at most

const looks = { colours: "plain", end: 1 }; // what the colours are, and where those of errors end

// ------------------------------------------------------------------------------------------------------ the colour bar

// Where a scale that suits a mesh ends: a few spikes do not pale all the rest.
function fittedEnd({ row, levels }) {
  const covered = levels.filter((level) => level !== UNCOVERED_LEVEL).sort();
  const level = covered.length ? covered[Math.floor(data.scale_quantile * (covered.length - 1))] : 0;
  return errorAt(row, level) || data.solutions[row].largest || 1;
}

function errorColours({ row, levels }, end) {
  const table = Array.from({ length: 256 }, (_, level) => {
    if (level === UNCOVERED_LEVEL) return data.uncovered_colour;
    const share = Math.min(1, errorAt(row, level) / end);
    return data.colours.error[Math.round(share * (data.colours.error.length - 1))];
  });
  const { points, measured } = state.geometry;
  const colours = new Float32Array(points.length);
  levels.forEach((level, i) => {
    for (let k = 0; k < 3; k++) colours[3 * measured[i] + k] = table[level][k] / 255;
  });
  return colours;
}

// Both windows have one scale: that of the shown mesh, or of the coarser one, or the same for all.
function paintErrors() {
  if (!state.mesh) return;
  const meshes = [state.mesh, state.pinned].filter(Boolean);
  const end = part("same-scale").checked ? data.scale_end : Math.max(...meshes.map(fittedEnd));
  state.viewer.setErrors(errorColours(state.mesh, end));
  if (state.pinned) state.viewer.setErrors(errorColours(state.pinned, end), true);
  looks.end = end;
  if (looks.colours === "error") showKey();
}

function fillBar(bar, colours) {
  const pen = bar.getContext("2d");
  colours.forEach((rgb, k) => {
    pen.fillStyle = `rgb(${rgb.join(",")})`;
    pen.fillRect((k * bar.width) / colours.length, 0, bar.width / colours.length + 1, bar.height);
  });
}

// What the colours mean: [name, lowest, highest, whether more than that is drawn as that].
function meaning() {
  if (looks.colours === "height") {
    const level = model.rotation[2].reduce((sum, value, k) => sum + value * model.pivot[k], 0);
    return ["height", ...state.viewer.heights.map((height) => height + level), false];
  }
  const isMore = [state.mesh, state.pinned].some((mesh) => mesh && data.solutions[mesh.row].largest > looks.end * (1 + 1e-9));
  return ["error", 0, looks.end, isMore || part("same-scale").checked];
}

function showKey() {
  const { colours } = looks;
  const isRead = colours in data.colours;
  part("colour-key").hidden = !isRead;
  if (!isRead || !state.viewer) return;
  for (const only of document.querySelectorAll(".of-errors")) only.hidden = colours !== "error";
  if (part("uncovered-key")) part("uncovered-key").hidden = colours !== "error" || !columns.uncovered.some(Boolean);
  fillBar(part("bar"), data.colours[colours]);
  const [name, low, high, isMore] = meaning();
  part("key-name").textContent = withUnit(name, data.unit.trim());
  const ticks = part("ticks");
  const room = Math.max(2, Math.floor(part("bar").clientWidth / TICK_ROOM));
  const at = d3.scaleLinear([low, high], [0, 100]);
  const values = at.ticks(room).filter((value) => at(value) < 100 - 100 / room && (low === 0 || at(value) > 100 / room));
  const shown = [low, ...values.filter((value) => value > low), high];
  ticks.replaceChildren(
    ...shown.map((value, k) => {
      const tick = document.createElement("span");
      const rounded = colours === "error" ? Number(value.toPrecision(3)) : value;
      tick.textContent = `${k === shown.length - 1 && isMore ? "≥ " : ""}${readable(rounded)}`;
      tick.style.left = `${at(value)}%`;
      return tick;
    }),
  );
}

// ------------------------------------------------------------------------------------------------- what is compared

// Keeps the shown solution on the left, or lets the original be there again.
function compareWith(mesh) {
  state.pinned = mesh;
  state.viewer.show(mesh && mesh.faces, mesh && mesh.edges, true);
  paintErrors();
  part("left-name").textContent = mesh ? `solution ${mesh.row}` : "original";
  part("left-title").textContent = mesh ? sizeOf(mesh.row) : `${plainNumber(model.triangles)} triangles`;
}

// The divider of the wipe stands where the meshes are, which the captions above them are not.
function placeDivider() {
  const divider = part("divider");
  const [left, , width, height] = state.viewer.window(0);
  divider.style.left = `${left + width * state.viewer.divider}px`;
  divider.style.height = `${height}px`;
  const percents = Math.round(100 * state.viewer.divider);
  divider.setAttribute("aria-valuenow", percents);
  divider.setAttribute("aria-valuetext", `${percents} % of the width: left mesh`);
}

function steerDivider(viewer) {
  const divider = part("divider");
  const move = (share) => {
    viewer.arrange({ divider: Math.min(1, Math.max(0, share)) });
    placeDivider();
  };
  divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
  divider.addEventListener("pointermove", (event) => {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    const [left, , width] = viewer.window(0);
    move((event.clientX - part("canvas").getBoundingClientRect().left - left) / width);
  });
  divider.addEventListener("keydown", (event) => {
    const places = { ArrowLeft: viewer.divider - DIVIDER_STEP, ArrowRight: viewer.divider + DIVIDER_STEP, Home: 0, End: 1 };
    if (!(event.key in places)) return;
    move(places[event.key]);
    event.preventDefault();
  });
  new ResizeObserver(() => viewer.wiped && placeDivider()).observe(part("canvas"));
}

// How long a round length of the model is in the middle of the picture, and where north is.
function showRuler() {
  if (!part("ruler")) return; // of no model whose unit nobody knows
  const perUnit = state.viewer.pixelsPerUnit;
  const most = part("original-window").clientWidth * RULER_SHARE;
  const decade = 10 ** Math.floor(Math.log10(most / perUnit));
  const length = [5, 2, 1].map((lead) => lead * decade).find((one) => one * perUnit <= most);
  part("ruler-bar").style.width = `${length * perUnit}px`;
  part("ruler-length").textContent = `${readable(length)}${data.unit}`;
  if (part("north")) part("north").style.transform = `rotate(${(state.viewer.north * 180) / Math.PI}deg)`;
}

// ------------------------------------------------------------------------------------------------------- pictures

// The ruler and the north arrow on a ground of their own; rectangle: where what is in the windows is in the picture.
function drawRuler(pen, rectangle, ground) {
  pen.save();
  [pen.fillStyle, pen.globalAlpha] = [ground, getComputedStyle(part("ruler")).opacity];
  pen.fillRect(...rectangle(part("ruler").getBoundingClientRect()));
  pen.restore();
  const bar = part("ruler-bar");
  const [x, y, , tall] = rectangle(bar.getBoundingClientRect());
  const long = bar.clientWidth;
  pen.fillRect(x, y, 1, tall);
  pen.fillRect(x + long - 1, y, 1, tall);
  pen.fillRect(x, y + tall - 2, long, 2);
  pen.fillText(part("ruler-length").textContent, x + long + 6, y + tall);
  const arrow = part("north");
  if (!arrow) return;
  const [left, top, wide, high] = rectangle(arrow.getBoundingClientRect());
  pen.fillText("N", rectangle(arrow.parentElement.getBoundingClientRect())[0], y + tall);
  pen.save();
  pen.translate(left + wide / 2, top + high / 2);
  pen.rotate(state.viewer.north);
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(arrow.textContent, 0, 0);
  pen.restore();
}

// What the colours mean, in so much of the picture's width.
function drawKey(pen, left, top, width) {
  pen.fillText(part("key-name").textContent, left, top + 11, KEY_NAME - 10);
  const [from, long] = [left + KEY_NAME, width - KEY_NAME];
  pen.drawImage(part("bar"), from, top, long, 12);
  const ticks = [...part("ticks").children];
  ticks.forEach((tick, k) => {
    pen.textAlign = k === 0 ? "left" : k === ticks.length - 1 ? "right" : "center";
    pen.fillText(tick.textContent, from + (parseFloat(tick.style.left) / 100) * long, top + 28);
  });
}

// The windows as they are, under what they show and above what the colours mean: a canvas.
function pictureOfWindows() {
  const ratio = Math.max(LEAST_PICTURE_RATIO, window.devicePixelRatio || 1);
  const meshes = state.viewer.picture(ratio);
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  const views = part("canvas").getBoundingClientRect();
  const font = (size, weight = "") => `${weight} ${size}px ${getComputedStyle(document.body).fontFamily}`;
  const [edge, line, head] = [14, 20, 54];
  const isRead = !part("colour-key").hidden;
  const picture = document.createElement("canvas");
  const width = views.width + 2 * edge;
  const height = head + views.height + edge + (isRead ? 2.6 * line : 0);
  [picture.width, picture.height] = [width * ratio, height * ratio].map(Math.round);
  const pen = picture.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = colour("--card");
  pen.fillRect(0, 0, width, height);
  pen.fillStyle = colour("--ink");
  pen.font = font(17, "bold");
  pen.fillText(document.querySelector("h1").textContent, edge, 24, width - 2 * edge);
  pen.font = font(13);
  pen.fillStyle = colour("--soft");
  const drawnHigher = part("heights") && heightFactor() !== 1 ? `; heights × ${readable(heightFactor())}` : "";
  pen.fillText(describe(state.row) + drawnHigher, edge, 44, width - 2 * edge);
  const rectangle = (box) => [edge + box.left - views.left, head + box.top - views.top, box.width, box.height];
  const frames = ["original-window", "simplified-window"].map((id) => part(id).getBoundingClientRect());
  pen.fillStyle = colour("--window");
  frames.forEach((frame) => pen.fillRect(...rectangle(frame)));
  document.querySelectorAll("#views figcaption").forEach((caption) => {
    const [x, y, wide, tall] = rectangle(caption.getBoundingClientRect());
    pen.fillStyle = colour("--ink");
    pen.fillText(caption.innerText, x + 4, y + tall - 8, wide - 8);
  });
  pen.drawImage(meshes, edge, head, views.width, views.height);
  pen.fillStyle = colour("--ink");
  if (state.viewer.wiped) {
    const [x, y, , tall] = rectangle(part("divider").getBoundingClientRect());
    pen.fillRect(x + part("divider").clientWidth / 2 - 1, y, 2, tall);
  }
  if (part("ruler")) drawRuler(pen, rectangle, colour("--window"));
  if (isRead) drawKey(pen, edge, head + views.height + edge, views.width);
  return picture;
}

function savePicture() {
  pictureOfWindows().toBlob((file) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(file);
    link.download = `${data.stem}_${columns.triangles[state.row]}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  }, "image/png");
}

// ----------------------------------------------------------------------------------------------------- the windows

// The one place that learns that no mesh can be drawn: the windows, and all that only they answer to, are not shown.
// Without a reason they are there again.
function without3d(reason) {
  if (reason) state.viewer = null;
  part("no-3d").hidden = !reason;
  part("no-3d").textContent = `The meshes cannot be shown: ${reason}. All else works.`;
  for (const needing of document.querySelectorAll(".needs-3d")) needing.hidden = Boolean(reason);
  part("divider").hidden = !state.viewer?.wiped;
}

// The factor of the slider of heights, whose scale is logarithmic; of two digits, so that exactly 1 is easily found again.
function heightFactor() {
  return Number((10 ** part("heights").valueAsNumber).toPrecision(2));
}

async function imageOfModel() {
  if (!data.texture) return null;
  const picture = new Image();
  picture.src = data.texture.image;
  const [uv, isShown] = await Promise.all([unpackArray(data.texture.uv), picture.decode().then(() => true, () => false)]);
  if (!isShown) {
    document.querySelector("input[name=colours][value=texture]").closest("label").remove();
    document.querySelector("input[name=colours]").checked = true;
    part("no-texture").hidden = false;
    return null;
  }
  return { picture, uv: Float32Array.from(uv), colour: data.texture.colour };
}

function rampOfHeights() {
  if (!data.colours.height) return null;
  const ramp = document.createElement("canvas");
  [ramp.width, ramp.height] = [data.colours.height.length, 1];
  fillBar(ramp, data.colours.height);
  return ramp;
}

async function openViewer() {
  const [points, faces, lines, paint, image] = await Promise.all([
    unpackArray(data.points),
    unpackFaces(data.faces),
    data.lines && unpackArray(data.lines),
    data.paint && unpackArray(data.paint),
    imageOfModel(),
  ]);
  state.geometry = { points, paint, uv: image?.uv, measured: new Uint32Array(new Set(faces)).sort() };
  const { pivot, rotation, scale } = model; // scaled, coordinates are lengths
  const upright = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3) {
    for (let k = 0; k < 3; k++) {
      let sum = 0;
      for (let j = 0; j < 3; j++) sum += rotation[k][j] * (scale[j] * points[i + j] - pivot[j]);
      upright[i + k] = sum;
    }
  }
  const canvas = part("canvas");
  const windows = [part("original-window"), part("simplified-window")];
  const heights = part("heights"); // which a closed mesh has not
  let first = true;
  try {
    state.viewer = new (data.closed ? BodyPair : MeshPair)(canvas, windows, {
      positions: upright,
      faces,
      lines,
      paint,
      channels: data.paint ? data.paint.channels : 0,
      image,
      ramp: rampOfHeights(),
      exaggeration: heights ? heightFactor() : 1,
      relief: model.relief,
      first: data.closed && data.closed.front.map((degrees) => (degrees * Math.PI) / 180),
      open: data.closed && data.closed.open,
      onDraw() {
        if (state.viewer) showRuler();
        if (!first || !state.mesh) return;
        first = false;
        performance.mark("first picture");
        document.documentElement.dataset.ready = "yes";
      },
    });
  } catch (problem) {
    without3d(`this browser cannot draw them (${problem.message})`);
    document.documentElement.dataset.ready = "without meshes";
    return;
  }
  const viewer = state.viewer;
  if (viewer.renderer instanceof SoftwareRenderer) {
    part("no-3d").hidden = false;
    part("no-3d").textContent = "This browser gives no WebGL, so the page draws the meshes by itself: turning large ones takes its time.";
  }
  canvas.addEventListener("webglcontextlost", () => without3d("the graphics card does not answer any more"));
  canvas.addEventListener("webglcontextrestored", () => {
    state.viewer = viewer;
    without3d(null);
    showMesh();
  });
  steerLook(viewer);
  steerDivider(viewer);
  heights?.addEventListener("input", () => {
    viewer.setExaggeration(heightFactor());
    sayHeights();
  });
  if (heights) sayHeights();
  part("from-above")?.addEventListener("click", () => viewer.look(0, 0));
  part("from-side")?.addEventListener("click", () => viewer.look(0.6, 1.2));
  part("quarter-turn")?.addEventListener("click", () => viewer.turn(Math.PI / 2, 0, 1));
  part("other-side")?.addEventListener("click", () => viewer.turn(Math.PI, 0, 1));
  part("reset").addEventListener("click", () => viewer.reset());
  part("picture").addEventListener("click", savePicture);
  steerFullScreen();
  showMesh();
}

function sayHeights() {
  part("heights-value").textContent = `× ${readable(heightFactor())}`;
  part("heights").setAttribute("aria-valuetext", `${readable(heightFactor())} times as high`);
}

// The solution that was picked, where its windows are.
function showMesh() {
  if (!state.viewer) return;
  part("pin").disabled = !state.mesh;
  state.viewer.show(state.mesh && state.mesh.faces, state.mesh && state.mesh.edges);
  paintErrors();
}

function steerLook(viewer) {
  const each = (name, change) => {
    for (const radio of document.querySelectorAll(`input[name=${name}]`)) {
      radio.addEventListener("change", () => change(radio.value));
    }
  };
  const setColours = (colours) => {
    looks.colours = colours;
    viewer.setLook({ colours });
    showKey();
  };
  each("colours", setColours);
  each("shading", (shading) => viewer.setLook({ shading }));
  part("hillshade")?.addEventListener("change", (event) => viewer.setLook({ hillshaded: event.target.checked }));
  viewer.setLook({ hillshaded: Boolean(part("hillshade")?.checked) });
  setColours(document.querySelector("input[name=colours]:checked").value);
  part("same-scale").addEventListener("change", paintErrors);
  part("lines")?.addEventListener("change", (event) => viewer.showLines(event.target.checked));
  each("arrangement", (arrangement) => {
    const wiped = arrangement === "wipe";
    part("views").classList.toggle("wiped", wiped);
    part("divider").hidden = !wiped;
    viewer.arrange({ wiped });
    if (wiped) placeDivider();
  });
  let kept = null;
  each("left", (left) => compareWith(left === "pinned" ? kept : null));
  part("pin").addEventListener("click", () => {
    kept = state.mesh;
    part("left-choice").hidden = false;
    part("pinned-name").textContent = `solution ${kept.row}`;
    document.querySelector("input[name=left][value=pinned]").checked = true;
    compareWith(kept);
  });
  new ResizeObserver(showKey).observe(part("bar"));
}

function steerFullScreen() {
  const button = part("full-screen");
  const card = button.closest("section");
  button.hidden = !document.fullscreenEnabled;
  button.addEventListener("click", () => (document.fullscreenElement ? document.exitFullscreen() : card.requestFullscreen()));
  document.addEventListener("fullscreenchange", () => {
    button.textContent = document.fullscreenElement ? "leave full screen" : "full screen";
  });
}
