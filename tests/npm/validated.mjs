// What Khronos' own validator says of glTF files: for each its issues, and how many triangles it counted.
import { readFileSync } from "node:fs";
import { validateBytes } from "gltf-validator";

const found = [];
for (const path of process.argv.slice(2)) {
  const report = await validateBytes(new Uint8Array(readFileSync(path)));
  const issues = report.issues.messages.map(({ code, severity, pointer }) => ({ code, severity, pointer }));
  found.push({ issues, triangles: report.info.totalTriangleCount });
}
console.log(JSON.stringify(found));
