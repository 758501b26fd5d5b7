// The page of a simplification: pick a solution of the front, see its mesh beside the original, take it home.

const data = JSON.parse(document.getElementById("data").textContent);
const { columns, model } = data;
const count = columns.triangles.length;
const embedded = data.solutions.map((solution, row) => (solution ? row : -1)).filter((row) => row >= 0);
const part = (id) => document.getElementById(id);
const sixDigits = d3.format(",.6~g");
const LINEAR_REACH = 5; // errors that differ by no more than this factor stand on a linear axis

function spell(value) {
  const size = Math.abs(value);
  if (Number.isInteger(value) || (size >= 1e5 && size < 1e9)) return plainNumber(Math.round(value));
  return size >= 1e9 || size < 1e-4 ? d3.format(".6~e")(value) : sixDigits(value);
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

function describe(row) {
  const name = part("axis").value;
  const error = columns[name][row] === null ? `${named(name)} not known` : `${named(name)} ${readable(columns[name][row])}${data.unit}`;
  return `solution ${row}: ${plainNumber(columns.triangles[row])} triangles${columns.free[row] ? ", free" : ""}, ${error}`;
}

const chart = new FrontChart(part("chart"), {
  name: "The front: error against triangles. Each point is a simplified mesh.",
  front: { x: columns.triangles, y: columns[part("axis").value], steps: false, hollow: data.solutions.map((solution) => !solution) },
  special: [
    { row: data.knee, mark: "diamond", name: "knee: the best compromise" },
    ...(data.chosen === null ? [] : [{ row: data.chosen, mark: "star", name: "chosen when the front was made" }]),
  ],
  labels: { x: "triangles", y: "" },
  log: { x: part("log-x").checked, y: true },
  describe,
  onPick: pick,
});
for (const axis of ["x", "y"]) {
  part(`log-${axis}`).addEventListener("change", (event) => {
    chart.setLog(axis, event.target.checked);
    if (axis === "y") state.logChosen = true;
  });
}

// The error that the chart shows and the searches go by: one for all of them.
function measureBy(name) {
  const y = columns[name];
  const known = y.filter((value) => value !== null);
  const above = known.filter((value) => value > ROUNDING * Math.max(...known));
  if (!state.logChosen) part("log-y").checked = Math.max(...above) > LINEAR_REACH * Math.min(...above);
  const beside = data.series.filter((one) => name in one.y);
  const log = part("log-y").checked;
  chart.show({
    y,
    steps: data.searched.includes(name),
    series: beside.map((one) => ({ ...one, y: one.y[name], faint: true, line: "thin", mark: one.x.length > MANY_BESIDE ? null : "circle" })),
    label: withUnit(name === "error" ? "error: sum over all vertices" : named(name), measures.error.unit),
    log,
  });
  const remarks = [];
  if (known.length < count) remarks.push(`${plainNumber(known.length)} of ${plainNumber(count)} solutions have a ${named(name)}.`);
  if (!data.searched.includes(name)) remarks.push(`The search was for the ${named(data.searched[0])}; by the ${named(name)} a larger mesh may be the worse one.`);
  const absent = data.series.filter((one) => !beside.includes(one)).map((one) => one.name);
  if (absent.length) remarks.push(`Not drawn, as their ${named(name)} is not known: ${absent.join(", ")}.`);
  part("axis-remarks").textContent = remarks.join(" ");
  part("axis").value = part("measure").value = name;
  part("best-by").textContent = named(name);
  if (state.row === null) return;
  slider.setAttribute("aria-valuetext", describe(state.row));
  if (!state.limitTyped && y[state.row] !== null) part("most-error").value = d3.format(".3~g")(y[state.row]);
}
for (const id of ["axis", "measure"]) part(id).addEventListener("change", (event) => measureBy(event.target.value));
part("most-error").addEventListener("input", () => (state.limitTyped = true));

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
  noteLink();
  const place = embedded.findLastIndex((other) => other <= row);
  slider.value = Math.max(0, place);
  slider.setAttribute("aria-valuetext", describe(row));
  part("picked").textContent = `solution ${row} of 0 to ${count - 1}`;
  numbers(row);
  const file = `${data.stem}_${columns.triangles[row]}.ply`;
  part("command").textContent =
    data.folder === null ? `front[${row}].save("${file}")` : `meshsimp pick ${data.folder} --solution ${row} -o ${file}`;
  const solution = data.solutions[row];
  part("simplified-title").textContent = sizeOf(row);
  part("not-embedded").hidden = Boolean(solution);
  for (const button of document.querySelectorAll("#downloads button")) button.disabled = !solution;
  const [faces, levels, lines] = solution
    ? await Promise.all([unpackFaces(solution.faces), unpackArray(solution.deviation), solution.lines ? unpackLines(solution.lines) : []])
    : [null, null, []];
  if (state.row !== row) return; // another one was picked meanwhile
  const edges = lines.length ? lines.flatMap(({ rows }) => [...rows.subarray(1)].flatMap((row, k) => [rows[k], row])) : null;
  state.mesh = faces && { row, faces, levels, lines, edges };
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
  const errors = columns[part("axis").value];
  let best = null;
  columns.triangles.forEach((triangles, row) => {
    if (triangles <= most && errors[row] !== null && (best === null || errors[row] < errors[best])) best = row;
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
    const { points, paint, uv } = state.geometry;
    const mesh = { ...compactMesh(points, paint, state.mesh.faces, state.mesh.lines, uv), image: data.texture?.image };
    const link = document.createElement("a");
    link.href = URL.createObjectURL(MESH_FILES[kind](mesh, data.files[kind]));
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

// ---------------------------------------------------------------------------------------------------------- the link

// The address says which solution is shown, and of the controls marked data-linked those that are not as the page opens.
// Inside another document the page has no address of its own.
const hasAddress = ["file:", "http:", "https:"].includes(location.protocol);
const LINK_DELAY = 250; // browsers refuse an address that changes all the time [ms]
const valueOf = (control) => (control.type === "checkbox" ? String(control.checked) : control.value);
const nameOf = (control) => control.name || control.id;

function usualOf(control) {
  if (control.type === "checkbox") return String(control.defaultChecked);
  if (control.tagName === "SELECT") return ([...control.options].find((option) => option.defaultSelected) ?? control.options[0]).value;
  return control.defaultValue;
}

function linked() {
  return [...document.querySelectorAll("[data-linked]")].filter((control) => control.type !== "radio" || control.checked);
}

function link() {
  const words = new URLSearchParams({ solution: state.row });
  for (const control of linked()) {
    const isUsual = control.type === "radio" ? control.defaultChecked : valueOf(control) === usualOf(control);
    if (!isUsual) words.set(nameOf(control), valueOf(control));
  }
  return `#${words}`;
}

function noteLink() {
  clearTimeout(state.linking);
  if (hasAddress && state.opened) state.linking = setTimeout(() => history.replaceState(null, "", link()), LINK_DELAY);
}

// Do what the address says; return the solution that it names, if there is one of that number.
function followLink() {
  const words = new URLSearchParams(location.hash.slice(1));
  for (const control of document.querySelectorAll("[data-linked]")) {
    const value = words.get(nameOf(control));
    if (value === null || (control.type === "radio" && control.value !== value)) continue;
    const known = control.tagName !== "SELECT" || [...control.options].some((option) => option.value === value);
    if (!known) continue;
    if (control.type === "checkbox" || control.type === "radio") control.checked = control.type === "radio" || value === "true";
    else control.value = value;
    control.dispatchEvent(new Event(control.type === "range" ? "input" : "change", { bubbles: true }));
  }
  const named = words.get("solution");
  if (named === null) return null;
  const row = /^\d+$/.test(named) ? Number(named) : count;
  if (row < count) return row;
  part("answer").textContent = `The link names solution ${named}; there are 0 to ${count - 1}.`;
  part("answer").className = "missed";
  return null;
}

document.addEventListener("change", (event) => "linked" in event.target.dataset && noteLink());
document.addEventListener("input", (event) => "linked" in event.target.dataset && noteLink());
addEventListener("hashchange", () => {
  const row = followLink();
  if (row !== null) pick(row);
});
part("copy-link").hidden = !hasAddress;
part("copy-link").addEventListener("click", async () => {
  const address = location.href.replace(/#.*|$/, link());
  history.replaceState(null, "", address);
  try {
    await navigator.clipboard.writeText(address);
    part("link-copied").textContent = "copied";
  } catch {
    part("link-copied").textContent = "it is in the address bar";
  }
});

if (data.closed?.open) part("inside-key").style.background = data.closed.open.inside;
measureBy(part("axis").value);
pick(data.chosen === null ? data.knee : data.chosen);
openViewer().then(() => {
  const row = followLink();
  if (row !== null) pick(row);
  state.opened = true;
});
