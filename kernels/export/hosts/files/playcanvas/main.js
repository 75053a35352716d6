// The denoiser in PlayCanvas: a shader over the whole picture.
import * as pc from "playcanvas";
import { colours, page, texels, versionless, weightTexels } from "./wamnet.js";

const VERTEX = "attribute vec2 vertex_position; void main() { gl_Position = vec4(vertex_position, 0.0, 1.0); }";

page(async ({ manifest, images, sources, weights }) => {
  const { width, height, images: named } = manifest.check;
  const device = new pc.Application(document.createElement("canvas")).graphicsDevice;
  const texture = (columns, rows, format, levels) => new pc.Texture(device, {
    width: columns,
    height: rows,
    format,
    mipmaps: false,
    flipY: false, // row 0 is texel row 0
    minFilter: pc.FILTER_NEAREST,
    magFilter: pc.FILTER_NEAREST,
    addressU: pc.ADDRESS_CLAMP_TO_EDGE,
    addressV: pc.ADDRESS_CLAMP_TO_EDGE,
    levels,
  });
  for (const [name, { channels }] of Object.entries(named)) {
    const data = texels(images[`image_${name}`], channels);
    const made = texture(width, height, pc.PIXELFORMAT_RGBA32F, [data]);
    device.scope.resolve(`image_${name}`).setValue(made);
  }
  const { data, width: across, height: rows } = weightTexels(weights.denoise);
  device.scope.resolve("weight_texture").setValue(texture(across, rows, pc.PIXELFORMAT_R32F, [data]));
  // The engine writes the version and its own output: ours is another name of that.
  const output = /^layout\(location = 0\) out vec4 result;$/m;
  const fragmentGLSL = versionless(sources.denoise).replace(output, "#define result pcFragColor0");
  const shader = pc.ShaderUtils.createShader(device, {
    uniqueName: "wamnet",
    attributes: { vertex_position: pc.SEMANTIC_POSITION },
    vertexGLSL: VERTEX,
    fragmentGLSL,
  });
  const colorBuffer = texture(width, height, pc.PIXELFORMAT_RGBA32F);
  const target = new pc.RenderTarget({ colorBuffer, depth: false });
  pc.drawQuadWithShader(device, target, shader);
  const read = await colorBuffer.read(0, 0, width, height, { renderTarget: target });
  return { found: colours(read), device: `PlayCanvas ${pc.version}` };
});
