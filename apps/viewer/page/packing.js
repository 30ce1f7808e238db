// SPDX-License-Identifier: Apache-2.0
// What the device and the worker get of a model: texels of its parameters, and what moves its centres.

// Texels of four floats per Gaussian. Each motion model begins with
//   mean, logit of the opacity | quat w x y z | log scales x y z, log of the temporal deviation
const texelsOfMotion = { static: 3, spacetime: 6, native4d: 5, keyframes: 4, poses: 4 };
export function texelsPerRow(model) {
  return texelsOfMotion[model.motion] + (model.arrays.cubics ? 1 : 0) + (model.arrays.windows ? 1 : 0);
}

export function packRows(model, texels, put) {
  const a = model.arrays, n = model.count, moving = model.moving, timed = a.means_t !== undefined;
  const scales = a.log_scales.length / Math.max(n, 1);
  for (let i = 0; i < n; ++i) {
    const o = put(i) * 4;
    for (let k = 0; k < 3; ++k) {
      texels[o + k] = a.means[3 * i + k];
      texels[o + 8 + k] = a.log_scales[scales * i + k];
    }
    texels[o + 3] = a.logit_opacities[i];
    for (let k = 0; k < 4; ++k) texels[o + 4 + k] = a.quats[4 * i + k];
    if (!timed) continue;
    texels[o + 11] = a.log_scales[4 * i + 3];
    texels[o + 15] = a.means_t[i];
    let next = o + 16;
    if (model.motion === 'spacetime') {
      if (i < moving) {
        for (let k = 0; k < 3; ++k) {
          texels[o + 12 + k] = a.velocities[3 * i + k];
          texels[o + 16 + k] = a.half_accelerations[3 * i + k];
        }
        for (let k = 0; k < 4; ++k) texels[o + 20 + k] = a.turns[4 * i + k];
      }
      next = o + 24;
    } else if (model.motion === 'native4d') {
      const right = i < moving ? a.quats_r : a.quats;
      for (let k = 0; k < 4; ++k) texels[o + 16 + k] = right[4 * i + k];
    }
    if (a.cubics) { for (let k = 0; k < 3; ++k) texels[next + k] = a.cubics[3 * i + k]; next += 4; }
    if (a.windows) { texels[next] = a.windows[2 * i]; texels[next + 1] = a.windows[2 * i + 1]; }
  }
}

// Texels of one key of a moving Gaussian: mean or shift, opacity | quat or turn | scales if they have keys.
export function texelsPerKey(model) {
  return model.arrays.key_scales || model.arrays.pose_log_scales ? 3 : 2;
}
export function packKey(model, key, texels, put) {
  const a = model.arrays, m = model.moving, poses = model.motion === 'poses';
  const means = poses ? a.pose_means : a.key_shifts, quats = poses ? a.pose_quats : a.key_turns;
  const scales = poses ? a.pose_log_scales : a.key_scales, opacities = a.pose_opacities;
  for (let i = 0; i < m; ++i) {
    const o = put(i) * 4, row = key * m + i;
    for (let k = 0; k < 3; ++k) texels[o + k] = means[3 * row + k];
    if (opacities) texels[o + 3] = opacities[row];
    for (let k = 0; k < 4; ++k) texels[o + 4 + k] = quats[4 * row + k];
    if (scales) for (let k = 0; k < 3; ++k) texels[o + 8 + k] = scales[3 * row + k];
  }
}

// What the worker needs of a model, so that colours and shapes are not copied to it.
export function motionOf(model) {
  const { motion, count, moving, duration, cutoff, keyCount, times } = model;
  const arrays = {};
  for (const name of ['means', 'means_t', 'velocities', 'half_accelerations', 'cubics', 'windows', 'key_shifts',
    'pose_means', 'pose_opacities'])
    if (model.arrays[name]) arrays[name] = model.arrays[name];
  if (model.arrays.means_t) {  // temporal standard deviations, and velocities of native4d
    const lives = arrays.lives = new Float32Array(count), velocities = new Float32Array(3 * moving);
    for (let i = 0; i < count; ++i) {
      lives[i] = Math.exp(model.arrays.log_scales[4 * i + 3]);
      if (motion === 'native4d') lives[i] = sliceMotion(model, i, velocities);
    }
    if (motion === 'native4d') arrays.velocities = velocities;
  }
  return { motion, count, moving, duration, cutoff, keyCount, times, arrays };
}

// native4d: velocity of row i, and its temporal standard deviation |p_t| (kernels/shared/motion/native4d.h).
function sliceMotion(model, i, velocities) {
  const a = model.arrays, s = [0, 1, 2, 3].map((k) => Math.exp(a.log_scales[4 * i + k]));
  const left = unit(a.quats, i), right = i < model.moving ? unit(a.quats_r, i) : left;
  const conjugate = [right[0], -right[1], -right[2], -right[3]];
  const axes = [[0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [1, 0, 0, 0]];
  const columns = axes.map((e, k) => multiply(multiply(left, e), conjugate).map((x) => x * s[k]));
  let variance = 0;
  for (const c of columns) variance += c[0] * c[0];
  if (i < model.moving)
    for (let k = 0; k < 3; ++k) {
      let sum = 0;
      for (const c of columns) sum += c[k + 1] * c[0];
      velocities[3 * i + k] = sum / variance;
    }
  return Math.sqrt(variance);
}
function unit(quats, i) {
  const q = [quats[4 * i], quats[4 * i + 1], quats[4 * i + 2], quats[4 * i + 3]], norm = Math.hypot(...q);
  return norm > 1e-6 && norm < Infinity ? q.map((x) => x / norm) : [1, 0, 0, 0];
}
function multiply(a, b) {
  return [a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
}
