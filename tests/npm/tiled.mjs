// Which tiles NASA's 3d-tiles-renderer shows of a tileset from a row of heights above its middle [m], and where their
// triangles are in the frame of the tileset.
import { readFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { PerspectiveCamera, Sphere, Vector3 } from "three";

const [path, ...heights] = process.argv.slice(2);
const HOME = "http://tiles.test/";
globalThis.requestAnimationFrame = (call) => setTimeout(call, 0);
globalThis.cancelAnimationFrame = clearTimeout;
globalThis.self = globalThis;
globalThis.window = globalThis;
globalThis.location = { href: HOME };
globalThis.fetch = async (url) => new Response(readFileSync(join(dirname(path), String(url).slice(HOME.length))));

const { TilesRenderer } = await import("3d-tiles-renderer");
const tiles = new TilesRenderer(HOME + "tileset.json");
tiles.errorTarget = 1;
const camera = new PerspectiveCamera(60, 16 / 9, 0.1, 1e9);
tiles.setCamera(camera);
tiles.setResolution(camera, 1920, 1080);
const loaded = [];
tiles.addEventListener("load-model", ({ scene, tile }) => loaded.push([tile.content.uri, scene]));
const rest = () => new Promise((resolve) => setTimeout(resolve, 2));
const sphere = new Sphere();
const views = [];

async function settle() {
  for (let calm = 0, k = 0; calm < 5 && k < 500; k++) {
    tiles.update();
    await rest();
    const { downloading, parsing, queued } = tiles.stats;
    calm = downloading + parsing + queued === 0 && tiles.root ? calm + 1 : 0;
  }
}

await settle();
tiles.getBoundingSphere(sphere);
const up = new Vector3();
tiles.group.updateMatrixWorld(true);
for (const height of heights.map(Number)) {
  // the root's own z is up, wherever on Earth it stands
  up.setFromMatrixColumn(tiles.root.engineData.transform, 2).normalize();
  camera.position.copy(sphere.center).addScaledVector(up, height);
  camera.up.setFromMatrixColumn(tiles.root.engineData.transform, 1).normalize();
  camera.lookAt(sphere.center);
  camera.updateMatrixWorld(true);
  await settle();
  views.push([...tiles.visibleTiles].map((tile) => tile.content.uri));
}
const corners = Object.fromEntries(loaded.map(([name, scene]) => {
  const found = [];
  scene.updateMatrixWorld(true);
  scene.traverse((mesh) => {
    if (!mesh.isMesh) return;
    const { position } = mesh.geometry.attributes;
    for (const k of mesh.geometry.index.array) {
      found.push(new Vector3().fromBufferAttribute(position, k).applyMatrix4(mesh.matrixWorld).toArray());
    }
  });
  return [name, found];
}));
process.stdout.write(JSON.stringify({ views, corners }), () => process.exit(0));
