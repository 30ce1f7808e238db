// SPDX-License-Identifier: Apache-2.0
// Trails of moving Gaussians, drawn over the picture: some of those that move at each time, with their
// paths over the last time steps. They are not hidden by what is in front.
import { placeCentres } from './motion.js';

const perStep = 24, mostSteps = 48;

// Chosen paths of a model: { times, paths: [Float32Array of 3 values per time, NaN where not visible] }.
export function findTrails(model, times) {
  const every = Math.max(1, Math.ceil(times.length / mostSteps)), kept = times.filter((_, k) => k % every === 0).map((t) => t * model.duration);
  if (model.motion === 'static' || kept.length < 2) return { times: [], paths: [] };
  const chosen = new Set(), fast = 6e-3 * model.size * every, frames = [];
  for (const t of kept) {
    const centres = new Float32Array(3 * model.count);
    placeCentres(model.sorted, t, centres);
    frames.push(centres);
  }
  for (let k = 0; k + 1 < kept.length; ++k) {
    const [a, b] = [frames[k], frames[k + 1]], moving = [];
    for (let i = 0; i < model.moving; ++i) {
      const way = Math.hypot(b[3 * i] - a[3 * i], b[3 * i + 1] - a[3 * i + 1], b[3 * i + 2] - a[3 * i + 2]);
      if (way > fast && way < model.size && model.arrays.logit_opacities[i] > -0.5) moving.push(i);
    }
    for (let j = 0; j < perStep && moving.length; ++j) chosen.add(moving[Math.floor((j + 0.5) / perStep * moving.length)]);
  }
  return { times: kept, paths: [...chosen].map((i) => Float32Array.from(frames.flatMap((f) => [f[3 * i], f[3 * i + 1], f[3 * i + 2]]))) };
}

// Draws the trails up to model time t for a view whose picture begins at the context's origin.
export function drawTrails(context, { times, paths }, view, t) {
  const step = times[1] - times[0], length = Math.min(8, times.length - 1);
  const { rotation: r, translation: m } = view, place = (path, k, next, f) => {
    const [x, y, z] = [0, 1, 2].map((c) => path[3 * k + c] * (1 - f) + (f ? path[3 * next + c] * f : 0));
    const depth = r[6] * x + r[7] * y + r[8] * z + m[2];
    if (!(depth > view.near)) return null;
    return [view.cx + view.fx * (r[0] * x + r[1] * y + r[2] * z + m[0]) / depth, view.cy + view.fy * (r[3] * x + r[4] * y + r[5] * z + m[1]) / depth];
  };
  const at = Math.min(Math.max(t / step, 0), times.length - 1), last = Math.floor(at), next = Math.min(last + 1, times.length - 1), width = Math.max(1.2, view.height / 500);
  for (const path of paths) {
    let before = place(path, last, next, at - last) ?? place(path, last, next, 0);
    if (!before) continue;
    const [headX, headY] = before;
    for (let k = last; k >= Math.max(0, last - length + 1); --k) {
      const here = place(path, k, k, 0);
      if (!here) break;
      context.strokeStyle = `rgba(124, 196, 255, ${0.9 * (1 - (last - k) / length)})`;
      context.lineWidth = width * (1.4 - (last - k) / length);
      context.beginPath();
      context.moveTo(...before);
      context.lineTo(...here);
      context.stroke();
      before = here;
    }
    context.fillStyle = '#fff';
    context.beginPath();
    context.arc(headX, headY, 1.1 * width, 0, 7);
    context.fill();
  }
}
