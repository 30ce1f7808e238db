// SPDX-License-Identifier: Apache-2.0
// Orders the Gaussians by the depth of their moved centres, farthest first, and leaves out those that are
// not visible at that time. The bits of a positive float are monotone, so three passes of a counting
// sort over 11 bits each give the exact order; ties keep the order of rows, as in the engine.
import { placeCentres } from './motion.js';

let sorted = null, centres = null, depths = null, keys = null, others = null, rows = null, spare = null;
const counts = new Uint32Array(2048);

onmessage = ({ data }) => {
  if (data.motion) {
    sorted = data.motion;
    centres = new Float32Array(3 * sorted.count);
    [keys, others, rows, spare] = [0, 0, 0, 0].map(() => new Uint32Array(sorted.count));
    depths = new Float32Array(keys.buffer);
    return;
  }
  const start = performance.now();
  const order = data.buffer?.byteLength === 4 * sorted.count ? new Uint32Array(data.buffer) : new Uint32Array(sorted.count);
  const count = sortRows(data, order);
  const depthAt = (share) => count ? new Float32Array(new Uint32Array([keys[Math.floor(share * (count - 1))]]).buffer)[0] : 0;
  postMessage({ id: data.id, order, count, near: depthAt(0.02), middle: depthAt(0.5), far: depthAt(0.98),
    milliseconds: performance.now() - start }, [order.buffer]);
};

function sortRows({ time, row, offset, near }, order) {
  placeCentres(sorted, time, centres);
  let count = 0;
  for (let i = 0, k = 0; i < sorted.count; ++i, k += 3) {
    const depth = row[0] * centres[k] + row[1] * centres[k + 1] + row[2] * centres[k + 2] + offset;
    if (!(depth >= near && depth < Infinity)) continue;  // NaN fails
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
