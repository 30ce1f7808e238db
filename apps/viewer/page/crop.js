// SPDX-License-Identifier: Apache-2.0
// The filter's box: two sliders per axis, its edges in the view, and the command that exports what the filter shows.
import { $, app, changed, onShow } from './app.js';

const { state } = app, reach = 2.5, fields = [];
const placeOf = (k) => { const { model } = app.pane; return (model.origin?.[k] ?? 0) + model.centre[k]; };
const numberText = (x) => String(+x.toPrecision(6));

// Sliders from -1 to 1, `reach` times the model's size to each side of its centre; their ends leave a side open.
export function attachCrop() {
  ['X', 'Y', 'Z'].forEach((axis, k) => {
    const field = document.createElement('div');
    field.className = 'field';
    field.innerHTML = `<span>Box ${axis}</span><span class="double"><input type="range" min="-1" max="1" step="0.005" aria-label="Box: least ${axis}"><input type="range" min="-1" max="1" step="0.005" aria-label="Box: greatest ${axis}"></span><output></output>`;
    $('crop').append(field);
    const [low, high] = field.querySelectorAll('input'), output = field.querySelector('output');
    const put = () => {
      const box = state.crop ?? [-Infinity, -Infinity, -Infinity, Infinity, Infinity, Infinity];
      const at = (slider) => placeOf(k) + slider.value * reach * app.pane.model.size;
      box[k] = +low.value <= -1 ? -Infinity : at(low);
      box[3 + k] = +high.value >= 1 ? Infinity : at(high);
      state.crop = box.some(Number.isFinite) ? [...box] : null;
      changed('crop');
    };
    low.addEventListener('input', () => { if (+low.value > +high.value - 0.02) low.value = +high.value - 0.02; put(); });
    high.addEventListener('input', () => { if (+high.value < +low.value + 0.02) high.value = +low.value + 0.02; put(); });
    fields.push({ low, high, output, double: low.parentElement });
  });
  onShow(() => {
    if (!app.pane?.model) return;
    fields.forEach(({ low, high, output, double }, k) => {
      const sides = [state.crop?.[k] ?? -Infinity, state.crop?.[3 + k] ?? Infinity];
      [low, high].forEach((slider, side) => {
        const at = Number.isFinite(sides[side]) ? (sides[side] - placeOf(k)) / reach / app.pane.model.size : side ? 1 : -1;
        if (document.activeElement !== slider) slider.value = at;
        slider.setAttribute('aria-valuetext', Number.isFinite(sides[side]) ? sides[side].toPrecision(3) : 'open');
      });
      double.style.setProperty('--from', `${50 * (1 + +low.value)}%`);
      double.style.setProperty('--to', `${50 * (1 + +high.value)}%`);
      output.value = sides.some(Number.isFinite) ? sides.map((x) => (Number.isFinite(x) ? x.toPrecision(2) : '')).join(' … ').trim() : 'all';
    });
    $('uncrop').hidden = !state.crop;
  });
}

// The edges of a box { low, high }; open sides are far away.
export function drawBox(context, { rotation: r, translation: t, fx, fy, cx, cy, near }, { low, high }, { centre, size }, ratio) {
  const corner = (bits) => [0, 1, 2].map((k) => ((bits >> k) & 1 ? Math.min(high[k], centre[k] + 4 * size) : Math.max(low[k], centre[k] - 4 * size)));
  const inCamera = (p) => [0, 1, 2].map((k) => r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2] + t[k]);
  const path = new Path2D();
  for (let from = 0; from < 8; ++from)
    for (let k = 0; k < 3; ++k) {
      if ((from >> k) & 1) continue;
      let a = inCamera(corner(from)), b = inCamera(corner(from | 1 << k));
      if (a[2] < b[2]) [a, b] = [b, a];
      if (a[2] <= near) continue;
      if (b[2] < near) { const f = (a[2] - near) / (a[2] - b[2]); b = a.map((x, i) => x + f * (b[i] - x)); }
      path.moveTo(cx + fx * a[0] / a[2], cy + fy * a[1] / a[2]);
      path.lineTo(cx + fx * b[0] / b[2], cy + fy * b[1] / b[2]);
    }
  for (const [width, color] of [[3, 'rgba(10, 12, 16, .35)'], [1.2, 'rgba(124, 196, 255, .9)']]) {
    context.lineWidth = width * ratio;
    context.strokeStyle = color;
    context.stroke(path);
  }
}

// The command that writes what the filter shows, of all times; sizes in scene units, the box in the world.
export function exportCommand() {
  const { run, model } = app.pane, name = run.path ?? run.name, quoted = /^[\w./-]+$/.test(name) ? name : `'${name.replaceAll("'", "'\\''")}'`;
  const words = ['gflow export', quoted, `-o cropped.${model.motion === 'static' ? 'ply' : 'html'}`];
  if (state.minOpacity > 0) words.push(`--min-opacity ${numberText(state.minOpacity)}`);
  if (state.maxSize !== null) words.push(`--max-size ${numberText(state.maxSize * model.size)}`);
  if (state.crop) words.push(`--crop ${state.crop.map((x) => (Number.isFinite(x) ? numberText(x) : x < 0 ? '-1e6' : '1e6')).join(' ')}`);
  return words.join(' ');
}
