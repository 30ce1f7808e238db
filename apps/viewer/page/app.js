// SPDX-License-Identifier: Apache-2.0
// What all modules share: the state, what is loaded and shown, and who wants to know of changes.
import { addressOf, stateOfAddress } from './address.js';
import { FreeCamera } from './camera.js';
import { say } from './ui.js';

export const $ = (id) => document.getElementById(id);
export const app = {
  state: stateOfAddress(), free: new FreeCamera(), runs: [],
  pane: null,             // the model shown; pane.js
  other: null,            // the pane of the run to compare with, or null
  info: { cameras: [] },  // of the run shown
  groups: [],             // its cameras (compare.js)
  framing: null,          // where the last picture was drawn; views.js
  dirty: true,            // a picture is to be drawn
  movedAt: -1e9,          // when the camera moved last [ms]
  share: 1,               // of the resolution while something moves
  pathAt: null,           // seconds since the begin of the camera path while it plays
  isCompared: false,      // whether something is shown to compare with
  recording: null,        // while a video is made
};

const listeners = [], showers = [];
export function onChange(listener) { listeners.push(listener); }
export function onShow(shower) { showers.push(shower); }
// Brings all controls in line with the state.
export function showState() { for (const show of showers) show(); }

// To be called after a member of the state, or what is drawn, has changed.
let addressTimer = 0;
export function changed(name) {
  app.dirty = true;
  if (name && name !== 'time') showState();
  for (const listen of listeners) listen(name);
  clearTimeout(addressTimer);
  addressTimer = setTimeout(() => history.replaceState(null, '', addressOf(app.state)), 300);
}

export function fail(error, seconds = 0) {
  console.error(error);
  say(error.message, seconds);
}
