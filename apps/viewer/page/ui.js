// SPDX-License-Identifier: Apache-2.0
// Controls of the page: each shows and changes one member of the state.

const $ = (id) => document.getElementById(id);
export function setPart(input) {
  const { min, max, value } = input;
  input.style.setProperty('--part', `${(100 * (value - min)) / (max - min || 1)}%`);
}

// Connects chips and sliders; returns a function that shows the state in them.
export function attachControls(state, changed) {
  const chips = [...document.querySelectorAll('.chips')], switches = [...document.querySelectorAll('.switch')], sliders = [...document.querySelectorAll('#panel input[data-state]')];
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
      const atEnd = +slider.value >= +slider.max && slider.dataset.none;
      state[slider.dataset.state] = atEnd ? null : slider.dataset.scale === 'log' ? 10 ** slider.value : +slider.value;
      changed(slider.dataset.state);
    });
  for (const one of switches) one.addEventListener('click', () => { state[one.dataset.state] = !state[one.dataset.state]; changed(one.dataset.state); });
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
      slider.nextElementSibling.value = value === null ? slider.dataset.none : `${value >= 100 ? Math.round(value) : +value.toPrecision(2)}${unit}`;
      setPart(slider);
    }
    for (const field of document.querySelectorAll('[data-for]')) field.hidden = field.dataset.for !== state.mode;
    document.body.classList.toggle('closed', !state.panel);
    $('toggle').setAttribute('aria-expanded', String(state.panel));
    for (const one of switches) one.setAttribute('aria-checked', String(state[one.dataset.state]));
    $('loop').setAttribute('aria-pressed', String(state.loop));
    $('speed').value = [...$('speed').options].some((o) => +o.value === state.speed) ? String(state.speed) : '1';
    $('play').innerHTML = `<svg aria-hidden="true"><use href="#i-${state.playing ? 'pause' : 'play'}"/></svg>`;
    $('play').setAttribute('aria-label', state.playing ? 'Pause' : 'Play');
  };
}

// A sentence over the picture: a passing one at its lower edge, a lasting one in its middle. '' removes it.
let messageTimer = 0;
export function say(text, seconds = 0) {
  clearTimeout(messageTimer);
  $('message').classList.toggle('low', seconds > 0);
  $('message').textContent = text;
  $('message').hidden = !text;
  if (text && seconds) messageTimer = setTimeout(() => say(''), 1000 * seconds);
}
export function setBusy(text) {
  $('busy').textContent = text;
  $('busy').hidden = !text;
}
