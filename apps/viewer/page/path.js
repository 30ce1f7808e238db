// SPDX-License-Identifier: Apache-2.0
// A path of the camera: key cameras, each at its second of the video, with the scene time shown there.
// Between them eye and target follow cubic curves through all keys; scene time and upwards change evenly.
import { dot3, FreeCamera, unit3 } from './camera.js';
import { FileError } from './container.js';

// Keys are { at [s], time, eye, target, down, fov [rad] } in the order of `at`.
export function keyOf({ eye, axes, distance, fov }, at, time) {
  return { at, time, eye: [...eye], target: eye.map((x, k) => x + distance * axes[2][k]), down: [...axes[1]], fov };
}

// Through values with the times of keys, from key k to the next, of which a fraction f has passed.
function curve(keys, name, k, f) {
  const a = keys[k], b = keys[k + 1], seconds = b.at - a.at;
  const slope = (i, c) => { const p = keys[Math.max(i - 1, 0)], q = keys[Math.min(i + 1, keys.length - 1)]; return (q[name][c] - p[name][c]) / (q.at - p.at); };
  const g = 1 - f;
  return a[name].map((x, c) => g * g * (1 + 2 * f) * x + f * f * (3 - 2 * f) * b[name][c] + seconds * f * g * (g * slope(k, c) - f * slope(k + 1, c)));
}

export const secondsOf = (keys) => (keys.length ? keys.at(-1).at : 0);

// Puts a free camera on the path; returns the scene time there.
export function placeOnPath(keys, at, camera) {
  let k = 0;
  while (k < keys.length - 2 && keys[k + 1].at <= at) ++k;
  const a = keys[k], b = keys[k + 1] ?? a, f = b === a ? 0 : Math.min(Math.max((at - a.at) / (b.at - a.at), 0), 1), even = (x, y) => x + f * (y - x);
  const eye = b === a ? a.eye : curve(keys, 'eye', k, f), target = b === a ? a.target : curve(keys, 'target', k, f);
  const forward = target.map((x, c) => x - eye[c]), distance = Math.hypot(...forward) || 1, ahead = unit3(forward);
  const down = a.down.map((x, c) => even(x, b.down[c])), along = dot3(down, ahead), level = unit3(down.map((x, c) => x - along * ahead[c]));
  const right = [level[1] * ahead[2] - level[2] * ahead[1], level[2] * ahead[0] - level[0] * ahead[2], level[0] * ahead[1] - level[1] * ahead[0]];
  Object.assign(camera, { eye, axes: [right, level, ahead], distance, fov: even(a.fov, b.fov) });
  return even(a.time, b.time);
}

// In the address: twelve numbers for each key.
export function textOfPath(keys) {
  return keys.map((key) => [key.at, key.time, ...key.eye, ...key.target, ...key.down, key.fov].map((x) => +x.toPrecision(5)).join(',')).join(';');
}
export function pathOfText(text) {
  const keys = text.split(';').map((one) => one.split(',').map(Number));
  if (!text || keys.some((v) => v.length !== 12 || !v.every(Number.isFinite) || !(v[11] > 0.01 && v[11] < 3.1))) return [];
  return inOrder(keys.map((v) => ({ at: v[0], time: v[1], eye: v.slice(2, 5), target: v.slice(5, 8), down: v.slice(8, 11), fov: v[11] })));
}

// Sorted, a tenth of a second apart at least, from 0 on.
export function inOrder(keys) {
  keys.sort((a, b) => a.at - b.at);
  const first = keys[0]?.at ?? 0;
  keys.forEach((key, k) => { key.at = Math.max(key.at - first, k ? keys[k - 1].at + 0.1 : 0); });
  return keys;
}

// The list of cameras that gflow and 3DGS call cameras.json, with the `seconds` and the scene `time` of each.
export function jsonOfPath(keys, { width, height, origin, near }) {
  const list = keys.map((key, id) => {
    const camera = new FreeCamera(), f = height / 2 / Math.tan(key.fov / 2);
    placeOnPath([key], 0, camera);
    return {
      id, img_name: `key_${id}`, width, height, position: key.eye.map((x, k) => x + origin[k]), rotation: [0, 1, 2].map((row) => camera.axes.map((axis) => axis[row])),
      fx: f, fy: f, cx: width / 2, cy: height / 2, near, time: key.time, seconds: key.at, distance: camera.distance,
    };
  });
  return `${JSON.stringify(list, null, 1)}\n`;
}

// distance: of the targets of cameras that do not say it.
export function pathOfJson(text, { origin, distance }) {
  let list;
  try { list = JSON.parse(text); } catch { list = null; }
  const numbers = (value, n) => Array.isArray(value) && value.length === n && value.every(Number.isFinite);
  const good = (c) => numbers(c?.position, 3) && c.rotation?.length === 3 && c.rotation.every((row) => numbers(row, 3)) && c.fy > 0 && c.height > 0;
  if (!Array.isArray(list) || !list.length || !list.every(good))
    throw new FileError('This is not a camera path: a list of cameras with position, rotation, height and fy is needed, as in camera_path.json or cameras.json.');
  return inOrder(list.map((c, i) => {
    const axes = [0, 1, 2].map((column) => c.rotation.map((row) => row[column])), number = (x, otherwise) => (Number.isFinite(x) ? x : otherwise);
    const camera = { eye: c.position.map((x, k) => x - origin[k]), axes, distance: Math.max(number(c.distance, distance), 1e-6), fov: 2 * Math.atan(c.height / 2 / c.fy) };
    return keyOf(camera, number(c.seconds, 2 * i), Math.min(Math.max(number(c.time, 0), 0), 1));
  }));
}
