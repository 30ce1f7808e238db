// SPDX-License-Identifier: Apache-2.0
// Dropped files: which kind one is, by its first bytes, and the smaller formats (layout: optim/formats).
import { checkedModel, FileError, floatOfHalf, inflate, parseContainer } from './container.js';
import { readFourDgs } from './four_dgs.js';
import { logitOf, readPly, sh0OfColor } from './ply_file.js';

// { name, model, note } of one file, or of a PLY with its .npz.
export async function readSplatFiles(files) {
  const isTable = (file) => file.name.endsWith('.npz');
  const file = files.find((one) => !isTable(one)), table = files.find(isTable);
  if (!file) throw new FileError('This .npz file has only motion: drop it together with its PLY.');
  let bytes = await file.arrayBuffer().then((buffer) => new Uint8Array(buffer), () => { throw new FileError(`${file.name} cannot be read; is it a folder?`); });
  if (!bytes.length) throw new FileError(`${file.name} is empty.`);
  if (/\.html?$/i.test(file.name)) throw new FileError(`${file.name} is a page of its own: open it in the browser instead of dropping it here.`);
  const begins = (text) => bytes.length >= text.length && [...text].every((c, i) => bytes[i] === c.charCodeAt(0));
  if (bytes[0] === 0x1f && bytes[1] === 0x8b) bytes = await inflate(bytes, 'gzip');
  const read = async () => {
    if (begins('GFLOWVM1')) return { model: parseContainer(bytes.buffer) };
    if (begins('ply')) return readPly(bytes, table && new Uint8Array(await table.arrayBuffer()));
    if (begins('NGSP')) return { model: readSpz(bytes) };
    if (begins('\x894DGS')) return { model: await readFourDgs(bytes) };
    if (begins('Kg\0\0')) return { model: readSplatv(bytes) };
    if (/\.splat$/i.test(file.name)) return { model: readDotSplat(bytes) };
    const ending = /\.(ply|spz|splatv|4dgs)$/i.exec(file.name)?.[0];
    throw new FileError(ending ? `${file.name} is damaged, or has the wrong name: it does not begin as a ${ending} file.`
      : `${file.name} is no splat file that this page reads: PLY, .splat, .spz, .splatv or .4dgs.`);
  };
  const { model, note } = await read();
  return { name: file.name, model, note };
}

function emptyArrays(n) {
  return { means: new Float32Array(3 * n), quats: new Float32Array(4 * n), log_scales: new Float32Array(3 * n), logit_opacities: new Float32Array(n), sh0: new Float32Array(3 * n) };
}

function readDotSplat(bytes) {
  if (!bytes.length || bytes.length % 32) throw new FileError('The .splat file is truncated: it has 32 bytes per Gaussian.');
  const n = bytes.length / 32, view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), a = emptyArrays(n);
  for (let i = 0; i < n; ++i) {
    for (let k = 0; k < 3; ++k) {
      const scale = view.getFloat32(32 * i + 12 + 4 * k, true);
      if (scale < 0) throw new FileError('This is no .splat file: a scale in it is negative.');
      a.means[3 * i + k] = view.getFloat32(32 * i + 4 * k, true);
      a.log_scales[3 * i + k] = Math.log(Math.max(scale, 1e-30));
      a.sh0[3 * i + k] = sh0OfColor(bytes[32 * i + 24 + k] / 255);
    }
    a.logit_opacities[i] = logitOf(bytes[32 * i + 27] / 255);
    for (let k = 0; k < 4; ++k) a.quats[4 * i + k] = (bytes[32 * i + 28 + k] - 128) / 128;
  }
  return checkedModel({ motion: 'static', model: '.splat', count: n, steps: 1 }, a);
}

// Signs of the coefficients under a half turn around x, since the axes of .spz point elsewhere.
const turnedSigns = [-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1];

function readSpz(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  if (bytes.length < 16) throw new FileError('The .spz file is truncated: it has no header.');
  const version = view.getUint32(4, true), n = view.getUint32(8, true), degree = bytes[12], fraction = bytes[13];
  if (version === 4) throw new FileError('This .spz file is of version 4, which browsers cannot decompress; gflow import turns it into a PLY.');
  if (version < 2 || version > 4) throw new FileError(`This .spz file is of version ${version}; the page reads 2 and 3.`);
  if (degree > 3) throw new FileError(`The colours of this .spz file have degree ${degree}; the page reads 0 to 3.`);
  const bands = (degree + 1) ** 2 - 1, quatBytes = version === 2 ? 3 : 4, each = 9 + 1 + 3 + 3 + quatBytes + 3 * bands;
  if (bytes.length - 16 < n * each) throw new FileError(`The .spz file is truncated: ${n} Gaussians do not fit into it.`);
  const opacities = 16 + 9 * n, colors = opacities + n, scales = colors + 3 * n, quats = scales + 3 * n, harmonics = quats + quatBytes * n;
  const a = emptyArrays(n), unit = 2 ** -fraction;
  if (bands) a.sh_rest = new Float32Array(3 * bands * n);
  for (let i = 0; i < n; ++i) {
    for (let k = 0; k < 3; ++k) {
      const at = 16 + 9 * i + 3 * k, fixed = (((bytes[at + 2] << 24) >> 8) | (bytes[at + 1] << 8) | bytes[at]) * unit;
      a.means[3 * i + k] = k ? -fixed : fixed;
      a.log_scales[3 * i + k] = bytes[scales + 3 * i + k] / 16 - 10;
      a.sh0[3 * i + k] = (bytes[colors + 3 * i + k] / 255 - 0.5) / 0.15;
      for (let c = 0; c < bands; ++c)
        a.sh_rest[3 * (bands * i + c) + k] = turnedSigns[c] * (bytes[harmonics + 3 * (bands * i + c) + k] / 128 - 1);
    }
    a.logit_opacities[i] = logitOf(bytes[opacities + i] / 255);
    const q = [0, 0, 0, 0];  // x y z w
    let largest = 3, left = 1;
    if (version === 2) for (let k = 0; k < 3; ++k) left -= (q[k] = bytes[quats + 3 * i + k] / 127.5 - 1) ** 2;
    else {
      let word = view.getUint32(quats + 4 * i, true);
      largest = word >>> 30;
      for (let k = 3; k >= 0; --k) {
        if (k === largest) continue;
        q[k] = Math.SQRT1_2 * ((word & 511) / 511) * (word & 512 ? -1 : 1);
        left -= q[k] ** 2;
        word >>>= 10;
      }
    }
    q[largest] = Math.sqrt(Math.max(left, 0));
    a.quats.set([q[3], q[0], -q[1], -q[2]], 4 * i);
  }
  return checkedModel({ motion: 'static', model: `.spz ${version}`, count: n, sh_degree: degree, steps: 1 }, a);
}

// splaTV: 16 words per Gaussian on a cubic path; opacity exp(-(tau / life)^2).
function readSplatv(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length), length = bytes.length > 8 ? view.getUint32(4, true) : NaN;
  let chunks;
  try {
    chunks = JSON.parse(new TextDecoder().decode(bytes.subarray(8, 8 + length)));
  } catch {
    throw new FileError('The .splatv file is truncated or damaged: its list of chunks cannot be read.');
  }
  let at = 8 + length;
  for (const chunk of Array.isArray(chunks) ? chunks : []) {
    if (chunk.type === 'splat') break;
    at += chunk.size;
  }
  const size = chunks.find?.((chunk) => chunk.type === 'splat')?.size;
  if (!(size >= 0 && at + size <= bytes.length)) throw new FileError('The .splatv file is truncated: its Gaussians do not fit into it.');
  let n = Math.floor(size / 64);
  const word = (i, k) => at + 64 * i + 4 * k, half = (i, k, high) => floatOfHalf(view.getUint16(word(i, k) + (high ? 2 : 0), true));
  while (n && !bytes[word(n - 1, 7) + 3]) --n;  // padding has opacity 0
  const a = { ...emptyArrays(n), means_t: new Float32Array(n), velocities: new Float32Array(3 * n), half_accelerations: new Float32Array(3 * n),
    cubics: new Float32Array(3 * n), turns: new Float32Array(4 * n), log_scales: new Float32Array(4 * n) };
  for (let i = 0; i < n; ++i) {
    const path = [];
    for (let k = 8; k < 13; ++k) path.push(half(i, k, false), half(i, k, true));
    for (let k = 0; k < 3; ++k) {
      a.means[3 * i + k] = view.getFloat32(word(i, k), true);
      a.sh0[3 * i + k] = sh0OfColor(bytes[word(i, 7) + k] / 255);
      a.velocities[3 * i + k] = path[k];
      a.half_accelerations[3 * i + k] = path[3 + k];
      a.cubics[3 * i + k] = path[6 + k];
    }
    a.quats.set([half(i, 3, 0), half(i, 3, 1), half(i, 4, 0), half(i, 4, 1)], 4 * i);
    a.turns.set([half(i, 13, 0), half(i, 13, 1), half(i, 14, 0), half(i, 14, 1)], 4 * i);
    a.log_scales.set([half(i, 5, 0), half(i, 5, 1), half(i, 6, 0), half(i, 15, 1) / Math.SQRT2].map((x) => Math.log(Math.max(x, 1e-20))), 4 * i);
    a.means_t[i] = half(i, 15, 0);
    a.logit_opacities[i] = logitOf(bytes[word(i, 7) + 3] / 255);
  }
  return checkedModel({ motion: 'spacetime', model: '.splatv', count: n, duration: 1, cutoff: 0.0039, steps: 50, fps: 25 }, a);
}
