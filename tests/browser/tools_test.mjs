// SPDX-License-Identifier: Apache-2.0
// The page's tools: videos, camera paths, arrows, the filter's box and command, and two models side by side.
import { execFileSync } from 'node:child_process';
import { copyFileSync, mkdirSync, readdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { expect, finish, folder, gflow, opened, runNamed, test, text } from './harness.mjs';

const small = { width: 320, height: 240 }, names = readdirSync(folder).filter((name) => name.startsWith('render_')).map((name) => name.slice(7));
// What a browser reads of the video that an expression gives: [type, bytes, seconds, width, height, name of the file].
const video = (page, expression) => page.run(`(async () => {
  const click = HTMLAnchorElement.prototype.click;
  let name = '';
  HTMLAnchorElement.prototype.click = function () { name = this.download; };
  const blob = await ${expression}, element = document.createElement('video');
  HTMLAnchorElement.prototype.click = click;
  element.muted = true;
  element.src = URL.createObjectURL(blob);
  await new Promise((done, failed) => { element.onloadeddata = done; element.onerror = () => failed(new Error(element.error.message)); });
  return [blob.type, blob.size, element.duration, element.videoWidth, element.videoHeight, name];
})()`);
// Waits until more than so many pixels over the picture are opaque.
const inked = (page, least) => page.until(`${overlay} > ${least}`), overlay = `(() => { const c = document.getElementById('overlay'); if (c.hidden || !c.width) return 0;
  return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.reduce((sum, x, i) => sum + (i % 4 === 3 && x > 60), 0); })()`;

await test('a video of one loop has its length', async () => {
  const page = await opened('#speed=2&panel=0&time=0.25', small), seconds = await page.run('(gflow.app.info.steps - 1) / gflow.app.info.fps / 2');
  const [type, bytes, long, width, height, name] = await video(page, 'gflow.commands.record()');
  expect(type === 'video/webm' && bytes > 2000 && name.endsWith('.webm'), `${name} of type ${type} has ${bytes} bytes`);
  expect(Math.abs(long - seconds) < 0.05, `it takes ${long} s instead of ${seconds} s`);
  expect(width === 320 && height > 100 && height % 2 === 0, `it has ${width} x ${height} pixels`);
  expect(await page.run('gflow.state.time') === 0.25 && await text(page, 'recording') === '', 'the page is not as before');
  expect(!page.errors.length, page.errors[0]);
  await page.close();
  return `${bytes} bytes, ${long.toFixed(2)} s`;
});

await test('a video ends with the key that began it', async () => {
  const page = await opened('#speed=0.1&panel=0', small);
  await page.key('v');
  await page.until('document.getElementById("recording").textContent.includes(" 4 /")');
  await page.key('v');
  await page.until('document.getElementById("message").textContent.includes("saved")');
  await page.close();
});

await test('without encoders it says so', async () => {
  const page = await opened('#panel=0', { ...small, before: 'delete window.VideoEncoder; delete window.MediaRecorder' });
  await page.key('v');
  await page.until('document.getElementById("message").textContent.includes("cannot record videos")');
  await page.close();
});

await test('without WebCodecs MediaRecorder makes the video', async () => {
  const page = await opened('#panel=0&speed=0.25', { ...small, before: 'delete window.VideoEncoder' }), [type, bytes] = await video(page, 'gflow.commands.record()');
  expect(/webm|mp4/.test(type) && bytes > 500, `${bytes} bytes of ${type}`);
  await page.close();
});

await test('a camera path plays, stays in the address, and is a cameras.json for gflow render', async () => {
  const page = await opened('#time=0', small), eye = () => page.run('gflow.app.free.eye');
  await page.key('k');
  await page.run('gflow.setTime(1)');
  await page.drag(150, 80, 60, 10);
  await page.key('k');
  const end = await eye();
  await page.run('gflow.commands.reset(); gflow.setTime(0.3)');
  await page.key('k');
  expect(await page.run('document.querySelectorAll("#path li").length') === 3, 'the list has not three cameras');
  await page.key('g');
  await page.until('gflow.app.pathAt > 0.1');
  const [before, time] = [await eye(), await page.run('gflow.state.time')];
  expect(before.some((x, k) => Math.abs(x - end[k]) > 1e-6) && time > 0, 'the camera or the time stands still');
  await page.key('g');
  await page.until('location.hash.includes(new URLSearchParams({ path: gflow.state.path }))');
  const hash = await page.run('location.hash'), saved = await page.run(`new Promise((done) => {
    const create = URL.createObjectURL; HTMLAnchorElement.prototype.click = () => {};
    URL.createObjectURL = (blob) => { URL.createObjectURL = create; blob.text().then(done); return ''; };
    document.getElementById('path-save').click(); })`);
  const again = await opened(hash, small);
  expect(await again.run('document.querySelectorAll("#path li").length') === 3, 'the address does not keep the path');
  const path = join(folder, 'path'), json = join(path, 'cameras.json');
  mkdirSync(path);
  writeFileSync(json, saved);
  await again.run('document.getElementById("path-clear").click()');
  await again.drop(json, '#path-file');
  await again.until('document.querySelectorAll("#path li").length === 3');
  writeFileSync(join(path, 'bad.json'), '[{"position": [1, 2]}]');
  await again.drop(join(path, 'bad.json'), '#path-file');
  await again.until('document.getElementById("message").textContent.includes("not a camera path")');
  copyFileSync(join(folder, 'file.ply'), join(path, 'file.ply'));
  execFileSync(gflow, ['render', join(path, 'file.ply'), '-o', join(path, 'out'), '--times', '0.5', '--quiet']);
  expect(readdirSync(join(path, 'out', 'rgb')).length === 3, 'gflow render does not draw its three cameras');
  const [, bytes, long] = await video(again, 'gflow.commands.recordPath()'), wanted = await again.run('+[...document.querySelectorAll("#path input")].at(-1).value');
  expect(bytes > 2000 && Math.abs(long - wanted) < 0.1, `its video takes ${long} s instead of ${wanted} s`);
  await page.close();
  await again.close();
});

await test('arrows lie over the flow', async () => {
  const page = await opened('#mode=flow&arrows=1&time=0');
  await page.until('document.getElementById("legend").textContent.includes("arrows")');
  await inked(page, 50);
  const off = await page.run(`(() => {
    const { values, columns, rows } = gflow.renderer.sampledSums(24), { view } = gflow.app.framing;
    const { pane, state } = gflow.app, next = state.time + 1 / (gflow.info.steps - 1), full = gflow.renderer.captureSums(view, state.time * pane.model.duration, pane.own({ mode: 'flow', background: [1, 1, 1], nextTime: next }));
    let most = 0;
    for (let i = 0; i < columns * rows; ++i) {  // the middle lies between four pixels
      const at = [0, 1, 2, 3].map((k) => 4 * ((24 * Math.floor(i / columns) + 11 + (k >> 1)) * view.width + 24 * (i % columns) + 11 + (k & 1)));
      most = Math.max(most, Math.min(...at.map((o) => Math.hypot(...[0, 1, 3].map((c) => full[o + c] - values[4 * i + c])))));
    }
    return most;
  })()`);
  expect(off < 1e-3, `samples are off by ${off}`);
  await page.key('1');
  await page.until('document.getElementById("overlay").hidden');
  await page.close();
});

await test('the box of the filter, and the command that exports what it leaves', async () => {
  const page = await opened(), name = 'spacetime', id = await runNamed(page, name);
  await page.close();
  const cropped = await opened(`#run=${id}&crop=-1,,,1,2,&minOpacity=0.1&maxSize=0.1&panel=1&time=0.5`);
  await cropped.until('gflow.sorter.result.kept < gflow.model.count');
  await inked(cropped, 20);
  const command = await cropped.run('gflow.exportCommand()'), kept = await cropped.run('gflow.sorter.result.kept');
  const pattern = new RegExp(`^gflow export ${join(folder, name)} -o cropped.html --min-opacity 0.1 --max-size [\\d.]+ --crop -1 -1e6 -1e6 1 2 1e6$`);
  expect(pattern.test(command), `the command is "${command}"`);
  const crop = command.slice(command.indexOf('--crop')).split(' ');
  // splatv has all times, as the page.
  const said = execFileSync(gflow, ['export', join(folder, name), '-o', join(folder, 'cropped.splatv'), ...crop], { encoding: 'utf8' });
  const selected = +/selected +(\d+)/.exec(said)?.[1];
  expect(selected === kept, `gflow export leaves ${selected}, the page ${kept} Gaussians`);
  await cropped.run('const s = document.querySelector("#crop input"); s.value = -0.2; s.dispatchEvent(new Event("input"))');
  expect((await cropped.run('gflow.state.crop[0]')) !== -1, 'the slider does not change the box');
  await cropped.run('document.getElementById("uncrop").click()');
  await cropped.until('gflow.sorter.result.kept === gflow.model.count');
  expect(await cropped.run('gflow.state.crop') === null, 'the box stays');
  await cropped.close();
  return command;
});

await test('two runs side by side, with a wipe and their difference', async () => {
  const page = await opened(), [a, b] = [await runNamed(page, names[0]), await runNamed(page, names.at(-1))];
  await page.close();
  const two = await opened(`#run=${a}&with=${b}&compare=beside&panel=0`), shown = '!document.getElementById("other").hidden && gflow.app.other?.sorter.result';
  await two.until(shown);
  const places = () => two.run(`(() => { const r = document.getElementById('other').getBoundingClientRect(); return [r.left, r.right, innerWidth]; })()`);
  const [, right, whole] = await places();
  expect(right <= whole / 2 + 1, 'the other run is not in the left half');
  expect((await text(two, 'tag-left')) === names.at(-1) && (await text(two, 'tag-right')) === names[0], 'the labels are not the names of the runs');
  await two.key('c');
  await two.until('document.getElementById("stage").classList.contains("difference")');
  await two.run('gflow.state.compare = "wipe"; gflow.changed("compare")');
  await two.until('!document.getElementById("wipe").hidden && document.getElementById("other").style.clipPath !== ""');
  await two.drag(150, 150, 30, 10);
  await two.until('location.hash.includes("with=") && location.hash.includes("free=")');
  expect(!two.errors.length, two.errors[0]);
  await two.close();
  const phone = await opened(`#run=${a}&with=${b}&compare=beside&panel=0`, { width: 390, height: 844, touch: true });
  await phone.until(shown);
  expect(await phone.run('document.getElementById("other").getBoundingClientRect().bottom <= innerHeight / 2 + 60'), 'on a phone the other run is not above');
  await phone.close();
});

await finish();
