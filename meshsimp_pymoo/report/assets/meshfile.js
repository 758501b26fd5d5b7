// Meshes as files, in the frame and with the very coordinates of the original's file: every double is written so that it
// reads back to the same double. (STL as text, since binary STL is single precision by definition.)

// The vertices that the triangles use, in ascending order, and the triangles as rows of those.
function compactMesh(points, colours, faces) {
  const place = new Int32Array(points.length / 3).fill(-1);
  for (const row of faces) place[row] = 0;
  let count = 0;
  for (let row = 0; row < place.length; row++) if (place[row] === 0) place[row] = count++;
  const vertices = new Float64Array(3 * count);
  const channels = colours ? colours.length / place.length : 0;
  const paint = colours ? new Uint8Array(channels * count) : null;
  for (let row = 0; row < place.length; row++) {
    const to = place[row];
    if (to < 0) continue;
    for (let k = 0; k < 3; k++) vertices[3 * to + k] = points[3 * row + k];
    for (let k = 0; k < channels; k++) paint[channels * to + k] = colours[channels * row + k];
  }
  return { vertices, colours: paint, channels, faces: faces.map((row) => place[row]) };
}

function plyFile({ vertices, colours, channels, faces }) {
  const n = vertices.length / 3;
  const m = faces.length / 3;
  const header = ["ply", "format binary_little_endian 1.0", `element vertex ${n}`];
  for (const axis of "xyz") header.push(`property double ${axis}`);
  for (const name of ["red", "green", "blue", "alpha"].slice(0, channels)) header.push(`property uchar ${name}`);
  header.push(`element face ${m}`, "property list uchar int vertex_indices", "end_header\n");
  const stride = 24 + channels;
  const body = new DataView(new ArrayBuffer(n * stride + m * 13));
  for (let i = 0; i < n; i++) {
    for (let k = 0; k < 3; k++) body.setFloat64(i * stride + 8 * k, vertices[3 * i + k], true);
    for (let k = 0; k < channels; k++) body.setUint8(i * stride + 24 + k, colours[channels * i + k]);
  }
  for (let i = 0, at = n * stride; i < m; i++, at += 13) {
    body.setUint8(at, 3);
    for (let k = 0; k < 3; k++) body.setInt32(at + 1 + 4 * k, faces[3 * i + k], true);
  }
  return new Blob([header.join("\n"), body], { type: "application/octet-stream" });
}

// Colours stand behind the coordinates, as fractions of 1.
function objFile({ vertices, colours, channels, faces }) {
  const lines = [];
  for (let i = 0; i < vertices.length / 3; i++) {
    const numbers = [...vertices.subarray(3 * i, 3 * i + 3)];
    if (colours) for (let k = 0; k < 3; k++) numbers.push(colours[channels * i + k] / 255);
    lines.push(`v ${numbers.join(" ")}`);
  }
  for (let i = 0; i < faces.length; i += 3) lines.push(`f ${faces[i] + 1} ${faces[i + 1] + 1} ${faces[i + 2] + 1}`);
  return new Blob([lines.join("\n"), "\n"], { type: "text/plain" });
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

const MESH_FILES = { ply: plyFile, obj: objFile, stl: stlFile };
