// SPDX-License-Identifier: Apache-2.0
// Videos of what is seen, drawn picture by picture and encoded by the browser.
import { $, app, changed, showState } from './app.js';
import { draw } from './drawing.js';
import { download } from './pictures.js';
import { setTime, steps, wholeSeconds } from './timeline.js';
import { say } from './ui.js';
import { frameView } from './views.js';

const { state } = app, perSecond = 30, mostSeconds = 120;
const kinds = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4;codecs=avc1.42E01E', 'video/mp4'];
const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

// What lies on the stage, as one picture.
function compose(context, paper) {
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
  return paper;
}

// Records one loop of the time at the speed shown, or the camera path, if `path` is { seconds, go(at) }. Without
// either, what is seen until it is stopped. A second call stops it. Returns the video as a Blob.
export async function record(path) {
  if (app.recording) { app.recording.stopped = true; return null; }
  if (typeof MediaRecorder === 'undefined' || !HTMLCanvasElement.prototype.captureStream || !kinds.some((kind) => MediaRecorder.isTypeSupported(kind))) {
    say('This browser cannot record videos (MediaRecorder or captureStream is missing). Firefox, Chromium, Edge and Safari 14.1 or later can.', 8);
    return null;
  }
  const { w, h } = frameView(true), width = w - w % 2, height = h - h % 2, paper = Object.assign(document.createElement('canvas'), { width, height });
  const context = paper.getContext('2d'), stream = paper.captureStream(0), [track] = stream.getVideoTracks();
  const type = kinds.find((kind) => MediaRecorder.isTypeSupported(kind)), parts = [];
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: Math.min(Math.max(0.25 * width * height * perSecond, 4e6), 5e7) });
  recorder.ondataavailable = ({ data }) => parts.push(data);
  const ended = new Promise((done, failed) => { recorder.onstop = done; recorder.onerror = ({ error }) => failed(error ?? new Error('The browser could not encode the video.')); });
  const recording = app.recording = { stopped: false, recorder }, before = { time: state.time, pathAt: app.pathAt };
  const still = !path && steps() < 2, seconds = path ? path.seconds : still ? mostSeconds : wholeSeconds() / state.speed;
  const frames = Math.max(1, Math.min(Math.round(seconds * perSecond), 600 * perSecond));
  state.playing = false;
  showState();
  $('recording').hidden = false;
  recorder.start();
  try {
    for (let k = 0; k < frames && !recording.stopped; ++k) {
      const start = performance.now();
      // The recorder's clock stands still while a picture is drawn, so that a slow device makes the same video.
      if (!still && recorder.state === 'recording') recorder.pause();
      if (path) path.go(path.seconds * k / Math.max(frames - 1, 1));
      else if (!still) setTime(k / frames);
      $('recording').lastElementChild.textContent = still ? `${Math.round(k / perSecond)} s` : `${k + 1} / ${frames}`;
      app.framing = frameView(true);
      await Promise.all([app.pane, app.other].filter((pane) => pane?.model).map((pane) => pane.sortedFor(app.framing.view, state.time)));
      draw(true);
      compose(context, paper);
      if (recorder.state === 'paused') recorder.resume();
      track.requestFrame();
      await pause(still ? Math.max(0, 1000 / perSecond - (performance.now() - start)) : 1000 / perSecond);
    }
  } finally {
    recorder.stop();
    app.recording = null;
    $('recording').hidden = true;
    track.stop();
    if (path) app.pathAt = before.pathAt; else setTime(before.time);
    changed('recording');
  }
  await ended;
  const video = new Blob(parts, { type: type.split(';')[0] });
  download(video, `${app.pane.run.name}.${type.includes('mp4') ? 'mp4' : 'webm'}`);
  say(recording.stopped && !still ? 'The video up to here is saved.' : 'The video is saved.', 3);
  return video;
}
