// SPDX-License-Identifier: Apache-2.0
// Pictures as pixels and files, and their PSNR against the true image.
import { app, onChange } from './app.js';
import { viewOfCamera } from './camera.js';
import { psnrOfTruth } from './compare.js';
import { look } from './drawing.js';
import { cameraIndex } from './groups.js';
import { frameOf } from './timeline.js';

const { state } = app;

// The picture of a camera of the scene, or of the free one, at its own size.
export async function capture({ camera = cameraIndex(), time = state.time, width, height, mode = state.mode, sums = false, precise = true, ...more } = {}) {
  const { pane } = app, wide = width ?? pane.canvas.width, high = height ?? pane.canvas.height;
  const view = camera >= 0 ? viewOfCamera(app.info.cameras[camera], pane.model.near) : app.free.view(wide, high, pane.model.near);
  await pane.sortedFor(view, time);
  const options = pane.own({ ...look(time), mode, ...more }), at = time * pane.model.duration;
  const pixels = sums ? pane.renderer.captureSums(view, at, options) : pane.renderer.capture(view, at, options, precise);
  app.dirty = true;
  return { width: view.width, height: view.height, pixels };
}

// Gives a Blob to whoever looks, as a file.
export function download(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name.replace(/[^\w.-]+/g, '_');
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

export async function savePicture() {
  const { width, height, pixels } = await capture(), paper = Object.assign(document.createElement('canvas'), { width, height });
  paper.getContext('2d').putImageData(new ImageData(pixels, width, height), 0, 0);
  download(await new Promise((done) => paper.toBlob(done)), `${app.pane.run.name}_${String(frameOf(state.time)).padStart(4, '0')}_${state.mode}.png`);
}

// PSNR [dB] of the picture shown, measured when nothing has changed for a while.
let psnr = null, timer = 0;
export const psnrNow = () => psnr;
async function measure() {
  const camera = cameraIndex();
  if (state.playing || app.recording || camera < 0 || state.mode !== 'color') return;
  if (Math.abs((app.info.cameras[camera].time ?? state.time) - state.time) > 1e-4) return;  // the image is of another time
  const { width, height, pixels } = await capture({ camera });
  psnr = psnrOfTruth(pixels, width, height);
  if (psnr === undefined) timer = setTimeout(measure, 300);
}
export function attachPictures() {
  onChange(() => {
    psnr = null;
    clearTimeout(timer);
    if (state.compare !== 'off' && !state.with && cameraIndex() >= 0) timer = setTimeout(measure, 500);
  });
}
