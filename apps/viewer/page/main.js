// SPDX-License-Identifier: Apache-2.0
// The page: its commands and the loop that draws when something has changed.
import { addressOf, firstState, stateOfAddress } from './address.js';
import { $, app, changed, fail, onChange, onShow, showState } from './app.js';
import { attachCamera } from './camera.js';
import { attachWipe } from './compare.js';
import { attachCrop, exportCommand } from './crop.js';
import { draw, showNumbers } from './drawing.js';
import { cameraIndex } from './groups.js';
import { attachKeys } from './keys.js';
import { Pane } from './pane.js';
import { advancePath, attachPath, pathCommands } from './path_panel.js';
import { attachPictures, capture, psnrNow, savePicture } from './pictures.js';
import { attachRuns, follow, openFiles, openRun } from './runs.js';
import { findRuns } from './source.js';
import { advance, frameOf, setTime, step, timeOf } from './timeline.js';
import { attachControls, say, setBusy } from './ui.js';
import { attachViews, cameraMoved, frameView, isMoving, nextUp, resetCamera, setCamera, stepCamera, takeCamera } from './views.js';

const { state, free } = app;

async function copy(text, done, otherwise) {
  const copied = await navigator.clipboard?.writeText(text).then(() => true, () => false);
  say(copied ? done : otherwise, copied ? 2 : 12);
}

const commands = {
  play: () => { if (!state.playing && !state.loop && state.time >= 1) setTime(0); state.playing = !state.playing; app.pathAt = null; changed('playing'); },
  step: () => step(1),
  stepBack: () => step(-1),
  first: () => setTime(0),
  last: () => setTime(1),
  up: nextUp,
  previousCamera: () => stepCamera(-1),
  nextCamera: () => stepCamera(1),
  reset: resetCamera,
  mode: (mode) => { state.mode = mode; changed('mode'); },
  compare: () => {
    const kinds = ['off', 'wipe', 'beside', 'difference'];
    if (!state.with && cameraIndex() < 0 && app.groups.length) resetCamera();
    state.compare = kinds[(kinds.indexOf(state.compare) + 1) % kinds.length];
    changed('compare');
  },
  save: () => savePicture().catch(fail),
  link: () => {
    history.replaceState(null, '', addressOf(state));
    copy(location.href, 'The address of this view is copied.', 'The address of this view is in the address bar.');
  },
  panel: () => { state.panel = !state.panel; changed('panel'); },
  help: () => $('keys').showModal(),
  dismiss: () => { if (app.recording) app.recording.stopped = true; else say(''); },
  ...pathCommands,
  record: () => pathCommands.record().catch(fail),
};

// Draws fewer pixels while something moves on a slow device, all of them when it stands still.
let frameTimes = [], wasMoving = false;
function adapt(seconds) {
  const moving = isMoving();
  if (moving) {
    frameTimes.push(seconds);
    if (frameTimes.length >= 6) {
      const mean = frameTimes.reduce((a, b) => a + b) / frameTimes.length;
      frameTimes = [];
      if (mean > 0.05) app.share = Math.max(0.3, app.share * Math.max(0.6, Math.sqrt(0.04 / mean)));
      else if (mean < 0.022) app.share = Math.min(1, app.share * 1.15);
    }
  } else if (wasMoving) {
    frameTimes = [];
    app.dirty = true;
  }
  wasMoving = moving;
}

let moveHeld = () => false, lastFrame = 0;
function tick(now) {
  requestAnimationFrame(tick);
  const seconds = Math.min((now - lastFrame) / 1000, 0.25);
  lastFrame = now;
  if (!app.pane.model || app.pane.lost || app.recording) return;
  moveHeld(seconds);
  if (state.playing) advance(seconds);
  advancePath(seconds);
  if (state.resolution === 'auto') adapt(seconds);
  if (!app.dirty) return;
  if (!app.pane.sorter.result) return void app.pane.wantSort(frameView().view, state.time);  // a new model: the last picture stays meanwhile
  app.dirty = false;
  try {
    draw();
    showNumbers(now, psnrNow());
  } catch (error) {
    fail(error);
  }
}

function attach() {
  onShow(attachControls(state, changed));
  attachCrop();
  attachPath();
  attachViews();
  attachRuns();
  attachPictures();
  attachWipe();
  attachKeys(commands);
  moveHeld = attachCamera($('canvas'), free, takeCamera, cameraMoved);
  onChange((name) => {
    if (name !== 'compare' || state.compare === 'off' || state.with || cameraIndex() < 0) return;
    state.playing = false;  // true images are of whole time steps
    setTime(timeOf(frameOf(state.time)));
    showState();
  });
  const click = (id, act) => $(id).addEventListener('click', () => act());
  for (const [id, act] of [['play', 'play'], ['step', 'step'], ['step-back', 'stepBack'], ['save', 'save'], ['link', 'link'], ['help', 'help'], ['toggle', 'panel'],
    ['previous', 'previousCamera'], ['following', 'nextCamera']]) click(id, commands[act]);
  click('uncrop', () => { state.crop = null; changed('crop'); });
  click('command', () => copy(exportCommand(), 'The command is copied.', exportCommand()));
  $('time').addEventListener('input', () => { state.playing = false; app.pathAt = null; setTime(+$('time').value); showState(); });
  $('speed').addEventListener('change', () => { state.speed = +$('speed').value; changed('speed'); });
  new ResizeObserver(() => { app.dirty = true; }).observe($('stage'));
  addEventListener('hashchange', () => {
    Object.assign(state, firstState, stateOfAddress());
    if (state.free) free.fromText(state.free);
    setTime(state.time);
    changed('address');
  });
}

async function start() {
  try {
    app.pane = new Pane($('canvas'));
  } catch (error) {
    setBusy('');
    return fail(error);
  }
  attach();
  if (!app.pane.renderer.hasFloats)
    for (const name of ['depth', 'flow']) {
      const button = document.querySelector(`.chips button[value=${name}]`);
      button.disabled = true;
      button.title = 'This device cannot draw into floating-point textures';
    }
  try {
    app.runs = await findRuns();
    for (const one of app.runs) $('run').append(new Option(one.name, String(one.id)));
    document.querySelector('.run').hidden = !app.runs.length;
    if (app.runs.length) await openRun(app.runs.find((one) => String(one.id) === state.run) ?? app.runs[0]);
    else say('Drop a splat file to see it.');
  } catch (error) {
    fail(error);
  }
  setBusy('');
  requestAnimationFrame(tick);
  follow();
}

// For tests and scripts.
window.gflow = { app, state, capture, setTime, setCamera, commands, openFiles, changed, exportCommand, get renderer() { return app.pane.renderer; },
  get info() { return app.info; }, get model() { return app.pane?.model; }, get sorter() { return app.pane.sorter; } };
start();
