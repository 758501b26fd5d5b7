// Arrays as the page embeds them: base64 of gzip of all first bytes of the numbers, then all second bytes, and so on.

const ARRAY_KINDS = { u1: Uint8Array, u2: Uint16Array, u4: Uint32Array, f8: Float64Array };

async function unpackArray({ kind, data }) {
  const text = atob(data);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const Kind = ARRAY_KINDS[kind];
  const width = Kind.BYTES_PER_ELEMENT;
  if (width === 1) return planes;
  const count = planes.length / width;
  const bytes = new Uint8Array(planes.length);
  for (let k = 0; k < width; k++) {
    for (let i = 0, at = k * count, to = k; i < count; i++, at++, to += width) bytes[to] = planes[at];
  }
  return new Kind(bytes.buffer);
}

// Break lines: the vertices of all of them one after the other, how many each has, and the number of its name.
async function unpackLines(packed) {
  const [rows, sizes, names] = await Promise.all([packed.rows, packed.sizes, packed.names].map(unpackArray));
  let at = 0;
  return Array.from(sizes, (size, k) => ({ rows: rows.subarray(at, (at += size)), name: names[k] }));
}

// Triangles (a, b, c) with a the smallest, sorted by it, come as three columns: steps of a, then b - a, then c - a.
async function unpackFaces(packed) {
  const columns = await unpackArray(packed);
  const count = columns.length / 3;
  const faces = new Uint32Array(columns.length);
  for (let i = 0, a = 0; i < count; i++) {
    a += columns[i];
    faces[3 * i] = a;
    faces[3 * i + 1] = a + columns[count + i];
    faces[3 * i + 2] = a + columns[2 * count + i];
  }
  return faces;
}
