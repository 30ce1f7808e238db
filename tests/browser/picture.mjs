// SPDX-License-Identifier: Apache-2.0
// PNG images of 8 bits per channel, and how far two pictures are apart.
import { readFileSync } from 'node:fs';
import { inflateSync } from 'node:zlib';

// { width, height, channels, pixels } of an image without interlacing.
export function readPng(path) {
  const file = readFileSync(path), parts = [];
  let width = 0, height = 0, channels = 0;
  for (let at = 8; at < file.length;) {
    const length = file.readUInt32BE(at), type = file.toString('latin1', at + 4, at + 8), data = file.subarray(at + 8, at + 8 + length);
    if (type === 'IHDR') {
      width = data.readUInt32BE(0);
      height = data.readUInt32BE(4);
      channels = { 0: 1, 2: 3, 6: 4 }[data[9]];
      if (data[8] !== 8 || !channels || data[12]) throw new Error(`${path} is a PNG of a kind that the tests do not read`);
    }
    if (type === 'IDAT') parts.push(data);
    at += 12 + length;
  }
  const raw = inflateSync(Buffer.concat(parts)), stride = width * channels, pixels = new Uint8Array(stride * height);
  for (let y = 0; y < height; ++y) {
    const filter = raw[y * (stride + 1)];
    for (let x = 0; x < stride; ++x) {
      const left = x >= channels ? pixels[y * stride + x - channels] : 0, up = y ? pixels[(y - 1) * stride + x] : 0;
      const corner = x >= channels && y ? pixels[(y - 1) * stride + x - channels] : 0, guess = left + up - corner;
      const [a, b, c] = [Math.abs(guess - left), Math.abs(guess - up), Math.abs(guess - corner)];
      const paeth = a <= b && a <= c ? left : b <= c ? up : corner;
      pixels[y * stride + x] = raw[y * (stride + 1) + 1 + x] + [0, left, up, (left + up) >> 1, paeth][filter];
    }
  }
  return { width, height, channels, pixels };
}

// PSNR [dB] of the colours, the largest difference in levels, and the share of pixels more than 12 levels off.
export function compare(rgba, image) {
  let sum = 0, largest = 0, off = 0;
  const n = image.width * image.height;
  for (let i = 0; i < n; ++i) {
    let most = 0;
    for (let k = 0; k < 3; ++k) {
      const difference = Math.abs(rgba[4 * i + k] - image.pixels[image.channels * i + Math.min(k, image.channels - 1)]);
      sum += difference ** 2;
      most = Math.max(most, difference);
    }
    largest = Math.max(largest, most);
    if (most > 12) ++off;
  }
  return { psnr: -10 * Math.log10(sum / (3 * n) / 255 ** 2), largest, share: off / n };
}
