// SPDX-License-Identifier: Apache-2.0
// Lines over the picture: trails and arrows of what moves, and the box of the filter.
import { $, app } from './app.js';
import { arrowsOf, drawArrows } from './arrows.js';
import { drawBox } from './crop.js';
import { modelTime, steps } from './timeline.js';
import { drawTrails, findTrails } from './trails.js';

const { state } = app, canvas = $('overlay');
let trails = null, arrows = null;
// How many times longer than the flow the arrows last drawn are; 0: there are none.
export const arrowFactor = () => arrows?.factor ?? 0;

export function drawOverlay({ view, left, top, w, h, ratio }, { mode }) {
  const { model } = app.pane, flow = state.arrows && mode === 'flow', box = state.crop && state.panel;
  arrows = flow ? arrowsOf(app.pane.renderer, Math.round(24 * ratio)) : null;
  canvas.hidden = !state.trails && !flow && !box;
  if (canvas.hidden) return;
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext('2d');
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, w, h);
  context.save();
  context.translate(left, top);
  context.beginPath();
  context.rect(0, 0, view.width, view.height);
  context.clip();
  context.lineCap = context.lineJoin = 'round';
  if (state.trails) {
    if (trails?.model !== model) trails = { model, ...findTrails(model, Array.from({ length: steps() }, (_, k) => k / Math.max(steps() - 1, 1))) };
    drawTrails(context, trails, view, modelTime());
  }
  if (arrows) drawArrows(context, arrows, ratio);
  if (box) drawBox(context, view, app.pane.crop(), model, ratio);
  context.restore();
}
