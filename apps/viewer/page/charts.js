// SPDX-License-Identifier: Apache-2.0
// Curves of a training and tables of its metrics.

const curves = [
  ['loss', 'Loss', (x) => x.toPrecision(3), true], ['psnr', 'PSNR of the training images', (x) => `${x.toFixed(2)} dB`, false],
  ['flow_epe', 'Flow error, all pixels', (x) => `${x.toPrecision(3)} px`, true], ['num_gaussians', 'Gaussians', (x) => Math.round(x).toLocaleString('en'), false],
];

export function drawCharts(element, lines) {
  element.replaceChildren();
  for (const [key, name, text, logarithmic] of curves) {
    const points = lines.filter((line) => Number.isFinite(line[key])).map((line) => [line.iteration, line[key]]);
    if (!points.length) continue;
    const chart = document.createElement('div'), head = document.createElement('div'), canvas = document.createElement('canvas');
    chart.className = 'chart';
    head.innerHTML = '<span></span><b></b>';
    head.firstChild.textContent = name;
    head.lastChild.textContent = text(points.at(-1)[1]);
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('aria-label', `${name}: ${text(points[0][1])} at first, now ${text(points.at(-1)[1])}`);
    chart.append(head, canvas);
    element.append(chart);
    drawCurve(canvas, points, logarithmic);
  }
}

function drawCurve(canvas, points, logarithmic) {
  const ratio = devicePixelRatio || 1, width = canvas.width = Math.max(1, canvas.clientWidth * ratio), height = canvas.height = 54 * ratio;
  const context = canvas.getContext('2d'), style = getComputedStyle(canvas);
  const value = logarithmic && points.every(([, y]) => y > 0) ? Math.log : (y) => y;
  const ys = points.map(([, y]) => value(y)), last = Math.max(points.at(-1)[0], 1);
  const low = Math.min(...ys), span = Math.max(...ys) - low || 1, pad = 3 * ratio;
  const place = ([x], i) => [pad + (x / last) * (width - 2 * pad), height - pad - ((ys[i] - low) / span) * (height - 2 * pad)];
  context.lineWidth = 1.5 * ratio;
  context.lineJoin = 'round';
  context.strokeStyle = context.fillStyle = style.getPropertyValue('--accent');
  context.beginPath();
  points.forEach((point, i) => context.lineTo(...place(point, i)));
  context.stroke();
  if (points.length === 1) context.fillRect(...place(points[0], 0).map((x) => x - 2 * ratio), 4 * ratio, 4 * ratio);
  const fill = context.createLinearGradient(0, 0, 0, height);
  fill.addColorStop(0, 'rgba(124, 196, 255, .22)');
  fill.addColorStop(1, 'rgba(124, 196, 255, 0)');
  context.lineTo(place(points.at(-1), points.length - 1)[0], height);
  context.lineTo(pad, height);
  context.fillStyle = fill;
  context.fill();
}

// Fills a list of terms with [term, value]; values of undefined or null are left out.
export function fillList(element, entries) {
  const wanted = entries.filter(([, value]) => value !== undefined && value !== null);
  while (element.children.length > 2 * wanted.length) element.lastChild.remove();
  while (element.children.length < 2 * wanted.length) element.append(document.createElement(element.children.length % 2 ? 'dd' : 'dt'));
  wanted.forEach(([term, value], i) => {
    if (element.children[2 * i].textContent !== term) element.children[2 * i].textContent = term;
    if (element.children[2 * i + 1].textContent !== value) element.children[2 * i + 1].textContent = value;
  });
}

export function trainingEntries(info, lines) {
  const last = lines.at(-1), test = info.metrics?.test, fixed = (x, digits) => (Number.isFinite(x) ? x.toFixed(digits) : undefined);
  const done = last ? last.iteration + 1 : info.iteration;
  const rate = last && last.seconds > 0 ? last.iteration / last.seconds : undefined;
  const left = info.live && rate && info.iterations > done ? (info.iterations - done) / rate : undefined;
  const withUnit = (text, unit) => text && `${text} ${unit}`;
  return [
    ['Steps', info.iterations ? `${done ?? 0} of ${info.iterations}` : done && String(done)],
    ['Rate', rate && `${rate.toPrecision(3)} steps/s`],
    ['Time left', left && (left > 90 ? `${Math.round(left / 60)} min` : `${Math.round(left)} s`)],
    ['Test PSNR', withUnit(fixed(test?.psnr, 2), 'dB')], ['where it moves', withUnit(fixed(test?.psnr_dynamic, 2), 'dB')],
    ['Test SSIM', fixed(test?.ssim, 4)], ['Test flow error, all pixels', withUnit(fixed(test?.flow_epe, 3), 'px')],
    ['where it moves ', withUnit(fixed(test?.flow_epe_dynamic, 3), 'px')],
  ];
}
