export {
    AmbientLight, BackSide, BufferAttribute, BufferGeometry, CanvasTexture, Color, ColorManagement, DirectionalLight, DoubleSide, FrontSide,
    LinearFilter, LineBasicMaterial, LineSegments, LinearSRGBColorSpace, Mesh, MeshBasicMaterial, MeshLambertMaterial, OrthographicCamera,
    PerspectiveCamera, RepeatWrapping, Scene, Vector3, WebGLRenderer, WebGLRenderTarget,
} from "three";
export { OrbitControls } from "three/addons/controls/OrbitControls.js";
