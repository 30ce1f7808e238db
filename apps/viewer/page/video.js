// SPDX-License-Identifier: Apache-2.0
// Videos of what is seen, drawn picture by picture and encoded by the browser.
import { $, app, changed, showState } from './app.js';
import { draw } from './drawing.js';
import { download } from './pictures.js';
import { setTime, steps, wholeSeconds } from './timeline.js';
import { say } from './ui.js';
import { frameView } from './views.js';
import { videoEncoder } from './webm.js';

const { state } = app, perSecond = 30, mostSeconds = 120;
const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

// What lies on the stage, as one picture.
function compose(context) {
  const { ratio } = app.framing, { compare: kind, wipe: share } = state, place = kind === 'beside' ? app.framing.second : app.framing.frame;
  context.drawImage($('canvas'), 0, 0);
  for (const element of [$('truth'), $('other')]) {
    if (element.hidden) continue;
    const [x, y, w, h] = [place.left, place.top, place.width, place.height].map((n) => n * ratio);
    context.save();
    context.beginPath();
    context.rect(x, y, kind === 'wipe' ? share * w : w, h);
    context.clip();
    if (kind === 'difference') context.globalCompositeOperation = 'difference';
    context.drawImage(element, x, y, w, h);
    context.restore();
  }
  if (!$('overlay').hidden) context.drawImage($('overlay'), 0, 0);
}

// Records one loop of the time at the speed shown, or the camera path, if `path` is { seconds, go(at) }. Without
// either, what is seen until it is stopped. A second call stops it. Returns the video as a Blob.
export async function record(path) {
  if (app.recording) { app.recording.stopped = true; return null; }
  const recording = app.recording = { stopped: false };
  const { w, h } = frameView(true), paper = Object.assign(document.createElement('canvas'), { width: w - w % 2, height: h - h % 2 }), context = paper.getContext('2d');
  const encoder = await videoEncoder(paper, perSecond);
  if (!encoder) {
    app.recording = null;
    say('This browser cannot record videos: it has neither WebCodecs nor MediaRecorder. Firefox, Chromium, Edge and Safari 14.1 or later can.', 8);
    return null;
  }
  const still = !path && steps() < 2, seconds = path ? path.seconds : still ? mostSeconds : Math.min(wholeSeconds() / state.speed, 10 * mostSeconds);
  const frames = Math.max(1, Math.round(seconds * perSecond)), { time } = state, start = performance.now();
  state.playing = false;
  $('recording').hidden = false;
  showState();
  try {
    for (let k = 0; k < frames && !recording.stopped; ++k) {
      if (path) path.go(path.seconds * k / Math.max(frames - 1, 1));
      else if (!still) setTime(k / Math.max(frames - 1, 1));
      $('recording').lastElementChild.textContent = still ? `${Math.round(k / perSecond)} s` : `${k + 1} / ${frames}`;
      app.framing = frameView(true);
      await Promise.all([app.pane, app.other].filter((pane) => pane?.model).map((pane) => pane.sortedFor(app.framing.view, state.time)));
      draw(true);
      compose(context);
      await encoder.add(paper, k / perSecond);
      if (still) await pause(start + 1000 * (k + 1) / perSecond - performance.now());
      else if (k % 8 === 7) await pause(0);  // so that keys and buttons are heard
    }
    const video = await encoder.end();
    download(video, `${app.pane.run.name}.${video.type.slice(6)}`);
    say(recording.stopped && !still ? 'The video up to here is saved.' : 'The video is saved.', 3);
    return video;
  } finally {
    app.recording = null;
    app.pathAt = null;
    $('recording').hidden = true;
    setTime(time);
    changed('recording');
  }
}
