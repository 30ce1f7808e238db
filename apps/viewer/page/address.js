// SPDX-License-Identifier: Apache-2.0
// The state of the page: one object, of which every control reads and writes one member. The part of it
// that matters to somebody else is kept in the address.

// crop: least and greatest x, y, z in the world, ±Infinity where a side is open; with: the run to compare with, '' for true images.
export const firstState = {
  mode: 'color', show: 'all', background: 'scene', compare: 'off', wipe: 0.5, style: 'orbit', minOpacity: 0, maxSize: null,
  crop: null, longestFlow: null, resolution: 'auto', speed: 1, loop: true, time: 0, playing: false, camera: null, free: null,
  run: null, panel: true, fov: 50, follow: false, trails: false, arrows: false, with: '', path: '',
};
const kept = ['mode', 'show', 'background', 'compare', 'wipe', 'style', 'minOpacity', 'maxSize', 'crop', 'longestFlow',
  'resolution', 'speed', 'loop', 'time', 'camera', 'free', 'run', 'panel', 'follow', 'trails', 'arrows', 'with', 'path'];
export const choices = {
  mode: ['color', 'opacity', 'depth', 'flow', 'motion', 'ellipsoids', 'points'], show: ['all', 'moving', 'static'],
  background: ['scene', 'black', 'grey', 'white'], compare: ['off', 'wipe', 'beside', 'difference'],
  style: ['orbit', 'fly', 'walk'], resolution: ['auto', 'full', 'half'],
};

export function stateOfAddress() {
  const state = { ...firstState, panel: innerWidth > 760 }, words = new URLSearchParams(location.hash.slice(1));
  for (const name of kept) {
    const text = words.get(name), first = firstState[name];
    if (text === null) continue;
    if (choices[name]) { if (choices[name].includes(text)) state[name] = text; } else if (typeof first === 'boolean') state[name] = text === '1';
    else if (['camera', 'free', 'run', 'with', 'path'].includes(name)) state[name] = text;
    else if (name === 'crop') {
      const sides = text.split(',').map((word, k) => (word === '' ? (k < 3 ? -Infinity : Infinity) : +word));
      if (sides.length === 6 && !sides.some(Number.isNaN)) state.crop = sides;
    } else if (Number.isFinite(+text)) state[name] = +text;
  }
  state.time = Math.min(Math.max(state.time, 0), 1);
  state.wipe = Math.min(Math.max(state.wipe, 0), 1);
  return state;
}

export function addressOf(state) {
  const words = new URLSearchParams(), short = (x) => (Number.isFinite(x) ? String(+x.toPrecision(6)) : '');
  for (const name of kept) {
    const value = state[name];
    if (value === null || value === undefined || (value === firstState[name] && name !== 'panel')) continue;
    words.set(name, typeof value === 'boolean' ? (value ? '1' : '0') : typeof value === 'number' ? short(value) : Array.isArray(value) ? value.map(short).join() : value);
  }
  return `#${words}`;
}
