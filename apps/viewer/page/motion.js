// SPDX-License-Identifier: Apache-2.0
// Motion models on the CPU: time windows, weights of keys, and the moved centres that the worker sorts
// (shaders.js has the same formulas), as in kernels/shared/motion. Times are model times: the video is [0, duration].

// |t - mean_t| below which a Gaussian is visible, in temporal standard deviations.
export function windowSigmas(cutoff) {
  return cutoff > 0 ? Math.sqrt(-2 * Math.log(cutoff)) : 1e6;
}

// The keys that make the pose at time t and their weights: { first, weights }. Keyframes: Catmull-Rom,
// extended linearly at the ends; poses: linear.
export function keyWeights(model, t) {
  const keys = model.keyCount, { times } = model, at = t / model.duration;
  if (keys < 2) return { first: 0, weights: [1] };
  let place = Math.min(Math.max(at, 0), 1) * (keys - 1);
  if (times) {  // uneven
    let k = 0;
    while (k < keys - 2 && at >= times[k + 1]) ++k;
    place = Math.min(Math.max(k + (at - times[k]) / (times[k + 1] - times[k]), 0), keys - 1);
  }
  // Snap to the key: the time of a frame is rounded to float.
  if (Math.abs(place - Math.round(place)) < 1e-5 * keys) place = Math.round(place);
  const key = Math.min(Math.floor(place), keys - 2), f = place - key;
  if (model.motion === 'poses') return f > 0 ? { first: key, weights: [1 - f, f] } : { first: key, weights: [1] };
  const w = [0.5 * f * (-1 + f * (2 - f)), 1 + 0.5 * f * f * (-5 + 3 * f),
    0.5 * f * (1 + f * (4 - 3 * f)), 0.5 * f * f * (f - 1)];
  if (key === 0) { w[1] += 2 * w[0]; w[2] -= w[0]; w[0] = 0; }
  if (key + 2 === keys) { w[2] += 2 * w[3]; w[1] -= w[3]; w[3] = 0; }
  let first = 0, last = 3;
  while (w[first] === 0) ++first;
  while (w[last] === 0) --last;
  return { first: key - 1 + first, weights: w.slice(first, last + 1) };
}

// Writes the centres of all Gaussians at time t to `out` [n, 3]; NaN where a Gaussian is not visible then.
export function placeCentres(model, t, out) {
  const a = model.arrays, n = model.count, moving = model.moving;
  out.set(a.means);
  if (model.keyCount) {
    const { first, weights } = keyWeights(model, t);
    const table = a.key_shifts || a.pose_means;
    if (a.pose_means) out.fill(0, 0, 3 * moving);
    for (let w = 0; w < weights.length; ++w) {
      const weight = weights[w], row = (first + w) * moving * 3;
      for (let i = 0; i < 3 * moving; ++i) out[i] += table[row + i] * weight;
    }
    if (a.pose_opacities)
      for (let i = 0; i < moving; ++i) {
        let opacity = 0;
        for (let w = 0; w < weights.length; ++w) opacity += weights[w] * a.pose_opacities[(first + w) * moving + i];
        if (!(opacity > 0.0039)) out[3 * i] = NaN;
      }
  } else if (a.velocities) {
    const v = a.velocities, c = a.half_accelerations, d = a.cubics;
    for (let i = 0; i < moving; ++i) {
      const tau = t - a.means_t[i];
      for (let k = 3 * i; k < 3 * i + 3; ++k) out[k] += (v[k] + (c ? (c[k] + (d ? d[k] * tau : 0)) * tau : 0)) * tau;
    }
  }
  if (!a.lives) return;
  const sigmas = windowSigmas(model.cutoff) * 1.0001;  // the shader decides; this only saves it work
  for (let i = 0; i < n; ++i)
    if (!(Math.abs(t - a.means_t[i]) < sigmas * a.lives[i])) out[3 * i] = NaN;
  if (a.windows)
    for (let i = 0; i < n; ++i) if (!(t >= a.windows[2 * i] && t < a.windows[2 * i + 1])) out[3 * i] = NaN;
}
