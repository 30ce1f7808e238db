// SPDX-License-Identifier: Apache-2.0
// Arrows along the flow, on a grid over the flow picture.

// Flow at the middle of each square of `size` pixels of the picture drawn last: { size, factor, list of [x, y, u, v] }
// in its pixels. The factor, 1, 2 or 5 times a power of ten, makes long arrows about as long as a square.
export function arrowsOf(renderer, size) {
  const sums = renderer.sampledSums(size), list = [];
  if (!sums) return null;
  const { columns, rows, values } = sums;
  for (let y = 0; y < rows; ++y)
    for (let x = 0; x < columns; ++x) {
      const [u, v, , weight] = values.subarray(4 * (y * columns + x), 4 * (y * columns + x) + 4);
      if (weight > 0.1) list.push([(x + 0.5) * size, (y + 0.5) * size, u / weight, v / weight]);
    }
  const lengths = list.map(([, , u, v]) => Math.hypot(u, v)).filter((n) => n > 0.02).sort((a, b) => a - b);
  if (!lengths.length) return { size, factor: 0, list: [] };
  const wanted = 1.2 * size / lengths[Math.floor(0.95 * (lengths.length - 1))], power = 10 ** Math.floor(Math.log10(wanted));
  const factor = +(power * (wanted >= 5 * power ? 5 : wanted >= 2 * power ? 2 : 1)).toPrecision(1);
  return { size, factor, list };
}

// ratio: pixels of the picture in a CSS pixel.
export function drawArrows(context, { factor, list }, ratio) {
  const path = new Path2D();
  for (const [x, y, flowX, flowY] of list) {
    const u = factor * flowX, v = factor * flowY, length = Math.hypot(u, v), head = Math.min(0.4 * length, 5 * ratio);
    if (length < 2 * ratio) continue;
    const [a, b] = [u / length, v / length], [endX, endY] = [x + u, y + v];
    path.moveTo(x, y);
    path.lineTo(endX, endY);
    path.moveTo(endX - head * (a + 0.6 * b), endY - head * (b - 0.6 * a));
    path.lineTo(endX, endY);
    path.lineTo(endX - head * (a - 0.6 * b), endY - head * (b + 0.6 * a));
  }
  context.lineWidth = 1.3 * ratio;
  context.strokeStyle = 'rgba(16, 20, 28, .82)';
  context.stroke(path);
}
