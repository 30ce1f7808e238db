// SPDX-License-Identifier: Apache-2.0
// The time: scene times are [0, 1], and may be uneven over the time steps of the run shown.
import { $, app, changed, showState } from './app.js';
import { cameraIndex, groupOf, memberAt, pathOf } from './groups.js';
import { setPart } from './ui.js';

const { state } = app;
export const steps = () => Math.max(app.info.steps || app.pane.model?.steps || 1, 1);
export const modelTime = (time = state.time) => time * (app.pane.model?.duration ?? 1);
// Seconds of the whole video at its own speed.
export const wholeSeconds = () => Math.max(steps() - 1, 1) / (app.info.fps || app.pane.model?.fps || 24);

export function timeOf(frame) {
  const at = Math.min(Math.max(frame, 0), steps() - 1), { times } = app.info;
  return times?.length === steps() ? times[at] : at / Math.max(steps() - 1, 1);
}
// The time step at a time, with a fraction between two.
export function stepAt(time) {
  const last = steps() - 1, { times } = app.info;
  if (times?.length !== last + 1 || last < 1) return time * last;
  let k = 0;
  while (k < last - 1 && times[k + 1] <= time) ++k;
  return Math.min(Math.max(k + (time - times[k]) / (times[k + 1] - times[k] || 1), 0), last);
}
export const frameOf = (time) => Math.round(stepAt(time));

// One time step later: where flow leads.
export function nextTimeOf(time) {
  const whole = Math.floor(stepAt(time) + 1e-4), step = whole + 1 < steps() ? timeOf(whole + 1) - timeOf(whole) : timeOf(whole) - timeOf(whole - 1);
  return Math.min(time + step, 1);
}

export function setTime(time) {
  state.time = Math.min(Math.max(time, 0), 1);
  $('time').value = state.time;
  setPart($('time'));
  const index = cameraIndex();
  if (index >= 0) {
    const group = groupOf(index), { cameras } = app.info;
    if (group?.members.length > 1) state.camera = String(memberAt(group, cameras, state.time));
    else if (group && state.follow) {
      state.camera = String(memberAt(pathOf(index), cameras, state.time));
      $('camera').value = state.camera;
    }
  }
  const fps = app.info.fps || app.pane.model?.fps, frame = stepAt(state.time), [number, seconds] = $('clock').children;
  number.textContent = `${Number.isInteger(+frame.toFixed(3)) ? Math.round(frame) : frame.toFixed(1)} / ${steps() - 1}`;
  seconds.textContent = fps ? `${(frame / fps).toFixed(2)} s` : '';
  $('time').setAttribute('aria-valuetext', `${number.textContent} ${seconds.textContent}`);
  changed();
}

export function advance(seconds) {
  let time = state.time + seconds * state.speed / wholeSeconds();
  if (time > 1) {
    if (!state.loop) { time = 1; state.playing = false; showState(); } else time %= 1;
  }
  setTime(time);
}

// The next or previous whole time step.
export function step(by) {
  state.playing = false;
  setTime(timeOf(by > 0 ? Math.floor(stepAt(state.time) + 1e-4) + 1 : Math.ceil(stepAt(state.time) - 1e-4) - 1));
  showState();
}
