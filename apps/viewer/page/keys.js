// SPDX-License-Identifier: Apache-2.0
// Keys of the page, by name of the command.
import { $ } from './app.js';
import { choices } from './address.js';

const keys = {
  ' ': 'play', ArrowLeft: 'stepBack', ArrowRight: 'step', Home: 'first', End: 'last', '[': 'previousCamera', ']': 'nextCamera',
  c: 'compare', p: 'save', l: 'link', h: 'panel', r: 'reset', u: 'up', '?': 'help', Escape: 'dismiss', v: 'record', k: 'addCamera', g: 'playPath',
};

export function attachKeys(commands) {
  // A button that was clicked does not keep the keys: Space plays.
  addEventListener('click', (event) => { if (event.detail && !$('keys').open) event.target.closest?.('button')?.blur(); });
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || $('keys').open) return;
    const { target } = event, inControl = target.closest?.('select, input, button');
    const isKeyOfControl = inControl && [' ', 'ArrowLeft', 'ArrowRight', 'Home', 'End', 'Enter'].includes(event.key);
    if (isKeyOfControl || target.closest?.('select, input[type=number], input[type=search]')) return;
    const digit = +event.key;
    if (digit >= 1 && digit <= choices.mode.length) return void commands.mode(choices.mode[digit - 1]);
    const command = commands[keys[event.key] ?? keys[event.key.toLowerCase()]];
    if (!command) return;
    event.preventDefault();
    command();
  });
}
