// WebGL 2: shaders that compile in the background, float textures, and drawing in pieces.
//
// A slow device must not freeze: nothing here waits. Shaders are asked whether they are ready
// (KHR_parallel_shader_compile), pictures are drawn in strips of rows, and a fence tells when a strip is done.

const VERTEX = `#version 300 es
void main()
{
    gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}
`;

/** What a device lacks, in words for people. */
class Missing extends Error {}

/** The context was lost: it may come back. */
class Lost extends Error {}

/** What went wrong with a shader. */
class ShaderError extends Error {}

class Device {
  constructor(canvas, leastBuffers) {
    const options = { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" };
    const gl = canvas.getContext("webgl2", options);
    if (!gl) {
      throw new Missing("This browser does not offer WebGL 2.");
    }
    this.gl = gl;
    this.setUp(leastBuffers);
  }

  /** Get the extensions; once more after the context was lost. */
  setUp(leastBuffers) {
    const gl = this.gl;
    if (!gl.getExtension("EXT_color_buffer_float")) {
      throw new Missing(
        "This device cannot draw into textures of 32-bit floats (EXT_color_buffer_float is missing).",
      );
    }
    const buffers = gl.getParameter(gl.MAX_DRAW_BUFFERS);
    if (buffers < leastBuffers) {
      throw new Missing(`This device draws into ${buffers} textures at once; ${leastBuffers} are needed.`);
    }
    this.parallel = gl.getExtension("KHR_parallel_shader_compile");
    this.largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.array = gl.createVertexArray();
    const info = gl.getExtension("WEBGL_debug_renderer_info");
    this.name = gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
  }

  /** Start to compile a shader; `finish` says how it went. */
  compile(source) {
    const gl = this.gl;
    const program = gl.createProgram();
    const shaders = [
      [gl.VERTEX_SHADER, VERTEX],
      [gl.FRAGMENT_SHADER, source],
    ].map(([kind, text]) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      return shader;
    });
    gl.linkProgram(program);
    return { program, shaders, places: new Map() };
  }

  /** Tell whether asking for the result would not wait; without the extension nobody knows. */
  isCompiled(shader) {
    if (!this.parallel) {
      return true;
    }
    return this.gl.getProgramParameter(shader.program, this.parallel.COMPLETION_STATUS_KHR);
  }

  /** Take the result, or throw what the compiler says. */
  finish(shader) {
    const gl = this.gl;
    if (gl.isContextLost()) {
      throw new Lost("while a shader was compiled");
    }
    if (!gl.getProgramParameter(shader.program, gl.LINK_STATUS)) {
      const log = shader.shaders.map((one) => gl.getShaderInfoLog(one)).join("");
      throw new ShaderError((log || gl.getProgramInfoLog(shader.program) || "no reason given").trim());
    }
    shader.shaders.forEach((one) => gl.deleteShader(one));
  }

  /** A texture of floats that is read texel by texel; `format` R or RGBA. */
  texture(width, height, values = null, single = false) {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    }
    for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
      gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
    }
    const [inside, outside] = single ? [gl.R32F, gl.RED] : [gl.RGBA32F, gl.RGBA];
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, outside, gl.FLOAT, values);
    return texture;
  }

  /** Textures that are drawn into together. */
  target(size, count) {
    const gl = this.gl;
    const textures = Array.from({ length: count }, () => this.texture(size, size));
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    textures.forEach((texture, i) => {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0);
    });
    gl.drawBuffers(textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
    const status = gl.checkFramebufferStatus(gl.FRAMEBUFFER);
    if (status !== gl.FRAMEBUFFER_COMPLETE && !gl.isContextLost()) {
      throw new Missing(`This device cannot draw into ${count} float textures of ${size} x ${size} pixels.`);
    }
    return { frame, textures, size };
  }

  release(target) {
    target.textures.forEach((texture) => this.gl.deleteTexture(texture));
    this.gl.deleteFramebuffer(target.frame);
  }

  /** Draw rows of a target, or of the canvas for null. */
  draw(shader, target, textures, set, rows = null) {
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target ? target.frame : null);
    const [width, height] = target
      ? [target.size, target.size]
      : [gl.drawingBufferWidth, gl.drawingBufferHeight];
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    const [first, count] = rows || [0, height];
    gl.scissor(0, first, width, count);
    gl.useProgram(shader.program);
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(this.place(shader, name), unit);
    });
    set((name) => this.place(shader, name));
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Where a uniform is; null, which is ignored, where the compiler dropped it. */
  place(shader, name) {
    if (!shader.places.has(name)) {
      shader.places.set(name, this.gl.getUniformLocation(shader.program, name));
    }
    return shader.places.get(name);
  }

  /** Read the floats (rows from the top, RGBA) of one of a target's textures. */
  read(target, number) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + number);
    const values = new Float32Array(4 * target.size * target.size);
    gl.readPixels(0, 0, target.size, target.size, gl.RGBA, gl.FLOAT, values);
    return values;
  }

  /** Read the floats (rows from the top, RGBA) of a texture that is nobody's target just now. */
  readTexture(texture, size) {
    const gl = this.gl;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    const values = this.read({ frame, size }, 0);
    gl.deleteFramebuffer(frame);
    return values;
  }

  /** Store floats (rows from the top, RGBA) in a texture. */
  write(texture, size, values) {
    const gl = this.gl;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, size, size, gl.RGBA, gl.FLOAT, values);
  }

  fence() {
    const gl = this.gl;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    return sync;
  }

  isPassed(sync) {
    const gl = this.gl;
    if (gl.getSyncParameter(sync, gl.SYNC_STATUS) !== gl.SIGNALED) {
      return false;
    }
    gl.deleteSync(sync);
    return true;
  }
}
