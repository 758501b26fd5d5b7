// The meshes of GLB files as glTF-Transform and Google's own Draco read them: the corners of their triangles.
import { NodeIO } from "@gltf-transform/core";
import { KHRDracoMeshCompression } from "@gltf-transform/extensions";
import draco3d from "draco3dgltf";

const io = new NodeIO()
  .registerExtensions([KHRDracoMeshCompression])
  .registerDependencies({ "draco3d.decoder": await draco3d.createDecoderModule() });
const found = [];
for (const path of process.argv.slice(2)) {
  const document = await io.read(path);
  found.push(document.getRoot().listNodes().filter((node) => node.getMesh()).map((node) => {
    const at = node.getWorldTranslation();
    const [primitive] = node.getMesh().listPrimitives();
    const indices = Array.from(primitive.getIndices().getArray());
    const corners = (name) => {
      const accessor = primitive.getAttribute(name);
      return accessor && indices.map((k) => accessor.getElement(k, []));
    };
    const position = corners("POSITION").map((place) => place.map((value, axis) => value + at[axis]));
    return { position, color: corners("COLOR_0"), uv: corners("TEXCOORD_0") };
  }));
}
console.log(JSON.stringify(found));
