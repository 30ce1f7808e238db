// SPDX-License-Identifier: Apache-2.0
// Controls of the page. The state is one object; every control reads and writes one member of it and calls
// changed(name). The part of it that matters to somebody else is kept in the address.

export const firstState = {
  mode: 'color', show: 'all', background: 'scene', compare: 'off', wipe: 0.5, style: 'orbit', minOpacity: 0, maxSize: null,
  crop: null, longestFlow: null, resolution: 'auto', speed: 1, loop: true, time: 0, playing: false, camera: null, free: null,
  run: null, panel: true, fov: 50, follow: false, trails: false,
};
const kept = ['mode', 'show', 'background', 'compare', 'wipe', 'style', 'minOpacity', 'maxSize', 'crop', 'longestFlow',
  'resolution', 'speed', 'loop', 'time', 'camera', 'free', 'run', 'panel', 'follow', 'trails'];
const choices = {
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
    else if (['camera', 'free', 'run'].includes(name)) state[name] = text;
    else if (Number.isFinite(+text)) state[name] = +text;
  }
  state.time = Math.min(Math.max(state.time, 0), 1);
  state.wipe = Math.min(Math.max(state.wipe, 0), 1);
  return state;
}
export function addressOf(state) {
  const words = new URLSearchParams();
  for (const name of kept) {
    const value = state[name];
    if (value === null || value === undefined || (value === firstState[name] && name !== 'panel')) continue;
    words.set(name, typeof value === 'boolean' ? (value ? '1' : '0') : typeof value === 'number' ? String(+value.toPrecision(6)) : value);
  }
  return `#${words}`;
}

const $ = (id) => document.getElementById(id);
export function setPart(input) {
  const { min, max, value } = input;
  input.style.setProperty('--part', `${(100 * (value - min)) / (max - min || 1)}%`);
}

// Connects chips and sliders; returns a function that shows the state in them.
export function attachControls(state, changed) {
  const chips = [...document.querySelectorAll('.chips')], sliders = [...document.querySelectorAll('#panel input[data-state]')];
  for (const group of chips) {
    const buttons = [...group.children];
    buttons.forEach((button, i) => {
      button.setAttribute('role', 'radio');
      button.addEventListener('click', () => { state[group.dataset.state] = button.value; changed(group.dataset.state); });
      button.addEventListener('keydown', (event) => {
        const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
        if (!by) return;
        event.preventDefault();
        event.stopPropagation();
        let at = i;
        do at = (at + by + buttons.length) % buttons.length; while (buttons[at].disabled && at !== i);
        buttons[at].focus();
        buttons[at].click();
      });
    });
  }
  for (const slider of sliders)
    slider.addEventListener('input', () => {
      // The end of a slider that limits means no limit.
      const atEnd = +slider.value >= +slider.max && ['maxSize', 'crop'].includes(slider.dataset.state);
      state[slider.dataset.state] = atEnd ? null : slider.dataset.scale === 'log' ? 10 ** slider.value : +slider.value;
      changed(slider.dataset.state);
    });
  return () => {
    for (const group of chips)
      for (const button of group.children) {
        const on = state[group.dataset.state] === button.value;
        button.setAttribute('aria-checked', String(on));
        button.tabIndex = on ? 0 : -1;
      }
    for (const slider of sliders) {
      const value = state[slider.dataset.state];
      if (document.activeElement !== slider || value === null)
        slider.value = value === null ? slider.max : slider.dataset.scale === 'log' ? Math.log10(value) : value;
      const unit = slider.dataset.unit || '';
      slider.nextElementSibling.value = value === null ? (slider.dataset.none ?? 'all') : `${value >= 100 ? Math.round(value) : +value.toPrecision(2)}${unit}`;
      setPart(slider);
    }
    for (const field of document.querySelectorAll('[data-for]')) field.hidden = field.dataset.for !== state.mode;
    document.body.classList.toggle('closed', !state.panel);
    $('toggle').setAttribute('aria-expanded', String(state.panel));
    $('follow').setAttribute('aria-checked', String(state.follow));
    $('trail').setAttribute('aria-checked', String(state.trails));
    $('loop').setAttribute('aria-pressed', String(state.loop));
    $('speed').value = [...$('speed').options].some((o) => +o.value === state.speed) ? String(state.speed) : '1';
    $('play').innerHTML = `<svg aria-hidden="true"><use href="#i-${state.playing ? 'pause' : 'play'}"/></svg>`;
    $('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  };
}

// Keys of the page, by name of the command.
export function attachKeys(commands) {
  const keys = {
    ' ': 'play', ArrowLeft: 'stepBack', ArrowRight: 'step', Home: 'first', End: 'last', '[': 'previousCamera', ']': 'nextCamera',
    c: 'compare', p: 'save', l: 'link', h: 'panel', r: 'reset', u: 'up', '?': 'help', Escape: 'dismiss',
  };
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || $('keys').open) return;
    const { target } = event, inControl = target.closest?.('select, input, button');
    const isKeyOfControl = inControl && [' ', 'ArrowLeft', 'ArrowRight', 'Home', 'End', 'Enter'].includes(event.key);
    if (isKeyOfControl || target.closest?.('select')) return;
    const digit = +event.key;
    if (digit >= 1 && digit <= choices.mode.length) return void commands.mode(choices.mode[digit - 1]);
    const command = commands[keys[event.key] ?? keys[event.key.toLowerCase()]];
    if (!command) return;
    event.preventDefault();
    command();
  });
}

// A passing or lasting sentence over the picture; '' removes it.
let messageTimer = 0;
export function say(text, seconds = 0) {
  clearTimeout(messageTimer);
  $('message').textContent = text;
  $('message').hidden = !text;
  if (text && seconds) messageTimer = setTimeout(() => say(''), 1000 * seconds);
}
export function setBusy(text) {
  $('busy').textContent = text;
  $('busy').hidden = !text;
}
