// SPDX-License-Identifier: Apache-2.0
// Orders the Gaussians by the depth of their moved centres, farthest first, and leaves out those that are
// not visible at that time or outside of the filter's box. The bits of a positive float are monotone, so three passes of a counting
// sort over 11 bits each give the exact order; ties keep the order of rows, as in the engine.
import { placeCentres } from './motion.js';

let sorted = null, times = [], cropped = '', inside = null, centres = null, depths = null, keys = null, others = null, rows = null, spare = null;
const counts = new Uint32Array(2048);

onmessage = ({ data }) => {
  if (data.motion) {
    sorted = data.motion;
    times = data.times;
    cropped = '';
    inside = null;
    centres = new Float32Array(3 * sorted.count);
    [keys, others, rows, spare] = [0, 0, 0, 0].map(() => new Uint32Array(sorted.count));
    depths = new Float32Array(keys.buffer);
    return;
  }
  const start = performance.now();
  choose(data.crop);
  const order = data.buffer?.byteLength === 4 * sorted.count ? new Uint32Array(data.buffer) : new Uint32Array(sorted.count);
  const count = sortRows(data, order);
  const depthAt = (share) => count ? new Float32Array(new Uint32Array([keys[Math.floor(share * (count - 1))]]).buffer)[0] : 0;
  const kept = inside ? inside.reduce((sum, x) => sum + x, 0) : sorted.count;
  postMessage({ id: data.id, order, count, kept, near: depthAt(0.02), middle: depthAt(0.5), far: depthAt(0.98),
    milliseconds: performance.now() - start }, [order.buffer]);
};

// Marks the Gaussians that are inside of a box { low, high } at one of the times at least; null: all.
function choose(crop) {
  const key = crop ? [crop.low, crop.high].join() : '';
  if (key === cropped) return;
  cropped = key;
  inside = crop ? new Uint8Array(sorted.count) : null;
  if (!crop) return;
  const [x0, y0, z0] = crop.low, [x1, y1, z1] = crop.high;
  for (const time of sorted.motion === 'static' ? [0] : times) {
    placeCentres(sorted, time, centres);
    for (let i = 0, k = 0; i < sorted.count; ++i, k += 3) {
      const x = centres[k], y = centres[k + 1], z = centres[k + 2];
      if (x >= x0 && x <= x1 && y >= y0 && y <= y1 && z >= z0 && z <= z1) inside[i] = 1;
    }
  }
}

function sortRows({ time, row, offset, near }, order) {
  placeCentres(sorted, time, centres);
  let count = 0;
  for (let i = 0, k = 0; i < sorted.count; ++i, k += 3) {
    const depth = row[0] * centres[k] + row[1] * centres[k + 1] + row[2] * centres[k + 2] + offset;
    if (!(depth >= near && depth < Infinity) || inside && !inside[i]) continue;  // NaN fails
    depths[count] = depth;
    rows[count++] = i;
  }
  for (let shift = 0; shift < 33; shift += 11) {
    counts.fill(0);
    for (let i = 0; i < count; ++i) ++counts[(keys[i] >>> shift) & 2047];
    for (let i = 0, sum = 0; i < 2048; ++i) { const c = counts[i]; counts[i] = sum; sum += c; }
    for (let i = 0; i < count; ++i) {
      const at = counts[(keys[i] >>> shift) & 2047]++;
      others[at] = keys[i];
      spare[at] = rows[i];
    }
    [keys, others, rows, spare] = [others, keys, spare, rows];
  }
  depths = new Float32Array(keys.buffer);
  for (let i = 0; i < count; ++i) order[i] = rows[count - 1 - i];
  return count;
}
