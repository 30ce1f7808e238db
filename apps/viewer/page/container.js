// SPDX-License-Identifier: Apache-2.0
// Reads the container of a model: "GFLOWVM1", u32 length of a JSON header, the header, the arrays
// (little-endian). The page trusts nothing in it: sizes and ranges are checked here, once.

export class FileError extends Error {}

const containerMagic = 'GFLOWVM1';
const arrayTypes = {
  float32: [Float32Array, 4], float16: [Uint16Array, 2], uint16: [Uint16Array, 2], uint8: [Uint8Array, 1],
};
// What each motion model needs, with values per Gaussian; K are the colour bands above the first.
const neededArrays = {
  static: { means: 3, quats: 4, log_scales: 3, logit_opacities: 1, sh0: 3 },
  spacetime: { means: 3, means_t: 1, quats: 4, log_scales: 4, logit_opacities: 1, sh0: 3 },
  native4d: { means: 3, means_t: 1, quats: 4, log_scales: 4, logit_opacities: 1, sh0: 3 },
  keyframes: { means: 3, means_t: 1, quats: 4, log_scales: 4, logit_opacities: 1, sh0: 3 },
  poses: { quats: 4, logit_opacities: 1, sh0: 3 },
};
// Rows of Gaussians that move; static ones, from `moving` on, have none.
const movingArrays = {
  static: {},
  spacetime: { velocities: 3, half_accelerations: 3, turns: 4 },
  native4d: { quats_r: 4 },
  keyframes: { key_shifts: 3, key_turns: 4 },
  poses: { pose_means: 3, pose_quats: 4 },
};
const optionalArrays = { key_scales: 3, pose_log_scales: 3, pose_opacities: 1 };

let halfTable = null;
export function floatOfHalf(half) {
  if (!halfTable) {
    halfTable = new Float32Array(65536);
    for (let i = 0; i < 65536; ++i) {
      const exponent = (i >> 10) & 31, fraction = i & 1023, sign = i & 0x8000 ? -1 : 1;
      halfTable[i] = sign * (exponent === 31 ? (fraction ? NaN : Infinity)
        : exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -24 * fraction);
    }
  }
  return halfTable[half];
}

function readArray(name, entry, buffer, base) {
  const [Type, size] = arrayTypes[entry.type] || [];
  if (!Type) throw new FileError(`The model's array ${name} has the unknown type ${entry.type}.`);
  const length = Array.isArray(entry.shape) ? entry.shape.reduce((a, b) => a * b, 1) : NaN;
  const at = base + entry.offset;
  if (!(length >= 0 && Number.isInteger(length) && at >= base && at + length * size <= buffer.byteLength))
    throw new FileError(`The model is truncated or damaged: its array ${name} does not fit into the file.`);
  const raw = entry.planes ? fromPlanes(new Uint8Array(buffer, at, length * size), size, Type)
    : at % size || entry.differences ? new Type(buffer.slice(at, at + length * size)) : new Type(buffer, at, length);
  if (entry.differences) {  // along the first axis, modulo 2^16, their sign in the lowest bit
    const row = length / (entry.shape[0] || 1);
    for (let k = row; k < length; ++k) raw[k] = (raw[k] >> 1 ^ -(raw[k] & 1)) + raw[k - row];
  }
  if (Type === Float32Array) return raw;
  // scale and shift are numbers, or lists with one for each column.
  const width = entry.shape.at(-1) || 1, columns = (x) => Array.from({ length: width }, (_, k) => (Array.isArray(x) ? x[k] : x));
  const scale = columns(entry.scale ?? 1), shift = columns(entry.shift ?? 0), values = new Float32Array(length);
  for (let i = 0, k = 0; i < length; ++i, k = k + 1 === width ? 0 : k + 1)
    values[i] = (entry.type === 'float16' ? floatOfHalf(raw[i]) : raw[i]) * scale[k] + shift[k];
  return values;
}

// Byte 0 of all values, then byte 1 of all, ...
function fromPlanes(bytes, size, Type) {
  const values = new Uint8Array(bytes.length), n = bytes.length / size;
  for (let b = 0; b < size; ++b) for (let i = 0; i < n; ++i) values[i * size + b] = bytes[b * n + i];
  return new Type(values.buffer);
}

// A model from a container in an ArrayBuffer.
export function parseContainer(buffer) {
  const bytes = new Uint8Array(buffer);
  if (bytes.length < 12 || String.fromCharCode(...bytes.subarray(0, 8)) !== containerMagic)
    throw new FileError('This is not a model that gflow view has written.');
  const length = new DataView(buffer).getUint32(8, true);
  let header;
  try {
    header = JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytes.subarray(12, 12 + length)));
  } catch {
    throw new FileError('The model is truncated or damaged: its header cannot be read.');
  }
  const arrays = {};
  for (const [name, entry] of Object.entries(header.arrays || {}))
    arrays[name] = readArray(name, entry, buffer, 12 + length);
  return checkedModel(header, arrays);
}

// Checks a model, wherever it comes from, and fills in what is optional.
export function checkedModel(header, arrays) {
  const model = {
    moving: header.count, sh_degree: 0, duration: 1, cutoff: 0.05, steps: 1, fps: null, near: 0.01,
    background: [1, 1, 1], transport: 'material', ...header, arrays,
  };
  const { motion, count: n, moving } = model;
  if (!Object.hasOwn(neededArrays, motion))
    throw new FileError(`The model moves as "${motion}", which this page does not know.`);
  const whole = (x, most) => Number.isInteger(x) && x >= 0 && x <= most;
  if (!whole(n, 1 << 26) || !whole(moving, n) || !whole(model.sh_degree, 3) || !whole(model.steps, 1e6)
    || !(model.duration > 0) || !(model.cutoff >= 0 && model.cutoff < 1))
    throw new FileError('The model is damaged: a number in its header is out of range.');
  if (!(model.near > 0)) model.near = 0.01;
  const need = (name, length) => {
    if (arrays[name]?.length !== length)
      throw new FileError(`The model is damaged: its array ${name} should have ${length} values.`);
  };
  for (const [name, width] of Object.entries(neededArrays[motion])) need(name, width * n);
  const keys = motion === 'keyframes' ? model.keys : motion === 'poses' ? model.times?.length ?? Math.max(1, model.steps) : 1;
  if (!whole(keys, 1e6)) throw new FileError('The model is damaged: its number of keys is out of range.');
  model.keyCount = motion === 'keyframes' || motion === 'poses' ? keys : 0;
  for (const [name, width] of Object.entries(movingArrays[motion])) need(name, width * moving * keys);
  for (const [name, width] of Object.entries(optionalArrays))
    if (arrays[name]) need(name, width * moving * keys);
  const rest = 3 * ((model.sh_degree + 1) ** 2 - 1);
  if (rest) need('sh_rest', rest * n);
  if (motion === 'poses') completePoses(model, need);
  need('means', 3 * n);
  return Object.assign(model, boxOf(arrays.means));  // centre and size
}

// Poses may lack lifetimes and means that all time steps replace.
function completePoses(model, need) {
  const { arrays, count: n } = model, { times } = model;
  if (!arrays.means) {
    if (model.moving < n) throw new FileError('The model is damaged: its static Gaussians have no means.');
    arrays.means = arrays.pose_means.subarray(0, 3 * n);
  }
  if (arrays.means_t) need('log_scales', 4 * n);
  else {
    need('log_scales', 3 * n);
    const scales = new Float32Array(4 * n).fill(40);  // a lifetime without end
    for (let i = 0; i < n; ++i) for (let k = 0; k < 3; ++k) scales[4 * i + k] = arrays.log_scales[3 * i + k];
    arrays.log_scales = scales;
    arrays.means_t = new Float32Array(n);
  }
  if (times && !(Array.isArray(times) && times.length === model.keyCount && times.every((t, k) => !k || t > times[k - 1])))
    throw new FileError('The model is damaged: the times of its poses do not ascend.');
}

// Centre and half size of the box of the middle nine tenths of the means along each axis.
function boxOf(means) {
  const n = means.length / 3, every = Math.max(1, Math.floor(n / 20000));
  const centre = [0, 0, 0];
  let size = 0;
  for (let k = 0; k < 3 && n; ++k) {
    const values = [];
    for (let i = 0; i < n; i += every) if (Number.isFinite(means[3 * i + k])) values.push(means[3 * i + k]);
    values.sort((a, b) => a - b);
    const low = values[Math.floor(values.length * 0.05)] ?? 0, high = values[Math.floor(values.length * 0.95)] ?? 0;
    centre[k] = (low + high) / 2;
    size = Math.max(size, (high - low) / 2);
  }
  return { centre, size: size || 1 };
}

// The model and info of an exported page, whose HTML contains them; null if there are none.
export async function embeddedModel() {
  if (!document.getElementById('gflow-model')) return null;
  const [info, model] = await Promise.all(['gflow-info', 'gflow-model'].map(embedded));
  return { model: parseContainer(model.buffer), info: JSON.parse(new TextDecoder().decode(info)) };
}
async function embedded(id) {
  const element = document.getElementById(id);
  let bytes;
  try {
    bytes = Uint8Array.from(atob(element.textContent), (c) => c.charCodeAt(0));
  } catch {
    throw new FileError('This file is damaged: it contains letters that do not belong there. Copy or export it again.');
  }
  element.remove();
  return inflate(bytes, 'gzip');
}

// Decompresses with the browser's own decoder.
export async function inflate(bytes, format) {
  if (typeof DecompressionStream === 'undefined')
    throw new FileError('This browser cannot decompress files (DecompressionStream is missing). A newer version can.');
  try {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream(format));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  } catch {
    throw new FileError('This file is truncated or damaged: it cannot be decompressed.');
  }
}
