// SPDX-License-Identifier: Apache-2.0
// .4dgs files (avala-ai/4dgs, version 1): pieces on straight lines, each with a time window. Layout and
// steps of the quantisation: optim/formats/four_dgs_read.cpp and four_dgs_grid.hpp.
import { checkedModel, FileError, inflate } from './container.js';
import { degreeOf, isDirection, logitOf, sh0OfColor } from './ply_file.js';

const channelsOf = [3, 3, 1, 3, 3, 1, 3, 1, 1, 1, 1];  // position scale largest rotation colour opacity motion t life flags window

class FourDgsReader {
  constructor(bytes) { this.bytes = bytes; this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length); this.at = 0; }
  need(length) {
    if (!(length >= 0 && this.at + length <= this.bytes.length)) throw new FileError('The .4dgs file is truncated or damaged.');
    const from = this.at;
    this.at += length;
    return from;
  }
  u8() { return this.view.getUint8(this.need(1)); }
  u32() { return this.view.getUint32(this.need(4), true); }
  u64() { return Number(this.view.getBigUint64(this.need(8), true)); }
  f64() { return this.view.getFloat64(this.need(8), true); }
  take(length) { const from = this.need(length); return this.bytes.subarray(from, from + length); }
  text() { return new TextDecoder().decode(this.take(this.u32())); }
  get left() { return this.bytes.length - this.at; }
}

async function readStream(reader, count) {
  const id = reader.u8(), width = reader.u8(), mode = reader.u8(), codec = reader.u8(), channels = reader.u8(), elements = reader.u32();
  const payload = reader.take(reader.u64());
  if (codec !== 0) throw new FileError('This .4dgs file is compressed with zstd, which browsers cannot read.');
  if (elements !== count || ![1, 2, 4].includes(width) || mode > 2) throw new FileError('The .4dgs file is damaged: a stream does not fit its chunk.');
  const symbols = (mode === 2 ? 1 : count) * channels, values = new Int32Array(symbols);
  const planes = count ? await inflate(payload, 'deflate') : payload;
  if (count && planes.length !== symbols * width) throw new FileError('The .4dgs file is damaged: a stream has the wrong length.');
  for (let i = 0; i < symbols && count; ++i) {
    let symbol = 0;
    for (let b = 0; b < width; ++b) symbol += planes[b * symbols + i] * 2 ** (8 * b);
    values[i] = (symbol % 2 ? -(symbol + 1) : symbol) / 2 + (mode === 1 && i >= channels ? values[i - channels] : 0);
  }
  return { id, channels, row: mode === 2 ? () => 0 : (i) => i * channels, values };
}

function readMap(reader) {
  const block = new FourDgsReader(reader.take(reader.u32())), map = {};
  while (block.left) { const key = block.text(); map[key] = block.text(); }
  return map;
}

export async function readFourDgs(bytes) {
  const file = new FourDgsReader(bytes);
  if (String.fromCharCode(...file.take(8)) !== '\x894DGS1\r\n') throw new FileError('This .4dgs file is of another version, or damaged.');
  let header = null, grid = null, windows = [], chunk = null;
  const chunks = [];
  for (;;) {
    const code = file.u8(), part = new FourDgsReader(file.take(file.u64()));
    if (code === 1) {
      part.text();
      part.text();
      header = { duration: part.f64(), count: part.u64(), cutoff: part.f64(), model: part.text() };
      for (let k = 0; k < 6; ++k) part.f64();
      header.degree = part.u8();
      part.u8();
      header.about = part.left ? readMap(part) : {};  // of gflow: fps and up
      if (header.model !== 'gaussian-birth') throw new FileError(`This .4dgs file moves as "${header.model}", which the page does not read.`);
      if (!(header.count <= 1 << 25) || header.degree > 3) throw new FileError('The .4dgs file is damaged: its header is out of range.');
    } else if (code === 3) {
      if (part.text() !== 'uniform-v1') throw new FileError('This .4dgs file has a quantisation that the page does not read.');
      const v = Array.from({ length: 11 }, () => part.f64());
      grid = { origin: v.slice(0, 3), position: v[3], scale: v[4], rotation: v[5], color: v[6], opacity: v[7], motion: v[8], time: v[9], life: v[10] };
    } else if (code === 4) {
      const count = part.u32();
      windows = Array.from({ length: Math.min(count, part.left / 16) }, () => [part.f64(), part.f64()]);
    } else if (code === 5) {
      const begin = part.f64(), end = part.f64();
      part.u32();
      const count = part.u32(), compression = part.text();
      part.u64();
      let streams = part.take(part.u64());
      if (compression === 'deflate') streams = await inflate(streams, 'deflate');
      else if (compression) throw new FileError(`This .4dgs file is compressed with ${compression}, which browsers cannot read.`);
      if (count > (header?.count ?? 0)) throw new FileError('The .4dgs file is damaged: a chunk has too many Gaussians.');
      chunk = { begin, end, count, streams: {}, bands: [] };
      for (const rest = new FourDgsReader(streams); rest.left > 0;) {
        const stream = await readStream(rest, count);
        if (channelsOf[stream.id] === stream.channels) chunk.streams[stream.id] = stream;
      }
      chunks.push(chunk);
    } else if (code === 7 && chunk) {
      part.u8();
      chunk.bands.push(await readStream(part, chunk.count));
    } else if (code === 2) break;
  }
  if (!header || !grid) throw new FileError('The .4dgs file is damaged: it has no header or quantisation.');
  return modelOfChunks(header, grid, windows, chunks);
}

function modelOfChunks(header, grid, windows, chunks) {
  const n = chunks.reduce((sum, { count }) => sum + count, 0), bands = (header.degree + 1) ** 2 - 1;
  if (n > header.count) throw new FileError('The .4dgs file is damaged: it has more Gaussians than its header says.');
  const make = (width) => new Float32Array(width * n);
  const a = { means: make(3), means_t: make(1), quats: make(4), velocities: make(3), half_accelerations: make(3), turns: make(4),
    log_scales: make(4), logit_opacities: make(1), sh0: make(3), windows: make(2) };
  if (bands) a.sh_rest = make(3 * bands);
  const sigmas = Math.sqrt(-2 * Math.log(header.cutoff)), clamp = (x, low, high) => Math.min(Math.max(x, low), high);
  let i = 0;
  for (const chunk of chunks) {
    for (let id = 0; id < channelsOf.length; ++id) if (!chunk.streams[id] && chunk.count) throw new FileError('The .4dgs file is damaged: a stream is missing.');
    const at = (id, j, k = 0) => { const s = chunk.streams[id]; return s.values[s.row(j) + k]; };
    for (let j = 0; j < chunk.count; ++j, ++i) {
      const window = windows[at(10, j)] ?? [-Infinity, Infinity], lasting = at(9, j) & 1, life = Math.exp(at(8, j) * grid.life);
      const begin = Math.max(window[0], chunk.begin), end = Math.min(window[1], chunk.end);
      const seen = lasting ? window[1] - window[0] : sigmas * life, level = Math.ceil(Math.log2(clamp(seen, 0.02, 2) / 0.5));
      const motionStep = grid.motion * 2 ** -clamp(level, -4, 2);
      const finest = lasting ? grid.time : Math.min(grid.time, 0.05 * life);
      const timeStep = grid.time * 2 ** clamp(Math.floor(Math.log2(finest / grid.time)), -10, 0);
      a.means_t[i] = at(7, j) * timeStep;
      for (let k = 0; k < 3; ++k) {
        a.means[3 * i + k] = grid.origin[k] + at(0, j, k) * grid.position;
        a.velocities[3 * i + k] = at(6, j, k) * motionStep;
        a.log_scales[4 * i + k] = at(1, j, k) * grid.scale;
        const bin = at(4, j) + (k === 1 ? 0 : at(4, j, k === 0 ? 1 : 2));
        a.sh0[3 * i + k] = sh0OfColor(clamp(bin * grid.color, 0, 1));
      }
      a.log_scales[4 * i + 3] = lasting ? 30 : Math.log(life);
      a.logit_opacities[i] = logitOf(clamp(at(5, j) * grid.opacity, 0, 1));
      const largest = at(2, j), q = [0, 0, 0, 0];
      let left = 1;
      for (let k = 0, from = 0; k < 4; ++k) if (k !== largest) left -= (q[k] = clamp(at(3, j, from++) * grid.rotation, -1, 1)) ** 2;
      if (largest >= 0 && largest < 4) q[largest] = Math.sqrt(Math.max(left, 0));
      a.quats.set([q[3], q[0], q[1], q[2]], 4 * i);
      a.windows.set([begin, end >= header.duration ? Infinity : end], 2 * i);
      for (let b = 0, first = 0; b < chunk.bands.length && b < header.degree; ++b) {
        const { values, row } = chunk.bands[b], size = 2 * b + 3;
        for (let k = 0; k < 3 * size; ++k)
          a.sh_rest[3 * (bands * i + first + k % size) + Math.floor(k / size)] = -4 + values[row(j) + k] * 8 / 255;
        first += size;
      }
    }
  }
  degreeOf(bands);
  const { about } = header, fps = +about.fps > 0 && +about.fps < 1e4 ? +about.fps : 24, up = about.up?.split(' ').map(Number);
  const steps = Math.max(2, Math.round(header.duration * fps) + 1);
  return checkedModel({ motion: 'spacetime', model: '.4dgs', count: n, sh_degree: header.degree, duration: header.duration || 1, cutoff: header.cutoff, steps, fps, ...(isDirection(up) && { up }) }, a);
}
