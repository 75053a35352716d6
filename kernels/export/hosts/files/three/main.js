// The denoiser in three.js: a fragment shader over the whole picture, for each kernel.
import * as THREE from "three";
import { colours, page, texels, versionless, weightTexels } from "./wamnet.js";

const VERTEX = "in vec3 position; void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }";

function texture(data, width, height, format) {
  const made = new THREE.DataTexture(data, width, height, format, THREE.FloatType);
  made.needsUpdate = true; // filters are nearest and row 0 is texel row 0, as they are wanted
  return made;
}

page(async ({ manifest, images, sources, weights }) => {
  const { width, height, images: named } = manifest.check;
  const renderer = new THREE.WebGLRenderer();
  const camera = new THREE.Camera(), scene = new THREE.Scene();
  const quad = new THREE.Mesh(new THREE.PlaneGeometry(2, 2));
  quad.frustumCulled = false;
  scene.add(quad);
  const textures = {};
  for (const [name, { channels }] of Object.entries(named)) {
    textures[`image_${name}`] = texture(texels(images[`image_${name}`], channels), width, height, THREE.RGBAFormat);
  }
  let target;
  for (const { role, bindings } of manifest.kernels) {
    const { data, width: across, height: rows } = weightTexels(weights[role]);
    textures.weight_texture = texture(data, across, rows, THREE.RedFormat);
    const uniforms = Object.fromEntries(Object.entries(textures).map(([name, value]) => [name, { value }]));
    const fragmentShader = versionless(sources[role]); // three.js writes the version itself
    quad.material = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: VERTEX,
      fragmentShader,
      uniforms,
      depthTest: false,
    });
    const channels = bindings.find(({ name }) => name === "result").shape[2];
    const count = Math.ceil(channels / 4); // colour buffers
    const kind = { count, type: THREE.FloatType, minFilter: THREE.NearestFilter, magFilter: THREE.NearestFilter };
    target = new THREE.WebGLRenderTarget(width, height, { ...kind, depthBuffer: false });
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    target.textures.forEach((each, i) => {
      textures[`image_${role}_${i}`] = each; // of the first kernel of a rank: the next one's images
    });
  }
  const read = new Float32Array(width * height * 4);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, read); // texel row 0 is the picture's top row
  return { found: colours(read), device: `three.js ${THREE.REVISION}` };
});
