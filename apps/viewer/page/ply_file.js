// SPDX-License-Identifier: Apache-2.0
// PLY files: 3DGS, gflow's own with motion, SpacetimeGaussians' and SuperSplat's compressed ones
// (layout: optim/formats). Columns are read by name; nothing that is not asked for is copied.
import { checkedModel, FileError, inflate } from './container.js';

const plySizes = { char: 1, int8: 1, uchar: 1, uint8: 1, short: 2, int16: 2, ushort: 2, uint16: 2, int: 4, int32: 4, uint: 4, uint32: 4, float: 4, float32: 4, double: 8, float64: 8 };
const plyReaders = { char: 'getInt8', int8: 'getInt8', uchar: 'getUint8', uint8: 'getUint8', short: 'getInt16', int16: 'getInt16',
  ushort: 'getUint16', uint16: 'getUint16', int: 'getInt32', int32: 'getInt32', uint: 'getUint32', uint32: 'getUint32',
  float: 'getFloat32', float32: 'getFloat32', double: 'getFloat64', float64: 'getFloat64' };

class PlyFile {
  constructor(bytes) {
    const text = new TextDecoder('latin1').decode(bytes.subarray(0, 1 << 20)), end = /\nend_header\r?\n/.exec(text);
    if (!end) throw new FileError('The PLY file is truncated: its header does not end.');
    this.comments = [];
    this.elements = {};
    let element = null, format = '';
    const order = [];
    for (const line of text.slice(0, end.index).split(/\r?\n/)) {
      const words = line.trim().split(/\s+/);
      if (words[0] === 'format') format = words[1];
      if (words[0] === 'comment') this.comments.push(words.slice(1));
      if (words[0] === 'element') {
        element = this.elements[words[1]] = { name: words[1], rows: +words[2], stride: 0, columns: new Map() };
        order.push(element);
        if (!Number.isInteger(element.rows) || element.rows < 0) throw new FileError('The PLY file is damaged: an element has no valid number of rows.');
      }
      if (words[0] === 'property' && element) {
        if (words[1] === 'list') { element.isList = true; continue; }
        if (!plySizes[words[1]]) throw new FileError(`The PLY file has the unknown type ${words[1]}.`);
        element.columns.set(words[2], { type: words[1], at: element.stride, index: element.columns.size });
        element.stride += plySizes[words[1]];
      }
    }
    this.ascii = format === 'ascii';
    this.little = format !== 'binary_big_endian';
    let at = end.index + end[0].length;
    const numbers = this.ascii ? new TextDecoder('latin1').decode(bytes.subarray(at)).split(/\s+/).map(Number) : null;
    let word = 0;
    for (const one of order) {
      if (one.isList) { one.rows = 0; break; }  // faces follow the Gaussians, if there are any
      if (this.ascii) {
        one.numbers = numbers.slice(word, word += one.rows * one.columns.size);
      } else {
        if (at + one.rows * one.stride > bytes.length) throw new FileError(`The PLY file is truncated: ${one.rows} rows of ${one.name} do not fit into it.`);
        one.view = new DataView(bytes.buffer, bytes.byteOffset + at, one.rows * one.stride);
        at += one.rows * one.stride;
      }
    }
  }
  has(name, element = 'vertex') { return !!this.elements[element]?.columns.has(name); }
  comment(name) { return this.comments.find((words) => words[0] === name)?.[1]; }
  // Columns as rows of an array [rows, names.length]; put(value) may change values.
  columns(names, element = 'vertex', Type = Float32Array, put = (x) => x) {
    const one = this.elements[element], width = names.length, out = new Type(one.rows * width);
    names.forEach((name, k) => {
      const column = one.columns.get(name);
      if (!column) throw new FileError(`The PLY file has no property ${name}; is it a file of Gaussians?`);
      if (this.ascii) {
        for (let i = 0; i < one.rows; ++i) out[i * width + k] = put(one.numbers[i * one.columns.size + column.index]);
        return;
      }
      const { view } = one, read = plyReaders[column.type];
      for (let i = 0, at = column.at; i < one.rows; ++i, at += one.stride) out[i * width + k] = put(view[read](at, this.little));
    });
    return out;
  }
  numbered(prefix) {
    const names = [];
    while (this.has(prefix + names.length)) names.push(prefix + names.length);
    return names;
  }
}

const named = (prefix, from, to) => Array.from({ length: to - from }, (_, k) => `${prefix}${from + k}`);
export const sh0OfColor = (color) => (color - 0.5) / 0.28209479177387814;
export const logitOf = (opacity) => (opacity <= 0 ? -Infinity : opacity >= 1 ? Infinity : Math.log(opacity / (1 - opacity)));

export const isDirection = (v) => v?.length === 3 && v.every(Number.isFinite) && Math.hypot(...v) > 1e-6;

// From channel by channel, as in files, to coefficient by coefficient.
export function interleaved(values, n) {
  const width = values.length / Math.max(n, 1), bands = width / 3, out = new Float32Array(values.length);
  for (let i = 0; i < n; ++i)
    for (let c = 0; c < 3; ++c) for (let k = 0; k < bands; ++k) out[i * width + 3 * k + c] = values[i * width + c * bands + k];
  return out;
}
export function degreeOf(bands) {
  const degree = Math.sqrt(bands + 1) - 1;
  if (!Number.isInteger(degree) || degree > 3) throw new FileError(`The file has ${bands} coefficients of colour, which fits no degree up to 3.`);
  return degree;
}

// { model, note } of a PLY file; `tables`: bytes of point_cloud.motion.npz, if it was dropped, too.
export async function readPly(bytes, tables) {
  const ply = new PlyFile(bytes);
  if (!ply.elements.vertex) throw new FileError('The PLY file has no vertices.');
  if (ply.has('packed_position')) return { model: readCompressedPly(ply) };
  const n = ply.elements.vertex.rows, rest = ply.numbered('f_rest_'), lite = ply.has('trbf_center') && ply.has('trbf_scale');
  const scales = ply.numbered('scale_'), arrays = { means: ply.columns(['x', 'y', 'z']), quats: ply.columns(named('rot_', 0, 4)) };
  let note = '';
  arrays.logit_opacities = ply.columns(['opacity']);
  arrays.sh0 = ply.has('f_dc_0') ? ply.columns(named('f_dc_', 0, 3), 'vertex', Float32Array, lite ? sh0OfColor : undefined)
    : ply.columns(['red', 'green', 'blue'], 'vertex', Float32Array, (x) => sh0OfColor(x / 255));
  const sh_degree = degreeOf(rest.length / 3);
  if (sh_degree) arrays.sh_rest = interleaved(ply.columns(rest), n);
  const header = { motion: 'static', model: ply.comment('gflow') ?? '3DGS', count: n, moving: n, sh_degree, steps: 1 };
  const up = ply.comments.find((words) => words[0] === 'up')?.slice(1).map(Number);
  if (isDirection(up)) header.up = up;
  const number = (name, otherwise) => (Number.isFinite(+ply.comment(name)) ? +ply.comment(name) : otherwise);
  const timed = () => {
    Object.assign(header, { duration: number('duration', 1), cutoff: number('cutoff', 0.05), steps: 30, fps: 24 });
    arrays.means_t = ply.columns(['t']);
    arrays.log_scales = ply.columns([...named('scale_', 0, 3), 'scale_t']);
  };
  if (lite) {  // opacity exp(-(t - centre)^2 / scale^2), a cubic path
    Object.assign(header, { motion: 'spacetime', model: 'spacetime (lite)', duration: 1, cutoff: 0.0039, steps: 50, fps: 25 });
    arrays.means_t = ply.columns(['trbf_center']);
    arrays.log_scales = ply.columns([...named('scale_', 0, 3), 'trbf_scale']);
    for (let i = 0; i < n; ++i) arrays.log_scales[4 * i + 3] -= Math.log(2) / 2;
    if (ply.has('motion_8')) arrays.cubics = ply.columns(named('motion_', 6, 9));
  } else if (ply.has('t') && ply.has('scale_t')) timed();
  else if (scales.length === 2) {  // flat Gaussians
    arrays.log_scales = new Float32Array(3 * n).fill(-30);
    ply.columns(scales).forEach((x, i) => { arrays.log_scales[3 * (i >> 1) + (i & 1)] = x; });
  } else arrays.log_scales = ply.columns(named('scale_', 0, 3));
  if (ply.has('motion_5') && ply.has('omega_3')) {
    header.motion = 'spacetime';
    arrays.velocities = ply.columns(named('motion_', 0, 3));
    arrays.half_accelerations = ply.columns(named('motion_', 3, 6));
    arrays.turns = ply.columns(named('omega_', 0, 4));
  } else if (ply.has('rot_r_3')) {
    header.motion = 'native4d';
    arrays.quats_r = ply.columns(named('rot_r_', 0, 4));
  } else if (arrays.means_t) note = await keyframesOf(ply, header, arrays, tables);
  return { model: checkedModel(header, arrays), note };
}

// Adds the motion of a keyframes model, or rests in the pose that all other models shift; returns a note.
async function keyframesOf(ply, header, arrays, tables) {
  const keys = +ply.comment('keys');
  if (ply.comment('gflow') === 'keyframes' && tables && keys >= 1) {
    const read = await readNpz(tables);
    for (const name of ['key_shifts', 'key_turns', 'key_scales']) if (read[name]?.length) arrays[name] = read[name];
    Object.assign(header, { motion: 'keyframes', keys, moving: (arrays.key_shifts?.length ?? 0) / 3 / keys });
    return '';
  }
  const scales = arrays.log_scales;
  arrays.log_scales = new Float32Array(3 * header.count);
  for (let i = 0; i < header.count; ++i) for (let k = 0; k < 3; ++k) arrays.log_scales[3 * i + k] = scales[4 * i + k];
  delete arrays.means_t;
  header.steps = 1;
  return ply.comment('gflow') === 'keyframes' ? 'Shown at rest: drop point_cloud.motion.npz together with the PLY to see it move.'
    : `Shown at rest: the motion of a ${ply.comment('gflow')} model is baked by gflow view or gflow export.`;
}

// Arrays of float32 in a .npz file.
async function readNpz(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), arrays = {};
  let at = bytes.length - 22;
  while (at >= 0 && view.getUint32(at, true) !== 0x06054b50) --at;
  if (at < 0) throw new FileError('The .npz file is truncated or damaged.');
  const count = view.getUint16(at + 10, true);
  at = view.getUint32(at + 16, true);
  for (let i = 0; i < count; ++i) {
    if (at + 46 > bytes.length) throw new FileError('The .npz file is damaged.');
    const method = view.getUint16(at + 10, true), size = view.getUint32(at + 20, true), from = view.getUint32(at + 42, true);
    const [name, extra, comment] = [28, 30, 32].map((k) => view.getUint16(at + k, true));
    const title = new TextDecoder().decode(bytes.subarray(at + 46, at + 46 + name)).replace(/\.npy$/, '');
    const begin = from + 30 + view.getUint16(from + 26, true) + view.getUint16(from + 28, true), part = bytes.subarray(begin, begin + size);
    const npy = method === 8 ? await inflate(part, 'deflate-raw') : part, head = 10 + npy[8] + 256 * npy[9];
    const description = new TextDecoder().decode(npy.subarray(10, head));
    if (description.includes("'<f4'")) arrays[title] = new Float32Array(npy.slice(head, npy.length - ((npy.length - head) % 4)).buffer);
    at += 46 + name + extra + comment;
  }
  return arrays;
}

// SuperSplat's compressed PLY: 256 Gaussians share the ranges of their packed values.
function readCompressedPly(ply) {
  const n = ply.elements.vertex.rows, chunks = ply.elements.chunk?.rows ?? 0;
  if (chunks < Math.ceil(n / 256)) throw new FileError('The compressed PLY is damaged: it has too few chunks.');
  const words = (name) => ply.columns([name], 'vertex', Uint32Array);
  const range = (end, axes) => ply.columns(axes.map((axis) => `${end}_${axis}`), 'chunk');
  const positions = words('packed_position'), sizes = words('packed_scale'), turns = words('packed_rotation'), colors = words('packed_color');
  const xyz = ['x', 'y', 'z'], sxyz = ['scale_x', 'scale_y', 'scale_z'], rgb = ['r', 'g', 'b'], ranged = ply.has('min_r', 'chunk');
  const low = range('min', xyz), high = range('max', xyz), lowScale = range('min', sxyz), highScale = range('max', sxyz);
  const lowColor = ranged && range('min', rgb), highColor = ranged && range('max', rgb);
  const part = (word, shift, bits) => ((word >>> shift) & ((1 << bits) - 1)) / ((1 << bits) - 1);
  const mix = (a, b, x) => a * (1 - x) + b * x;
  const arrays = { means: new Float32Array(3 * n), quats: new Float32Array(4 * n), log_scales: new Float32Array(3 * n), logit_opacities: new Float32Array(n), sh0: new Float32Array(3 * n) };
  for (let i = 0; i < n; ++i) {
    const chunk = 3 * (i >> 8), place = [part(positions[i], 21, 11), part(positions[i], 11, 10), part(positions[i], 0, 11)];
    const size = [part(sizes[i], 21, 11), part(sizes[i], 11, 10), part(sizes[i], 0, 11)];
    for (let k = 0; k < 3; ++k) {
      const level = part(colors[i], 24 - 8 * k, 8);
      arrays.means[3 * i + k] = mix(low[chunk + k], high[chunk + k], place[k]);
      arrays.log_scales[3 * i + k] = mix(lowScale[chunk + k], highScale[chunk + k], size[k]);
      arrays.sh0[3 * i + k] = sh0OfColor(ranged ? mix(lowColor[chunk + k], highColor[chunk + k], level) : level);
    }
    arrays.logit_opacities[i] = logitOf(part(colors[i], 0, 8));
    const largest = turns[i] >>> 30;
    let left = 1;
    for (let k = 0, shift = 20; k < 4; ++k) {
      if (k === largest) continue;
      const q = (part(turns[i], shift, 10) - 0.5) * Math.SQRT2;
      arrays.quats[4 * i + k] = q;
      left -= q * q;
      shift -= 10;
    }
    arrays.quats[4 * i + largest] = Math.sqrt(Math.max(left, 0));
  }
  const rest = ply.elements.sh ? [...ply.elements.sh.columns.keys()] : [], sh_degree = degreeOf(rest.length / 3);
  if (sh_degree) {
    const bytes = ply.columns(rest, 'sh', Float32Array, (x) => 8 * ((x <= 0 ? 0 : x >= 255 ? 1 : (x + 0.5) / 256) - 0.5));
    arrays.sh_rest = interleaved(bytes, n);
  }
  return checkedModel({ motion: 'static', model: 'compressed PLY', count: n, sh_degree, steps: 1 }, arrays);
}
