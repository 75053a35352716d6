// The denoiser in Babylon.js: an EffectWrapper over the whole picture.
import { Engine } from "@babylonjs/core/Engines/engine.js";
import { Constants } from "@babylonjs/core/Engines/constants.js";
import { EffectRenderer, EffectWrapper } from "@babylonjs/core/Materials/effectRenderer.js";
import { RawTexture } from "@babylonjs/core/Materials/Textures/rawTexture.js";
import { RenderTargetTexture } from "@babylonjs/core/Materials/Textures/renderTargetTexture.js";
import { Scene } from "@babylonjs/core/scene.js";
import { colours, page, texels, weightTexels } from "./wamnet.js";

const VERTEX = `#version 300 es
in vec2 position;
void main() { gl_Position = vec4(position, 0.0, 1.0); }`;

page(async ({ manifest, images, sources, weights }) => {
  const { width, height, images: named } = manifest.check;
  const engine = new Engine(document.createElement("canvas"), false);
  const scene = new Scene(engine);
  const texture = (data, columns, rows, format) => new RawTexture(
    data, columns, rows, format, scene,
    false, // no mipmaps
    false, // row 0 is texel row 0
    Constants.TEXTURE_NEAREST_SAMPLINGMODE, Constants.TEXTURETYPE_FLOAT,
  );
  const textures = {};
  for (const [name, { channels }] of Object.entries(named)) {
    const data = texels(images[`image_${name}`], channels);
    textures[`image_${name}`] = texture(data, width, height, Constants.TEXTUREFORMAT_RGBA);
  }
  const { data, width: across, height: rows } = weightTexels(weights.denoise);
  textures.weight_texture = texture(data, across, rows, Constants.TEXTUREFORMAT_R);
  const wrapper = new EffectWrapper({
    engine,
    name: "wamnet",
    vertexShader: VERTEX,
    fragmentShader: sources.denoise,
    attributeNames: ["position"],
    samplerNames: Object.keys(textures),
  });
  await new Promise((resolve) => wrapper.effect.executeWhenCompiled(resolve));
  wrapper.onApplyObservable.add(() => {
    Object.entries(textures).forEach(([name, value]) => wrapper.effect.setTexture(name, value));
  });
  const target = new RenderTargetTexture("denoised", { width, height }, scene, {
    type: Constants.TEXTURETYPE_FLOAT,
    samplingMode: Constants.TEXTURE_NEAREST_SAMPLINGMODE,
    generateMipMaps: false,
    generateDepthBuffer: false,
  });
  new EffectRenderer(engine).render(wrapper, target);
  const read = await target.readPixels(); // texel row 0 is the picture's top row
  return { found: colours(read), device: `Babylon.js ${Engine.Version}` };
});
