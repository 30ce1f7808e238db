// SPDX-License-Identifier: Apache-2.0
// Draws what the state says: the picture, what it is compared with, and what lies over it.
import { $, app } from './app.js';
import { fillList } from './charts.js';
import { showComparison, truthAt, truthStep } from './compare.js';
import { groupOf, pathOf } from './groups.js';
import { showLegend } from './legend.js';
import { drawOverlay } from './overlay.js';
import { nextTimeOf, stepAt } from './timeline.js';
import { frameView, isMoving } from './views.js';

const { state } = app, canvas = $('canvas'), margin = [15 / 255, 17 / 255, 21 / 255];
let shownAt = 0;

// What the renderer is to show; lengths of flow are for the picture that framing describes.
export function look(time = state.time) {
  const { model, sorter } = app.pane, { framing } = app, { result } = sorter, longest = state.longestFlow ?? 0.04 * (framing?.view.height ?? 500);
  return {
    mode: state.mode, show: state.show, minOpacity: state.minOpacity, maxSize: state.maxSize,
    background: { scene: model?.background ?? [1, 1, 1], black: [0, 0, 0], grey: [0.5, 0.5, 0.5], white: [1, 1, 1] }[state.background],
    depthRange: result?.count ? [result.near, result.far] : [0, 1], longestFlow: longest * (state.longestFlow ? framing?.pixels ?? 1 : 1),
    pointRadius: 1.6 * (framing?.ratio ?? 1), nextTime: nextTimeOf(time),
  };
}

function resize(element, width, height) {
  if (element.width !== width || element.height !== height) Object.assign(element, { width, height });
}

// full: at full resolution, whatever the state says.
export function draw(full = false) {
  const framing = app.framing = frameView(full), { view, left, top, w, h, index } = framing, { pane, other } = app;
  resize(canvas, w, h);
  const shown = look();
  pane.draw(view, state.time, shown, left, top, margin);
  const camera = app.info.cameras[index], comparing = state.compare !== 'off';
  if (state.with) {
    const drawn = comparing && other?.ready;
    if (drawn) {
      resize(other.canvas, view.width, view.height);
      other.draw(view, state.time, shown, 0, 0, margin);
    } else if (comparing && other?.model) other.wantSort(view, state.time);
    app.isCompared = !!drawn;
    showComparison(drawn ? other.canvas : null, framing.frame, framing.second, [other?.run?.name ?? '', pane.run.name]);
  } else {
    const address = comparing && camera && camera.image !== false ? pane.run.imageAddress(index) : '';
    const image = address ? truthAt(address, stepAt(camera.time)) : null, step = truthStep() ?? stepAt(camera?.time ?? 0);
    const late = Math.abs(step - stepAt(state.time)) < 0.01 ? '' : ` of step ${Math.round(step)}`;
    app.isCompared = !!image;
    showComparison(image, framing.frame, framing.second, [`True image${late}`, 'Model']);
  }
  drawOverlay(framing, shown);
}

// Numbers of the last picture; not in every frame while something moves.
export function showNumbers(now, psnr) {
  if (now - shownAt < 200 && isMoving()) return;
  shownAt = now;
  const { run, model, sorter: { result } } = app.pane, { info, framing } = app, { view, index } = framing, motion = info.motion || model.model || model.motion;
  canvas.setAttribute('aria-label', `${run.name} at time ${state.time.toFixed(3)}${{ color: '' }[state.mode] ?? `, ${state.mode}`}`);
  fillList($('statistics'), [
    ['Gaussians', model.count.toLocaleString('en')], ['inside of the box', state.crop && result?.kept.toLocaleString('en')], ['in this view and time', result?.count.toLocaleString('en')],
    ['that may move', model.motion === 'static' ? '0' : model.moving.toLocaleString('en')], ['Motion model', motion],
    ['Colour degree', String(model.sh_degree)], ['Picture', `${view.width} × ${view.height}`],
    ['Sorting', result && `${result.milliseconds.toFixed(1)} ms`], ['PSNR of this view', psnr && `${psnr.toFixed(2)} dB`],
  ]);
  showLegend(look(), framing);
  $('summary').textContent = [`${model.count.toLocaleString('en')} Gaussians`, motion, info.iteration ? `step ${info.iteration.toLocaleString('en')}` : ''].filter(Boolean).join(' · ');
  $('follow').hidden = !(index >= 0 && groupOf(index)?.members.length === 1 && pathOf(index).members.length > 1);
  const missing = !info.cameras.length ? 'Files have no true images.' : index < 0 ? 'Choose a camera of the scene to see its true image.' : '';
  $('compare-note').textContent = state.with ? '' : missing;
  const stops = model.stop === 'exclude' ? ['The run leaves out the Gaussian that saturates a pixel (stop: exclude); this page draws it, which changes colours by at most 1 %.'] : [];
  $('notices').textContent = [...(info.notices ?? []), ...stops].join(' ');
}
