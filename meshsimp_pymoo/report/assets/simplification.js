// The page of a simplification: pick a solution of the front, see its mesh beside the original, take it home.

const data = JSON.parse(document.getElementById("data").textContent);
const { columns, model } = data;
const count = columns.triangles.length;
const embedded = data.solutions.map((solution, row) => (solution ? row : -1)).filter((row) => row >= 0);
const part = (id) => document.getElementById(id);
const sixDigits = d3.format(",.6~g");

function spell(value) {
  const size = Math.abs(value);
  if (Number.isInteger(value) || (size >= 1e5 && size < 1e9)) return plainNumber(Math.round(value));
  return size >= 1e9 || size < 1e-4 ? d3.format(".6~e")(value) : sixDigits(value);
}

function describe(row) {
  return `solution ${row}: ${plainNumber(columns.triangles[row])} triangles${columns.free[row] ? ", free" : ""}, mean error ${readable(columns.mean_error[row])}${data.unit}`;
}

const sizeOf = (row) =>
  `${plainNumber(columns.triangles[row])} triangles, ${percent(columns.triangles[row] / model.triangles)}${columns.free[row] ? ", free" : ""}`;
const measures = Object.fromEntries(data.measures.map((measure) => [measure.name, measure]));
const named = (column) => measures[column]?.label ?? column.replace("_", " ");
const withUnit = (text, unit) => [text, unit && `[${unit}]`].filter(Boolean).join(" ");
const isSize = ({ name }) => name in model; // what the original has too
const percent = (share) => `${d3.format(share < 1e-3 ? ".2~r" : share < 0.0995 ? ".2~f" : ".1~f")(100 * share)} %`;

// -------------------------------------------------------------------------------------------------------- picking

const state = { row: null, mesh: null, pinned: null, viewer: null, geometry: null };

const chart = new FrontChart(part("chart"), {
  name: "The front: error against triangles. Each point is a simplified mesh.",
  front: { x: columns.triangles, y: columns[data.measure], hollow: data.solutions.map((solution) => !solution) },
  series: data.series.map((one) => ({ ...one, faint: true, line: "thin", mark: one.x.length > MANY_BESIDE ? null : "circle" })),
  special: [
    { row: data.knee, mark: "diamond", name: "knee: the best compromise" },
    ...(data.chosen === null ? [] : [{ row: data.chosen, mark: "star", name: "chosen when the front was made" }]),
  ],
  labels: { x: "triangles", y: withUnit(data.measure === "error" ? "error: sum over all vertices" : named(data.measure), measures[data.measure].unit) },
  log: { x: part("log-x").checked, y: part("log-y").checked },
  describe,
  onPick: pick,
});
for (const axis of ["x", "y"]) part(`log-${axis}`).addEventListener("change", (event) => chart.setLog(axis, event.target.checked));

const slider = part("slider");
slider.max = embedded.length - 1;
slider.addEventListener("input", () => pick(embedded[slider.valueAsNumber]));

function step(by) {
  const place = embedded.findLastIndex((row) => row <= state.row);
  const next = by > 0 || embedded[place] === state.row ? place + by : place;
  pick(embedded[Math.max(0, Math.min(embedded.length - 1, next))]);
}

document.addEventListener("keydown", (event) => {
  const onChart = part("chart").contains(event.target);
  if (event.target !== document.body && event.target.tagName !== "BUTTON" && !onChart) return;
  if (event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
  const moves = { ArrowRight: 1, ArrowLeft: -1 };
  if (onChart) Object.assign(moves, { ArrowUp: -1, ArrowDown: 1, Home: -count, End: count });
  if (!(event.key in moves)) return;
  step(moves[event.key]);
  event.preventDefault();
});

async function pick(row) {
  state.row = row;
  chart.pick(row);
  const place = embedded.findLastIndex((other) => other <= row);
  slider.value = Math.max(0, place);
  slider.setAttribute("aria-valuetext", describe(row));
  part("picked").textContent = `solution ${row} of 0 to ${count - 1}`;
  numbers(row);
  const file = `${data.stem}_${columns.triangles[row]}.ply`;
  part("command").textContent = `meshsimp pick ${data.folder} --solution ${row} -o ${file}`;
  const solution = data.solutions[row];
  part("simplified-title").textContent = sizeOf(row);
  part("not-embedded").hidden = Boolean(solution);
  for (const button of document.querySelectorAll("#downloads button")) button.disabled = !solution;
  const [faces, levels, edges] = solution
    ? await Promise.all([unpackFaces(solution.faces), unpackArray(solution.deviation), solution.lines ? unpackArray(solution.lines) : null])
    : [null, null, null];
  if (state.row !== row) return; // another one was picked meanwhile
  state.mesh = faces && { row, faces, levels, edges };
  document.documentElement.dataset.shown = row;
  showMesh();
}

function refitted(row) {
  const error = columns.refitted_error && columns.refitted_error[row];
  if (error === undefined || error === null) return [];
  return [["refitted_error", error, `of its triangles with the best ${data.closed ? "places of its vertices" : "heights"}: ${data.refitted_meshes[row]}`]];
}

function numbers(row) {
  const notes = {
    triangles: (value) => `${percent(value / model.triangles)} of ${plainNumber(model.triangles)}`,
    vertices: (value) => `${percent(value / model.vertices)} of ${plainNumber(model.vertices)} kept`,
    error: () => withUnit(measures.error.meaning, measures.error.unit),
    mean_error: (value) => `${percent(value / model.diagonal)} of the model's diagonal`,
    below_5_degrees: (value) => `${percent(value)} have a least angle below 5 degrees`,
  };
  const rows = [
    ...[...data.measures.filter(isSize), ...data.measures.filter((measure) => !isSize(measure))].map(
      ({ name, meaning }) => [name, columns[name][row], notes[name]?.(columns[name][row]) ?? meaning])
      .filter(([, value]) => value !== null), // not measured
    ...refitted(row),
    ...(columns.free.some(Boolean) ? [["free", columns.free[row], `edges ${columns.free[row] ? "chosen for the error" : "by the Delaunay rule"}`]] : []),
    ["solution", columns.solution[row], data.meshes[row] ? `stored as ${data.meshes[row]}` : "not stored as a mesh"],
  ];
  const body = part("numbers");
  body.replaceChildren();
  for (const [name, value, note] of rows) {
    const line = body.insertRow();
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = named(name);
    const cell = document.createElement("td");
    const shown = document.createElement("data");
    shown.value = value;
    shown.id = `number-${name}`;
    shown.textContent = spell(value);
    const { unit } = measures[name === "refitted_error" ? "error" : name] ?? {};
    cell.append(shown, unit === measures.error.unit ? data.unit : unit ? ` ${unit}` : "");
    const remark = document.createElement("td");
    remark.textContent = note;
    line.append(head, cell, remark);
  }
}

// ------------------------------------------------------------------------------------------------------ searching

function answer(row, wish) {
  const text = part("answer");
  if (row === null) {
    text.textContent = `No solution has ${wish}.`;
    text.className = "missed";
    return;
  }
  text.textContent = `${describe(row)}.`;
  text.className = "";
  pick(row);
}

part("by-triangles").addEventListener("submit", (event) => {
  event.preventDefault();
  const most = part("most-triangles").valueAsNumber;
  let best = null;
  columns.triangles.forEach((triangles, row) => {
    if (triangles <= most && (best === null || columns[data.measure][row] < columns[data.measure][best])) best = row;
  });
  answer(best, `at most ${plainNumber(most)} triangles; the smallest has ${plainNumber(Math.min(...columns.triangles))}`);
});

part("by-error").addEventListener("submit", (event) => {
  event.preventDefault();
  const most = Number(part("most-error").value.replace(",", "."));
  const measure = part("measure").value;
  const name = named(measure);
  if (!(most >= 0)) return answer(null, `an error of “${part("most-error").value}”; give a number`);
  const known = columns[measure].filter((error) => error !== null);
  const best = columns[measure].findIndex((error) => error !== null && error <= most); // sorted by triangles
  answer(best < 0 ? null : best, `a ${name} of at most ${spell(most)}; the least is ${spell(Math.min(...known))}`);
});

// ---------------------------------------------------------------------------------------------------- taking home

for (const button of document.querySelectorAll("#downloads button")) {
  button.addEventListener("click", () => {
    const kind = button.value;
    const mesh = compactMesh(state.geometry.points, state.geometry.paint, state.mesh.faces);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(MESH_FILES[kind](mesh));
    link.download = `${data.stem}_${columns.triangles[state.mesh.row]}.${kind}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
  });
}

part("copy").addEventListener("click", async () => {
  try {
    await navigator.clipboard.writeText(part("command").textContent);
    part("copied").textContent = "copied";
  } catch {
    getSelection().selectAllChildren(part("command"));
    part("copied").textContent = "selected; copy it with Ctrl+C";
  }
});

if (data.closed?.open) part("inside-key").style.background = data.closed.open.inside;
pick(data.chosen === null ? data.knee : data.chosen);
openViewer();
