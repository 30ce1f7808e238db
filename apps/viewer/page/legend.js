// SPDX-License-Identifier: Apache-2.0
// What the colours of depth, flow, motion and differences mean.
import { $, app } from './app.js';
import { arrowFactor } from './overlay.js';
import { wheelColors } from './shaders.js';

let painted = '';
export function showLegend({ mode, longestFlow, depthRange, nextTime }, { pixels }) {
  const element = $('legend'), flow = mode === 'flow';
  const difference = app.state.compare === 'difference' && app.isCompared, isLast = !(nextTime > app.state.time);
  element.hidden = !flow && !['depth', 'motion'].includes(mode) && !difference;
  if (element.hidden) return;
  const bar = difference ? 'difference' : mode;
  element.classList.toggle('depth', bar !== 'flow');
  element.firstElementChild.hidden = isLast && ['flow', 'motion'].includes(bar);
  const arrows = app.state.arrows && arrowFactor() ? `; arrows ${arrowFactor()} ×` : '';
  element.lastElementChild.textContent = difference ? 'difference × 4: black is equal'
    : isLast && (flow || mode === 'motion') ? 'This is the last time step: there is no motion after it.'
    : mode === 'motion' ? 'slow … fast; grey does not move' : flow ? `${(longestFlow / pixels).toPrecision(2)} px per step${arrows}`
    : `${depthRange[0].toPrecision(3)} … ${depthRange[1].toPrecision(3)}`;
  if (painted !== bar) paint(element.firstElementChild.getContext('2d'), bar);
  painted = bar;
}

const bars = {  // from left to right
  depth: [[252, 232, 173], [245, 158, 82], [204, 74, 107], [107, 41, 133], [23, 20, 64]], difference: [[0, 0, 0], [255, 255, 255]],
  motion: [[64, 128, 230], [160, 143, 140], [255, 158, 51]],
};

function paint(context, bar) {
  const size = 128, data = context.createImageData(size, size), wheel = wheelColors(), flow = bar === 'flow', stops = bars[bar];
  for (let y = 0; y < size; ++y)
    for (let x = 0; x < size; ++x) {
      const u = (x - 63.5) / 63.5, v = (y - 63.5) / 63.5, o = 4 * (size * y + x);
      const at = flow ? (Math.atan2(-v, -u) / Math.PI + 1) / 2 * 54 : x / (size - 1) * ((stops?.length ?? 2) - 1.001);
      const k = Math.floor(at), f = at - k, r = Math.min(Math.hypot(u, v), 1);
      for (let c = 0; c < 3; ++c)
        data.data[o + c] = flow ? 255 * (1 - r * (1 - ((1 - f) * wheel[3 * k + c] + f * wheel[3 * ((k + 1) % 55) + c])))
          : (1 - f) * stops[k][c] + f * stops[k + 1][c];
      data.data[o + 3] = 255;
    }
  context.putImageData(data, 0, 0);
}
