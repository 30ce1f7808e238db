// SPDX-License-Identifier: Apache-2.0
// What the model is compared with, a true image or another run's model: beside, under or minus the model's picture.
import { $, app, changed } from './app.js';

const stage = $('stage'), handle = $('wipe'), image = $('truth'), other = $('other'), gain = $('gain'), tags = [$('tag-left'), $('tag-right')];
let loading = null, shown = null;  // { address, step } of true images

// Shows an element, the image or the other canvas, over the picture, whose frame on the stage is
// { left, top, width, height } in CSS pixels; `second` is the element's own frame beside it. null: shows nothing.
export function showComparison(element, frame, second, titles) {
  const { compare: kind, wipe: share } = app.state, visible = !!element, place = kind === 'beside' ? second : frame;
  image.hidden = element !== image;
  other.hidden = element !== other;
  handle.hidden = !visible || kind !== 'wipe';
  gain.hidden = !visible || kind !== 'difference';
  stage.classList.toggle('difference', visible && kind === 'difference');
  for (const tag of tags) tag.hidden = !visible || kind === 'difference' && !titles[0].includes('step');
  if (!visible) return;
  for (const side of ['left', 'top', 'width', 'height']) {
    element.style[side] = `${place[side]}px`;
    gain.style[side] = `${frame[side]}px`;
    if (side !== 'width') handle.style[side] = `${side === 'left' ? frame.left + share * frame.width : frame[side]}px`;
  }
  element.style.clipPath = kind === 'wipe' ? `inset(0 ${100 * (1 - share)}% 0 0)` : '';
  handle.setAttribute('aria-valuenow', String(Math.round(100 * share)));
  const beside = kind === 'beside', upright = beside && place.top !== frame.top;
  titles.forEach((title, k) => { tags[k].textContent = title; });
  tags[0].style.left = `${Math.max(place.left, 0) + 8}px`;
  tags[0].style.top = `${Math.max(place.top, 0) + 8}px`;
  tags[1].style.top = `${Math.max(frame.top, 0) + 8}px`;
  tags[1].style.left = beside ? `${frame.left + 8}px` : '';
  tags[1].style.right = beside ? '' : `${stage.clientWidth - frame.left - frame.width + 8}px`;
  for (const tag of tags) tag.style.maxWidth = `${upright ? frame.width - 16 : (beside ? 1 : 0.5) * frame.width - 16}px`;
}

// The element of true images. It goes on showing the last one, whose time step truthStep() is, until the one at this
// address is there: on a slow device, while time goes on, one after the other as they come.
export function truthAt(address, step) {
  if (!loading && shown?.address !== address) {
    loading = { address, step };
    image.src = address;
  }
  return image;
}
export const truthStep = () => shown?.step;

// PSNR [dB] of RGBA pixels against the true image shown; null if there is none of that size, undefined while it loads.
export function psnrOfTruth(pixels, width, height) {
  if (!image.hidden && (loading || !image.complete)) return undefined;
  if (image.hidden || image.naturalWidth !== width || image.naturalHeight !== height) return null;
  const context = Object.assign(document.createElement('canvas'), { width, height }).getContext('2d', { willReadFrequently: true });
  context.drawImage(image, 0, 0);
  const truth = context.getImageData(0, 0, width, height).data;
  let sum = 0;
  for (let i = 0; i < truth.length; ++i) if (i % 4 !== 3) sum += (truth[i] - pixels[i]) ** 2;
  return -10 * Math.log10(sum / (width * height * 3) / 255 ** 2);
}

export function attachWipe() {
  const move = (share) => { app.state.wipe = Math.min(Math.max(share, 0), 1); changed('wipe'); };
  handle.addEventListener('pointerdown', (event) => handle.setPointerCapture(event.pointerId));
  handle.addEventListener('pointermove', (event) => {
    if (!handle.hasPointerCapture(event.pointerId)) return;
    const { left, width } = app.framing.frame;
    move((event.clientX - stage.getBoundingClientRect().left - left) / width);
  });
  handle.addEventListener('keydown', (event) => {
    const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (!by) return;
    event.preventDefault();
    event.stopPropagation();
    move(app.state.wipe + by);
  });
  const end = (done) => { shown = done; loading = null; changed(); };
  image.addEventListener('load', () => end(loading));
  image.addEventListener('error', () => end(loading && { ...loading, step: undefined }));
}
