// SPDX-License-Identifier: Apache-2.0
// What the tests of the page share. Usage of each: node NAME_test.mjs FOLDER [PART OF A TEST'S NAME]
// FOLDER is what tests/browser/run makes: runs and render_* of them, files, and the address of gflow view.
// GFLOW: the program. GFLOW_PAGE: folder to take the page's files from, instead of those in the program.
import { readFileSync } from 'node:fs';
import { join, resolve } from 'node:path';
import { Browser } from './browser.mjs';

export const folder = resolve(process.argv[2]), address = readFileSync(join(folder, 'address'), 'utf8').trim();
export const gflow = process.env.GFLOW, files = process.env.GFLOW_PAGE || '', wanted = process.argv[3];
export const browser = await Browser.start();
let passed = 0, failed = 0;

export async function test(name, body) {
  if (wanted && !name.includes(wanted)) return;
  const start = Date.now(), seconds = () => `(${((Date.now() - start) / 1000).toFixed(1)} s)`;
  try {
    const note = await body();
    ++passed;
    console.log(`ok     ${name}${note ? `: ${note}` : ''} ${seconds()}`);
  } catch (error) {
    ++failed;
    console.log(`failed ${name}: ${error.message} ${seconds()}`);
  }
}
export async function finish() {
  await browser.close();
  console.log(`${passed} passed, ${failed} failed`);
  process.exitCode = failed || !passed && !wanted ? 1 : 0;
}
export function expect(condition, message) { if (!condition) throw new Error(message); }
export async function opened(hash = '', options = {}) {
  const page = await browser.page(address + hash, { files, width: 640, height: 480, ...options });
  await page.until('window.gflow?.model && window.gflow.sorter.result');
  return page;
}
export const text = (page, id) => page.run(`document.getElementById('${id}').hidden ? '' : document.getElementById('${id}').textContent`);
// Bytes of a picture, as the page draws it at the size of the camera.
export async function picture(page, options) {
  const { width, height, pixels } = await page.run(`gflow.capture(${JSON.stringify(options)}).then((c) => ({ width: c.width, height: c.height,
    pixels: Array.from({ length: Math.ceil(c.pixels.length / 8192) }, (_, k) => String.fromCharCode(...c.pixels.subarray(8192 * k, 8192 * (k + 1)))).join('') }))`);
  return { width, height, pixels: Buffer.from(pixels, 'latin1') };
}
export async function runNamed(page, name) {
  const id = (await page.run('fetch("/api/runs").then((a) => a.json())')).find((run) => run.name === name)?.id;
  expect(id !== undefined, `there is no run ${name}`);
  return id;
}
