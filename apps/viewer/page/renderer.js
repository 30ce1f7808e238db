// SPDX-License-Identifier: Apache-2.0
// Draws a model with WebGL2: parameters in float textures; a first pass poses and projects every visible
// Gaussian once (transform feedback) into a texture; a second draws one rectangle for each, farthest first,
// blended into floats. Rectangles are indexed, not instances: software rasterisers draw these one by one. All of it can be made again after a lost context.
import { keyWeights, windowSigmas } from './motion.js';
import { packKey, packRows, texelsPerKey, texelsPerRow } from './packing.js';
import { fragmentShader, keyLayers, modeNumbers, screenFragmentShader, screenVertexShader } from './shaders.js';
import { noFragments, poseShader, posedOutputs } from './shaders.js';
import { shTexels, textureWidth, vertexShader, wheelColors } from './shaders.js';

export class Renderer {
  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext('webgl2', { alpha: false, antialias: false, depth: false, powerPreference: 'high-performance' });
    if (!gl) throw new Error('This browser has no WebGL2, which the viewer needs. Firefox, Chromium, Edge and Safari 15 or later '
      + 'have it; hardware acceleration may be off in the settings, or the graphics driver may be blocked.');
    this.gl = gl;
    this.model = null;
    this.start();
  }

  // Everything that lives in the context.
  start() {
    const { gl } = this;
    const floats = gl.getExtension('EXT_color_buffer_float');
    this.canBlendFloats = !!(floats && gl.getExtension('EXT_float_blend'));
    this.hasFloats = !!floats || !!gl.getExtension('EXT_color_buffer_half_float');
    this.programs = new Map();
    this.posedTexture = null;
    this.targets = new Map();
    this.order = gl.createBuffer();
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
    gl.bindVertexArray(null);
    this.posed = gl.createBuffer();
    this.feedback = gl.createTransformFeedback();
    this.rectangles = gl.createVertexArray();
    this.corners = gl.createBuffer();
    this.nothing = gl.createVertexArray();
    this.count = 0;
    this.screen = this.link(screenVertexShader, screenFragmentShader);
    if (this.model) this.setModel(this.model);
  }

  link(vertex, fragment, outputs) {
    const { gl } = this, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
        throw new Error(`The graphics driver rejects a shader: ${gl.getShaderInfoLog(shader)}`);
    }
    gl.bindAttribLocation(program, 0, 'row');
    if (outputs) gl.transformFeedbackVaryings(program, outputs, gl.INTERLEAVED_ATTRIBS);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
      throw new Error(`The graphics driver rejects a program: ${gl.getProgramInfoLog(program)}`);
    const places = {};
    for (let i = 0; i < (gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) || 0); ++i) {
      const { name } = gl.getActiveUniform(program, i);
      places[name.replace('[0]', '')] = gl.getUniformLocation(program, name);
    }
    return { program, places };
  }

  // Float textures cannot be filtered; without this they read as 0.
  setNearest(kind) {
    for (const name of ['TEXTURE_MIN_FILTER', 'TEXTURE_MAG_FILTER']) this.gl.texParameteri(kind, this.gl[name], this.gl.NEAREST);
  }

  programOf(mode) {
    if (!this.programs.has(mode)) {
      const { model } = this, outputs = posedOutputs(mode);
      const pose = this.link(poseShader(model, mode), noFragments, outputs), draw = this.link(vertexShader(model, mode), fragmentShader(model, mode));
      this.programs.set(mode, { pose, draw, texels: outputs.length });
    }
    return this.programs.get(mode);
  }

  // A texture of RGBA32F texels, textureWidth wide, from the floats that values(length) returns.
  texture(rows, texels, values) {
    const { gl } = this, height = Math.max(1, Math.ceil(rows * texels / textureWidth));
    if (height > gl.getParameter(gl.MAX_TEXTURE_SIZE))
      throw new Error(`This model of ${rows} Gaussians is larger than this graphics device can hold.`);
    const all = values(textureWidth * height * 4), texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, textureWidth, height);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, textureWidth, height, gl.RGBA, gl.FLOAT, all);
    this.setNearest(gl.TEXTURE_2D);
    return texture;
  }

  setModel(model) {
    const { gl } = this;
    for (const texture of [this.rows, this.sh, this.keys]) if (texture && this.model) gl.deleteTexture(texture);
    for (const { pose, draw } of this.programs.values()) {
      gl.deleteProgram(pose.program);
      gl.deleteProgram(draw.program);
    }
    this.programs.clear();
    this.model = model;
    this.count = 0;
    this.makeRoom(model.count);
    this.rows = this.texture(model.count, texelsPerRow(model), (length) => {
      const values = new Float32Array(length), texels = texelsPerRow(model);
      packRows(model, values, (i) => i * texels);
      return values;
    });
    const texels = shTexels(model.sh_degree), rest = 3 * ((model.sh_degree + 1) ** 2 - 1);
    this.sh = this.texture(model.count, texels, (length) => {
      const values = new Float32Array(length), { sh0, sh_rest } = model.arrays;
      for (let i = 0; i < model.count; ++i) {
        const o = 4 * texels * i;
        for (let k = 0; k < 3; ++k) values[o + k] = sh0[3 * i + k];
        for (let k = 0; k < rest; ++k) values[o + 3 + k] = sh_rest[rest * i + k];
      }
      return values;
    });
    this.keys = null;
    if (model.keyCount) {
      this.keyHeight = Math.max(1, Math.ceil(model.moving * texelsPerKey(model) / textureWidth));
      this.keys = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.keys);
      gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA32F, textureWidth, this.keyHeight, keyLayers);
      this.setNearest(gl.TEXTURE_2D_ARRAY);
      this.layers = new Array(keyLayers).fill(-1);
    }
  }

  // Room for n posed Gaussians, and the corners of their rectangles: 4 i + 0, 1, 2 and 2, 1, 3.
  makeRoom(n) {
    const { gl } = this, height = Math.max(1, Math.ceil(4 * n / textureWidth)), corners = new Uint32Array(6 * n);
    for (let i = 0; i < n; ++i) for (let k = 0; k < 6; ++k) corners[6 * i + k] = 4 * i + [0, 1, 2, 2, 1, 3][k];
    gl.bindVertexArray(this.rectangles);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.posed);
    gl.bufferData(gl.ARRAY_BUFFER, 16 * textureWidth * height, gl.DYNAMIC_COPY);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    if (this.posedTexture) gl.deleteTexture(this.posedTexture);
    this.posedTexture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.posedTexture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, textureWidth, height);
    this.setNearest(gl.TEXTURE_2D);
  }

  setOrder(order, count) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ARRAY_BUFFER, order.subarray(0, count), gl.DYNAMIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    this.count = count;
  }

  // Uploads those of the needed keys that are not on the device.
  sendKeys({ first, weights }) {
    const { gl, model } = this, texels = texelsPerKey(model);
    for (let key = first; key < first + weights.length; ++key) {
      if (this.layers[key % keyLayers] === key) continue;
      this.layers[key % keyLayers] = key;
      const values = new Float32Array(textureWidth * this.keyHeight * 4);
      packKey(model, key, values, (i) => i * texels);
      gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.keys);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, key % keyLayers, textureWidth, this.keyHeight, 1, gl.RGBA, gl.FLOAT, values);
    }
  }

  // A framebuffer of that size: 'bytes', or 'sums' and 'samples' (floats where the device blends them, else bytes).
  target(kind, width, height, precise) {
    const { gl } = this;
    let target = this.targets.get(kind);
    const format = kind === 'bytes' || !this.hasFloats ? gl.RGBA8 : precise && this.canBlendFloats ? gl.RGBA32F : gl.RGBA16F;
    if (target && target.width === width && target.height === height && target.format === format) return target;
    if (target) {
      gl.deleteTexture(target.texture);
      gl.deleteFramebuffer(target.framebuffer);
    }
    target = { width, height, format, texture: gl.createTexture(), framebuffer: gl.createFramebuffer() };
    gl.bindTexture(gl.TEXTURE_2D, target.texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    this.setNearest(gl.TEXTURE_2D);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.texture, 0);
    this.targets.set(kind, target);
    return target;
  }

  // Sums of a view. view: rotation [9], translation [3], fx fy cx cy, width, height, near; times in model
  // time; look: what is shown (main.js).
  sum(view, time, look, precise = false) {
    const { gl, model } = this;
    const target = this.target('sums', view.width, view.height, precise || look.mode === 'flow' || look.mode === 'depth');
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.viewport(0, 0, view.width, view.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (!model || !this.count) return target;
    const { pose, draw, texels } = this.programOf(look.mode), { program, places } = pose, step = model.duration / Math.max(model.steps - 1, 1);
    const later = look.nextTime ?? time + step;
    gl.useProgram(program);
    const bind = (unit, kind, texture, name) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(kind, texture);
      gl.uniform1i(places[name], unit);
    };
    if (model.keyCount) {
      const sets = [keyWeights(model, time), keyWeights(model, later)];
      gl.activeTexture(gl.TEXTURE2);
      for (const set of sets) this.sendKeys(set);
      gl.uniform2i(places.keyFirst, sets[0].first, sets[1].first);
      gl.uniform2i(places.keyCount, sets[0].weights.length, sets[1].weights.length);
      gl.uniform4fv(places.keyWeight, sets.flatMap(({ weights }) => [0, 1, 2, 3].map((k) => weights[k] ?? 0)));
      bind(2, gl.TEXTURE_2D_ARRAY, this.keys, 'keyTexture');
    }
    bind(0, gl.TEXTURE_2D, this.rows, 'rowTexture');
    bind(1, gl.TEXTURE_2D, this.sh, 'shTexture');
    const r = view.rotation, t = view.translation;
    gl.uniform1i(places.moving, model.moving);
    gl.uniform1i(places.show, ['all', 'moving', 'static'].indexOf(look.show ?? 'all'));
    gl.uniform1f(places.sigmas, windowSigmas(model.cutoff));
    gl.uniform2f(places.times, time, later);
    gl.uniform3fv(places.rotation, r);
    gl.uniform3fv(places.translation, t);
    gl.uniform3f(places.eye, ...[0, 1, 2].map((k) => -(r[k] * t[0] + r[3 + k] * t[1] + r[6 + k] * t[2])));
    gl.uniform4f(places.intrinsics, view.fx, view.fy, view.cx, view.cy);
    gl.uniform2f(places.size, view.width, view.height);
    gl.uniform1f(places.near, view.near);
    gl.uniform1f(places.dilation, 0.3 * Math.max(1, view.filter ?? 1) ** 2);
    gl.uniform1f(places.pointRadius, look.pointRadius ?? 2);
    gl.uniform1f(places.movesFrom, 3e-3 * model.size);
    gl.uniform1f(places.minOpacity, look.minOpacity ?? 0);
    gl.uniform1f(places.maxSize, look.maxSize ? look.maxSize * model.size : 1e30);
    gl.bindVertexArray(this.vertices);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, this.feedback);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, this.posed);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, this.count);
    gl.endTransformFeedback();
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.disable(gl.RASTERIZER_DISCARD);

    gl.activeTexture(gl.TEXTURE3);
    gl.bindTexture(gl.TEXTURE_2D, this.posedTexture);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, this.posed);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, textureWidth, Math.ceil(this.count * texels / textureWidth), gl.RGBA, gl.FLOAT, 0);
    gl.bindBuffer(gl.PIXEL_UNPACK_BUFFER, null);

    gl.useProgram(draw.program);
    gl.uniform1i(draw.places.posedTexture, 3);
    gl.uniform2f(draw.places.size, view.width, view.height);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.rectangles);
    gl.drawElements(gl.TRIANGLES, 6 * this.count, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
    gl.disable(gl.BLEND);
    return target;
  }

  // From sums to colours in the bound framebuffer, the lower left corner of the picture at (x, y).
  resolve(sums, look, x, y) {
    const { gl } = this, { program, places } = this.screen;
    gl.viewport(x, y, sums.width, sums.height);
    gl.useProgram(program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, sums.texture);
    gl.uniform1i(places.sums, 0);
    gl.uniform1i(places.mode, modeNumbers[look.mode]);
    gl.uniform3fv(places.background, look.background);
    gl.uniform3fv(places.wheel, this.wheel ??= wheelColors());
    gl.uniform2f(places.corner, x, y);
    gl.uniform2fv(places.depthRange, look.depthRange ?? [0, 1]);
    gl.uniform1f(places.longestFlow, look.longestFlow ?? 1);
    gl.bindVertexArray(this.nothing);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindVertexArray(null);
  }

  // Draws to the canvas, at (left, top) of it; what is around gets the colour `margin`.
  draw(view, time, look, left, top, margin) {
    const { gl, canvas } = this, sums = this.sum(view, time, look);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...margin, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.resolve(sums, look, left, canvas.height - top - view.height);
  }

  // The sums drawn last at the middle of each square of `size` pixels: { columns, rows, values: floats, top row
  // first, four each }; null without float targets.
  sampledSums(size) {
    const { gl } = this, sums = this.targets.get('sums'), columns = Math.floor(sums.width / size), rows = Math.floor(sums.height / size);
    if (!this.hasFloats || !columns || !rows) return null;
    const small = this.target('samples', columns, rows, sums.format === gl.RGBA32F), values = new Float32Array(4 * columns * rows);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, sums.framebuffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, small.framebuffer);
    gl.blitFramebuffer(0, sums.height, columns * size, sums.height - rows * size, 0, 0, columns, rows, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, small.framebuffer);
    gl.readPixels(0, 0, columns, rows, gl.RGBA, gl.FLOAT, values);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    return { columns, rows, values };
  }

  // The picture as RGBA bytes, top row first.
  capture(view, time, look, precise = true) {
    const { gl } = this, { width, height } = view, sums = this.sum(view, time, look, precise);
    const target = this.target('bytes', width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    this.resolve(sums, look, 0, 0);
    const rows = new Uint8Array(width * height * 4), pixels = new Uint8ClampedArray(rows.length);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rows);
    for (let y = 0; y < height; ++y) pixels.set(rows.subarray(4 * width * y, 4 * width * (y + 1)), 4 * width * (height - 1 - y));
    return pixels;
  }

  // Flow [px] and opacity per pixel as floats, top row first, [height, width, 4]; null without float targets.
  captureSums(view, time, look) {
    if (!this.hasFloats) return null;
    const { gl } = this, { width, height } = view;
    const sums = this.sum(view, time, look, true);
    gl.bindFramebuffer(gl.FRAMEBUFFER, sums.framebuffer);
    const rows = new Float32Array(width * height * 4), values = new Float32Array(rows.length);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, rows);
    for (let y = 0; y < height; ++y) values.set(rows.subarray(4 * width * y, 4 * width * (y + 1)), 4 * width * (height - 1 - y));
    return values;
  }
}
