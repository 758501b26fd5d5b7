// Meshes as files, in the frame and with the very coordinates of the original's file: every double is written so that it
// reads back to the same double. (STL as text, since binary STL is single precision by definition; so is GLB, whose
// coordinates count from a local origin.) What else a file says comes from the package, as a template.

// The vertices that the triangles use, in ascending order, and the triangles and the break lines as rows of those.
function compactMesh(points, colours, faces, lines, uv) {
  const place = new Int32Array(points.length / 3).fill(-1);
  for (const row of faces) place[row] = 0;
  let count = 0;
  for (let row = 0; row < place.length; row++) if (place[row] === 0) place[row] = count++;
  const vertices = new Float64Array(3 * count);
  const channels = colours ? colours.length / place.length : 0;
  const paint = colours ? new Uint8Array(channels * count) : null;
  const places = uv ? new Float32Array(2 * count) : null;
  for (let row = 0; row < place.length; row++) {
    const to = place[row];
    if (to < 0) continue;
    for (let k = 0; k < 3; k++) vertices[3 * to + k] = points[3 * row + k];
    for (let k = 0; k < channels; k++) paint[channels * to + k] = colours[channels * row + k];
    for (let k = 0; uv && k < 2; k++) places[2 * to + k] = uv[2 * row + k];
  }
  const own = lines.map(({ rows, name }) => ({ rows: rows.map((row) => place[row]), name }));
  return { vertices, colours: paint, channels, faces: faces.map((row) => place[row]), lines: own, uv: places };
}

// The edges that break lines go along, each once, in the order of their ends.
function lineEdges(lines) {
  const edges = new Map();
  for (const { rows } of lines) {
    for (let k = 1; k < rows.length; k++) {
      const edge = [rows[k - 1], rows[k]].sort((a, b) => a - b);
      edges.set(String(edge), edge);
    }
  }
  return [...edges.values()].sort(([a, b], [c, d]) => a - c || b - d);
}

// header: the lines of a header, with 0 for the numbers of what it announces.
function plyFile({ vertices, colours, channels, faces, lines }, header) {
  const n = vertices.length / 3;
  const m = faces.length / 3;
  const edges = lineEdges(lines);
  const counts = { vertex: n, face: m, edge: edges.length };
  const head = header
    .filter((line) => edges.length || !/^(element edge|property int vertex[12]$)/.test(line))
    .map((line) => (line.startsWith("element") ? line.replace(/(\w+) 0$/, (_, name) => `${name} ${counts[name]}`) : line));
  const stride = 24 + channels;
  const body = new DataView(new ArrayBuffer(n * stride + m * 13 + 8 * edges.length));
  for (let i = 0; i < n; i++) {
    for (let k = 0; k < 3; k++) body.setFloat64(i * stride + 8 * k, vertices[3 * i + k], true);
    for (let k = 0; k < channels; k++) body.setUint8(i * stride + 24 + k, colours[channels * i + k]);
  }
  for (let i = 0, at = n * stride; i < m; i++, at += 13) {
    body.setUint8(at, 3);
    for (let k = 0; k < 3; k++) body.setInt32(at + 1 + 4 * k, faces[3 * i + k], true);
  }
  edges.flat().forEach((row, k) => body.setInt32(n * stride + m * 13 + 4 * k, row, true));
  return new Blob([[...head, "end_header\n"].join("\n"), body], { type: "application/octet-stream" });
}

// Colours stand behind the coordinates, as fractions of 1. comments: the lines that begin the file.
function objFile({ vertices, colours, channels, faces, lines }, comments) {
  const text = [...comments];
  for (let i = 0; i < vertices.length / 3; i++) {
    const numbers = [...vertices.subarray(3 * i, 3 * i + 3)];
    if (colours) for (let k = 0; k < 3; k++) numbers.push(colours[channels * i + k] / 255);
    text.push(`v ${numbers.join(" ")}`);
  }
  for (let i = 0; i < faces.length; i += 3) text.push(`f ${faces[i] + 1} ${faces[i + 1] + 1} ${faces[i + 2] + 1}`);
  for (const { rows } of lines) text.push(`l ${Array.from(rows, (row) => row + 1).join(" ")}`);
  return new Blob([text.join("\n"), "\n"], { type: "text/plain" });
}

// template: the tree of a glTF of one mesh, whose extras say how its coordinates come about.
function glbFile({ vertices, colours, channels, faces, uv, image }, template) {
  const tree = structuredClone(template);
  const { origin, axes, metres_per_unit: scale } = tree.nodes[0].extras;
  const turn = axes.map((axis) => [axis.startsWith("-") ? -1 : 1, "xyz".indexOf(axis.at(-1))]);
  const n = vertices.length / 3;
  const place = new Float32Array(3 * n);
  for (let i = 0; i < n; i++) {
    turn.forEach(([sign, axis], k) => (place[3 * i + k] = sign * (vertices[3 * i + axis] - origin[axis]) * scale[axis] + 0));
  }
  const paint = new Uint8Array(colours ? 4 * n : 0).fill(255);
  if (colours) for (let i = 0; i < n; i++) paint.set(colours.subarray(channels * i, channels * i + channels), 4 * i);
  const [primitive] = tree.meshes[0].primitives;
  const contents = [];
  const put = (accessor, content, count, ends = {}) => {
    Object.assign(tree.accessors[accessor], { count, ...ends });
    contents[tree.accessors[accessor].bufferView] = content;
  };
  const end = (pick) => [0, 1, 2].map((k) => place.reduce((best, value, i) => (i % 3 === k ? pick(best, value) : best), place[k]));
  put(primitive.attributes.POSITION, place, n, { min: end(Math.min), max: end(Math.max) });
  if (colours) put(primitive.attributes.COLOR_0, paint, n);
  put(primitive.indices, Uint32Array.from(faces), faces.length);
  if (uv) put(primitive.attributes.TEXCOORD_0, uv.map((value, k) => (k % 2 ? 1 - value : value)), n); // from the upper left corner
  if (image) {
    const [, kind, text] = image.match(/^data:(.*);base64,(.*)$/);
    contents[tree.images[0].bufferView] = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    tree.images[0].mimeType = kind;
  }
  let size = 0;
  const parts = contents.flatMap((content, view) => {
    Object.assign(tree.bufferViews[view], { byteOffset: size, byteLength: content.byteLength });
    const filler = new Uint8Array(-content.byteLength & 3);
    size += content.byteLength + filler.length;
    return [content, filler];
  });
  tree.buffers[0].byteLength = size;
  const text = new TextEncoder().encode(JSON.stringify(tree));
  const padding = -text.length & 3;
  const head = new Uint32Array([0x46546c67, 2, 28 + text.length + padding + size, text.length + padding, 0x4e4f534a]);
  return new Blob([head, text, " ".repeat(padding), new Uint32Array([size, 0x004e4942]), ...parts], { type: "model/gltf-binary" });
}

// Points as "northing easting height". template: what stands around them, and how each break line begins.
function xmlFile({ vertices, faces, lines }, template) {
  const point = (row) => `${vertices[3 * row + 1]} ${vertices[3 * row]} ${vertices[3 * row + 2]}`;
  const text = [template.before];
  if (lines.length) {
    text.push("<SourceData><Breaklines>\n");
    for (const { rows, name } of lines) text.push(`${template.lines[name]}<PntList3D>${Array.from(rows, point).join(" ")}</PntList3D></Breakline>\n`);
    text.push("</Breaklines></SourceData>\n");
  }
  let [low, high] = [Infinity, -Infinity];
  for (let i = 2; i < vertices.length; i += 3) [low, high] = [Math.min(low, vertices[i]), Math.max(high, vertices[i])];
  text.push(`${template.definition} elevMin="${low}" elevMax="${high}">\n<Pnts>\n`);
  for (let i = 0; i < vertices.length / 3; i++) text.push(`<P id="${i + 1}">${point(i)}</P>\n`);
  text.push("</Pnts>\n<Faces>\n");
  for (let i = 0; i < faces.length; i += 3) text.push(`<F>${faces[i] + 1} ${faces[i + 1] + 1} ${faces[i + 2] + 1}</F>\n`);
  text.push("</Faces>\n", template.after);
  return new Blob(text, { type: "application/xml" });
}

function stlFile({ vertices, faces }) {
  const corner = (row) => [vertices[3 * row], vertices[3 * row + 1], vertices[3 * row + 2]];
  const lines = ["solid simplified"];
  for (let i = 0; i < faces.length; i += 3) {
    const [a, b, c] = [corner(faces[i]), corner(faces[i + 1]), corner(faces[i + 2])];
    const u = b.map((value, k) => value - a[k]);
    const v = c.map((value, k) => value - a[k]);
    const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    const length = Math.hypot(...normal) || 1;
    lines.push(`facet normal ${normal.map((value) => (value / length).toPrecision(7)).join(" ")}`, "outer loop");
    for (const point of [a, b, c]) lines.push(`vertex ${point.join(" ")}`);
    lines.push("endloop", "endfacet");
  }
  lines.push("endsolid simplified\n");
  return new Blob([lines.join("\n")], { type: "text/plain" });
}

const MESH_FILES = { ply: plyFile, obj: objFile, stl: stlFile, glb: glbFile, xml: xmlFile };
