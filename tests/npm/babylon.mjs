// The levels of detail of a GLB, so many as are said, as Babylon.js loads them, the coarsest first: where the corners of
// their triangles are in a right-handed world, as that of glTF is, and their texture coordinates.
import { readFileSync } from "node:fs";
import { NullEngine } from "@babylonjs/core/Engines/nullEngine.js";
import { ImportMeshAsync } from "@babylonjs/core/Loading/sceneLoader.js";
import { Vector3 } from "@babylonjs/core/Maths/math.vector.js";
import { Logger } from "@babylonjs/core/Misc/logger.js";
import { Scene } from "@babylonjs/core/scene.js";
import "@babylonjs/loaders/glTF/2.0/index.js";

Logger.LogLevels = Logger.WarningLogLevel | Logger.ErrorLogLevel;
const file = new Uint8Array(readFileSync(process.argv[2]));
const engine = new NullEngine({ useHighPrecisionMatrix: true });
const levels = [];
for (let most = 1; most <= Number(process.argv[3] ?? 1); most++) {
  const scene = new Scene(engine);
  scene.useRightHandedSystem = true;
  // it begins with the coarsest level, and lets each go when the next finer one is there
  const pluginOptions = { gltf: { extensionOptions: { MSFT_lod: { maxLODsToLoad: most } } } };
  await ImportMeshAsync(file, scene, { pluginExtension: ".glb", pluginOptions });
  await scene.whenReadyAsync();
  const meshes = scene.meshes.filter((mesh) => mesh.getTotalVertices() > 0 && mesh.isEnabled());
  if (meshes.length !== 1) throw new Error(`${meshes.length} meshes are shown`);
  const [mesh] = meshes;
  const [at, uv] = [mesh.getVerticesData("position"), mesh.getVerticesData("uv")];
  const world = mesh.computeWorldMatrix(true);
  const place = (k) => Vector3.TransformCoordinates(Vector3.FromArray(at, 3 * k), world).asArray();
  const indices = Array.from(mesh.getIndices());
  levels.push({ corners: indices.map(place), uv: uv && indices.map((k) => [uv[2 * k], uv[2 * k + 1]]) });
}
process.stdout.write(JSON.stringify(levels), () => process.exit(0));
