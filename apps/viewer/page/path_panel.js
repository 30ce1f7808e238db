// SPDX-License-Identifier: Apache-2.0
// The camera path in the panel: its keys, playing, files, and videos along it.
import { $, app, changed, fail, onShow, showState } from './app.js';
import { inOrder, jsonOfPath, keyOf, pathOfJson, pathOfText, placeOnPath, secondsOf, textOfPath } from './path.js';
import { download } from './pictures.js';
import { setTime, wholeSeconds } from './timeline.js';
import { say } from './ui.js';
import { record } from './video.js';
import { cameraMoved, cameraNow } from './views.js';

const { state, free } = app, mostInAddress = 8;
let keys = pathOfText(state.path), listed = '';

function go(at) {
  app.pathAt = at;
  const time = placeOnPath(keys, at, free);
  cameraMoved();
  setTime(time);
}
function keep() {
  state.path = keys.length <= mostInAddress ? textOfPath(keys) : '';
  app.pathAt = null;
  listed = '';
  changed('path');
}

export const pathCommands = {
  // After the last key by as long as the scene takes from time to time at the speed shown, or by two seconds.
  addCamera: () => {
    const last = keys.at(-1), seconds = last && Math.abs(state.time - last.time) * wholeSeconds() / state.speed;
    keys = inOrder([...keys, keyOf(cameraNow(), last ? last.at + (seconds >= 0.5 ? seconds : 2) : 0, state.time)]);
    keep();
    say(`Camera ${keys.length} added to the path.`, 1.5);
  },
  playPath: () => {
    if (keys.length < 2) return say('A path needs two cameras: add them where it begins and ends.', 4);
    state.playing = false;
    app.pathAt = app.pathAt === null ? 0 : null;
    changed('playing');
  },
  record: () => record(),
  recordPath: () => {
    if (app.recording) return record();
    if (keys.length < 2) return say('A path needs two cameras: add them where it begins and ends.', 4);
    return record({ seconds: secondsOf(keys), go });
  },
};

// A step of playing; true if the camera moved.
export function advancePath(seconds) {
  if (app.pathAt === null || keys.length < 2) return false;
  let at = app.pathAt + seconds;
  const all = secondsOf(keys);
  if (at > all) {
    if (state.loop) at %= all;
    else { go(all); app.pathAt = null; showState(); return true; }
  }
  go(at);
  return true;
}

const place = () => ({ width: app.framing?.view.width ?? 1280, height: app.framing?.view.height ?? 720, origin: app.pane.model.origin ?? [0, 0, 0], near: app.pane.model.near,
  distance: app.pane.sorter.result?.middle || app.pane.model.size });

function list() {
  if (listed === state.path && $('path').children.length === keys.length) return;
  listed = state.path;
  $('path').replaceChildren(...keys.map((key, i) => {
    const item = document.createElement('li');
    item.innerHTML = '<button class="plain-button"></button><label><input type="number" min="0" max="3600" step="0.1"> s</label><button class="icon"><svg aria-hidden="true"><use href="#i-remove"/></svg></button>';
    const [show, , remove] = item.children, input = item.querySelector('input');
    show.textContent = `Camera ${i + 1}, time ${+key.time.toFixed(2)}`;
    show.title = 'Show this camera';
    show.addEventListener('click', () => { go(key.at); app.pathAt = null; });
    input.value = +key.at.toFixed(1);
    input.setAttribute('aria-label', `Second of camera ${i + 1} in the video`);
    input.disabled = i === 0;
    input.addEventListener('change', () => { if (input.value !== '' && +input.value >= 0) key.at = +input.value; keys = inOrder(keys); keep(); });
    remove.setAttribute('aria-label', `Remove camera ${i + 1}`);
    remove.title = 'Remove';
    remove.addEventListener('click', () => { keys = inOrder(keys.filter((one) => one !== key)); keep(); });
    return item;
  }));
}

export function attachPath() {
  const click = (id, act) => $(id).addEventListener('click', act);
  click('path-add', pathCommands.addCamera);
  click('path-play', pathCommands.playPath);
  click('path-record', () => Promise.resolve(pathCommands.recordPath()).catch(fail));
  click('record', () => pathCommands.record().catch(fail));
  click('path-clear', () => { keys = []; keep(); });
  click('path-save', () => download(new Blob([jsonOfPath(keys, place())], { type: 'application/json' }), 'camera_path.json'));
  click('path-load', () => $('path-file').click());
  $('path-file').addEventListener('change', async () => {
    const [file] = $('path-file').files;
    try {
      if (file) keys = pathOfJson(await file.text(), place());
      keep();
    } catch (error) {
      fail(error, 10);
    }
    $('path-file').value = '';
  });
  addEventListener('hashchange', () => { keys = pathOfText(state.path); listed = ''; });
  onShow(() => {
    list();
    for (const id of ['path-clear', 'path-save']) $(id).hidden = !keys.length;
    for (const id of ['path-play', 'path-record', 'path-note']) $(id).hidden = keys.length < 2;
    $('path-play').textContent = app.pathAt === null ? 'Play' : 'Stop';
    for (const [id, text] of [['record', 'Record video'], ['path-record', 'Record path']]) $(id).textContent = app.recording ? 'Stop' : text;
  });
}
