// What the windows of the meshes show, and what steers them. The solution that is shown is picked in simplification.js.

const UNCOVERED_LEVEL = 255; // other levels q mean an error of (q / 254)^2 times the largest of the solution
const errorAt = (row, level) => data.solutions[row].largest * (level / 254) ** 2;

// The end of the scale: the same for all solutions, or fitted to the shown one; a few spikes do not pale all the rest.
function scaleEnd() {
  if (part("scale").value === "all") return data.scale_end;
  const { row, levels } = state.mesh;
  const covered = levels.filter((level) => level !== UNCOVERED_LEVEL).sort();
  const level = covered.length ? covered[Math.floor(data.scale_quantile * (covered.length - 1))] : 0;
  return errorAt(row, level) || data.solutions[row].largest || 1;
}

function paintErrors() {
  if (!state.mesh) return;
  const { row, levels } = state.mesh;
  const end = scaleEnd();
  const table = Array.from({ length: 256 }, (_, level) => {
    if (level === UNCOVERED_LEVEL) return data.uncovered_colour;
    const share = Math.min(1, errorAt(row, level) / end);
    return data.colours[Math.round(share * (data.colours.length - 1))];
  });
  const { points, measured } = state.geometry;
  const colours = new Float32Array(points.length);
  levels.forEach((level, i) => {
    for (let k = 0; k < 3; k++) colours[3 * measured[i] + k] = table[level][k] / 255;
  });
  state.viewer.setErrors(colours);
  part("scale-middle").textContent = readable(end / 2);
  part("scale-end").textContent = data.solutions.some((solution) => solution && solution.largest > end) ? `≥ ${readable(end)}` : readable(end);
  if (part("uncovered-key")) part("uncovered-key").hidden = !columns.uncovered.some(Boolean);
}

function colourBar() {
  const bar = part("bar");
  const pen = bar.getContext("2d");
  data.colours.forEach((rgb, k) => {
    pen.fillStyle = `rgb(${rgb.join(",")})`;
    pen.fillRect((k * bar.width) / data.colours.length, 0, bar.width / data.colours.length + 1, bar.height);
  });
}

// The one place that learns that nothing can be drawn by WebGL: its windows, and all that only they answer to, are not shown.
function withoutWebgl(reason) {
  state.viewer = null;
  part("no-3d").hidden = false;
  part("no-3d").textContent = `The meshes cannot be shown: ${reason}. All else works.`;
  for (const needing of document.querySelectorAll(".needs-webgl")) needing.hidden = true;
}

async function openViewer() {
  const [points, faces, lines, paint] = await Promise.all([
    unpackArray(data.points),
    unpackFaces(data.faces),
    data.lines && unpackArray(data.lines),
    data.paint && unpackArray(data.paint),
  ]);
  state.geometry = { points, paint, measured: new Uint32Array(new Set(faces)).sort() };
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
      exaggeration: heights ? heights.valueAsNumber : 1,
      relief: model.relief,
      first: data.closed && data.closed.front.map((degrees) => (degrees * Math.PI) / 180),
      open: data.closed && data.closed.open,
      onDraw() {
        if (!first || !state.mesh) return;
        first = false;
        performance.mark("first picture");
        document.documentElement.dataset.ready = "yes";
      },
    });
  } catch (problem) {
    withoutWebgl(`this browser gives no WebGL (${problem.message})`);
    document.documentElement.dataset.ready = "without WebGL";
    return;
  }
  canvas.addEventListener("webglcontextlost", () => withoutWebgl("the graphics card has stopped; reload the page"));
  const viewer = state.viewer;
  for (const radio of document.querySelectorAll("input[name=look]")) {
    radio.addEventListener("change", () => {
      viewer.setMode(radio.value);
      part("error-key").hidden = radio.value !== "error";
    });
  }
  part("scale").addEventListener("change", paintErrors);
  heights?.addEventListener("input", () => {
    part("heights-value").textContent = `× ${readable(heights.valueAsNumber)}`;
    viewer.setExaggeration(heights.valueAsNumber);
  });
  part("lines")?.addEventListener("change", (event) => viewer.showLines(event.target.checked));
  part("from-above")?.addEventListener("click", () => viewer.look(0, 0));
  part("from-side")?.addEventListener("click", () => viewer.look(0.6, 1.2));
  part("quarter-turn")?.addEventListener("click", () => viewer.turn(Math.PI / 2, 0, 1));
  part("other-side")?.addEventListener("click", () => viewer.turn(Math.PI, 0, 1));
  part("reset").addEventListener("click", () => viewer.reset());
  if (state.mesh) {
    viewer.show(state.mesh.faces, state.mesh.edges);
    paintErrors();
  }
}
