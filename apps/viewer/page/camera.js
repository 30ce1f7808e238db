// SPDX-License-Identifier: Apache-2.0
// The camera of the page. Either one of the scene's own, shown in its own frame, or a free one that is
// moved with mouse, keys and touch. Axes as in the engine: x right, y down, z forward.

export const dot3 = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add3 = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const cross3 = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit3 = (a) => { const n = Math.hypot(...a) || 1; return a.map((x) => x / n); };

// v turned around a unit axis.
function turned(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle), along = dot3(axis, v) * (1 - c), side = cross3(axis, v);
  return [0, 1, 2].map((k) => v[k] * c + side[k] * s + axis[k] * along);
}

// Rotation, translation and frame of a camera of the scene, as the renderer takes them, scaled.
export function viewOfCamera(camera, near, scale = 1) {
  const m = camera.viewmat;
  return {
    rotation: [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]], translation: [m[3], m[7], m[11]],
    fx: camera.fx * scale, fy: camera.fy * scale, cx: camera.cx * scale, cy: camera.cy * scale,
    width: Math.round(camera.width * scale), height: Math.round(camera.height * scale), near, filter: scale,
  };
}

export class FreeCamera {
  constructor() {
    this.eye = [0, 0, -1];
    this.axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];  // right, down, forward
    this.up = [0, -1, 0];
    this.distance = 1;  // to what it orbits around
    this.fov = 0.9;     // vertical [rad]
    this.speed = 1;     // of flying [scene units/s]
    this.style = 'orbit';
  }

  // Takes over the place and direction of a view.
  takeView({ rotation: r, translation: t, fy, height }) {
    this.axes = [r.slice(0, 3), r.slice(3, 6), r.slice(6, 9)].map(unit3);
    this.eye = [0, 1, 2].map((k) => -(r[k] * t[0] + r[3 + k] * t[1] + r[6 + k] * t[2]));
    this.fov = 2 * Math.atan(height / 2 / fy);
  }

  // Looks at a point from a direction (towards the point).
  look(point, forward, distance) {
    const right = unit3(cross3(forward, this.up)), ahead = unit3(forward);
    this.axes = [right, cross3(ahead, right), ahead];
    this.distance = distance;
    this.eye = add3(point, ahead, -distance);
  }

  view(width, height, near) {
    const [x, y, z] = this.axes, f = height / 2 / Math.tan(this.fov / 2);
    return {
      rotation: [...x, ...y, ...z], translation: [x, y, z].map((a) => -dot3(a, this.eye)),
      fx: f, fy: f, cx: width / 2, cy: height / 2, width, height, near, filter: 1,
    };
  }

  // Turns by angles, around what it looks at (orbit) or itself; the horizon stays level.
  turn(yaw, pitch) {
    const pivot = add3(this.eye, this.axes[2], this.distance), elevation = Math.acos(dot3(this.axes[2], this.up));
    const limited = Math.min(Math.max(elevation - pitch, 0.05), Math.PI - 0.05);
    let axes = this.axes.map((a) => turned(a, this.axes[0], elevation - limited));
    axes = axes.map((a) => turned(a, this.up, yaw));
    this.axes = [unit3(axes[0]), unit3(axes[1]), unit3(axes[2])];
    if (this.style === 'orbit') this.eye = add3(pivot, this.axes[2], -this.distance);
  }
  // Moves parallel to the picture, by parts of its height.
  pan(dx, dy) {
    const size = 2 * Math.tan(this.fov / 2) * this.distance;
    this.eye = add3(add3(this.eye, this.axes[0], -dx * size), this.axes[1], -dy * size);
  }
  zoom(factor) {
    const pivot = add3(this.eye, this.axes[2], this.distance);
    this.distance *= factor;
    this.eye = add3(pivot, this.axes[2], -this.distance);
  }
  // Moves by [right, up, forward]; walking keeps to the ground.
  move(by) {
    let [right, , forward] = this.axes;
    if (this.style === 'walk') {
      forward = unit3(add3(forward, this.up, -dot3(forward, this.up)));
      by = [by[0], 0, by[2]];
    }
    this.eye = add3(add3(add3(this.eye, right, by[0]), this.up, by[1]), forward, by[2]);
  }

  // In the address: eye, forward, right, distance, field of view.
  toText() {
    return [...this.eye, ...this.axes[2], ...this.axes[0], this.distance, this.fov].map((x) => +x.toPrecision(6)).join(',');
  }
  fromText(text) {
    const v = text.split(',').map(Number);
    if (v.length !== 11 || !v.every(Number.isFinite) || !(v[9] > 0) || !(v[10] > 0.01 && v[10] < 3.1)) return false;
    const forward = unit3(v.slice(3, 6)), right = unit3(v.slice(6, 9));
    this.eye = v.slice(0, 3);
    this.axes = [right, cross3(forward, right), forward];
    [this.distance, this.fov] = v.slice(9);
    return true;
  }
}

// Moves the camera with pointers, wheel and keys. `take()` is called before the first change, `changed()`
// after each; step(seconds) moves with the keys held and returns whether it did.
export function attachCamera(element, camera, take, changed) {
  const pointers = new Map(), held = new Set();
  const act = (change) => { take(); change(); changed(); };
  element.addEventListener('pointerdown', (event) => {
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, button: event.button });
  });
  const release = (event) => pointers.delete(event.pointerId);
  element.addEventListener('pointerup', release);
  element.addEventListener('pointercancel', release);
  element.addEventListener('contextmenu', (event) => event.preventDefault());
  element.addEventListener('pointermove', (event) => {
    const pointer = pointers.get(event.pointerId);
    if (!pointer) return;
    const height = element.clientHeight || 1, before = [...pointers.values()].map(({ x, y }) => [x, y]);
    const dx = event.clientX - pointer.x, dy = event.clientY - pointer.y;
    pointer.x = event.clientX;
    pointer.y = event.clientY;
    if (!dx && !dy) return;
    if (pointers.size === 2) {
      const after = [...pointers.values()], span = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]) || 1;
      const factor = span(...before) / span(...after.map(({ x, y }) => [x, y]));
      if (camera.style === 'orbit') act(() => { camera.zoom(factor); camera.pan(dx / 2 / height, dy / 2 / height); });
      else act(() => camera.move([2 * dx / height, 0, 3 * (1 - factor) - 2 * dy / height].map((x) => x * camera.speed)));
    } else if (pointers.size === 1) {
      const pans = pointer.button === 2 || pointer.button === 1 || event.shiftKey;
      const sign = camera.style === 'orbit' ? 1 : -0.5;
      act(() => pans ? camera.pan(dx / height, dy / height) : camera.turn(-sign * 3 * dx / height, -sign * 3 * dy / height));
    }
  });
  element.addEventListener('wheel', (event) => {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? 30 : 1, factor = Math.exp(Math.min(Math.max(event.deltaY * lines, -200), 200) * 0.0015);
    act(() => camera.style === 'orbit' ? camera.zoom(factor) : camera.move([0, 0, (1 - factor) * camera.speed]));
  }, { passive: false });

  const directions = { w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], e: [0, 1, 0], q: [0, -1, 0] };
  const typing = (event) => event.target.closest?.('input[type=search], input[type=number], select, dialog[open]') || event.ctrlKey || event.metaKey || event.altKey;
  addEventListener('keydown', (event) => {
    const key = event.key.toLowerCase();
    if (directions[key] && !typing(event)) { held.add(key); changed(); }
    held[event.shiftKey ? 'add' : 'delete']('shift');
  });
  addEventListener('keyup', (event) => { held.delete(event.key.toLowerCase()); });
  addEventListener('blur', () => held.clear());
  return (seconds) => {
    let by = [0, 0, 0];
    for (const key of held) if (directions[key]) by = add3(by, directions[key]);
    if (!by.some(Boolean)) return false;
    act(() => camera.move(by.map((x) => x * camera.speed * seconds * (held.has('shift') ? 3 : 1))));
    return true;
  };
}
