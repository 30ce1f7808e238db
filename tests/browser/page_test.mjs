// SPDX-License-Identifier: Apache-2.0
// The page shows what gflow renders, and survives what may come: any number of Gaussians, damaged files, a lost device.
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { address, browser, expect, files, finish, folder, opened, picture, runNamed, test, text } from './harness.mjs';
import { compare, readPng } from './picture.mjs';

const models = readdirSync(folder).filter((name) => name.startsWith('render_')).map((name) => name.slice(7));
function flowOf(path) {
  const bytes = readFileSync(path);
  return { count: bytes.readInt32LE(4) * bytes.readInt32LE(8), at: (i) => [bytes.readFloatLE(12 + 8 * i), bytes.readFloatLE(16 + 8 * i)] };
}

const renders = readdirSync(folder).filter((name) => /^(render|flow)_/.test(name));
const first = await opened();
const ids = {};
for (const name of renders) ids[name.split('_')[1]] = await runNamed(first, name.split('_')[1]);
await first.close();

for (const render of renders)
  await test(`pictures of ${render.split('_')[1]} are those of gflow render`, async () => {
    const page = await opened(`#run=${ids[render.split('_')[1]]}`), root = join(folder, render);
    const cameras = await page.run('gflow.info.cameras.map(({ name, split, time, step }, index) => ({ name, split, time, step, index }))');
    const views = cameras.filter(({ split }) => split === 'test'), worst = { psnr: Infinity, share: 0, largest: 0, epe: 0 };
    for (const share of [0, 0.5, 0.95]) {
      const { name, time, step, index } = views[Math.floor(share * views.length)], file = `${name}_${String(step).padStart(4, '0')}`;
      const drawn = await picture(page, { camera: index, time, mode: 'color' }), found = compare(drawn.pixels, readPng(join(root, 'rgb', `${file}.png`)));
      worst.psnr = Math.min(worst.psnr, found.psnr);
      worst.share = Math.max(worst.share, found.share);
      worst.largest = Math.max(worst.largest, found.largest);
      if (!readdirSync(join(root, 'flow')).includes(`${file}.flo`)) continue;
      const sums = await page.run(`gflow.capture({ camera: ${index}, time: ${time}, mode: 'flow', sums: true }).then((c) => Array.from(c.pixels, (x) => +x.toPrecision(6)))`);
      const flow = flowOf(join(root, 'flow', `${file}.flo`));
      let sum = 0, count = 0;
      for (let i = 0; i < flow.count; ++i) {
        const [u, v] = flow.at(i), weight = sums[4 * i + 3];
        if (Math.abs(u) > 1e8 || !(weight > 0.004)) continue;
        sum += Math.hypot(sums[4 * i] / weight - u, sums[4 * i + 1] / weight - v);
        ++count;
      }
      worst.epe = Math.max(worst.epe, sum / Math.max(count, 1));
    }
    expect(!page.errors.length, page.errors[0]);
    await page.close();
    const numbers = `PSNR ${worst.psnr.toFixed(1)} dB, largest difference ${worst.largest}, flow ${worst.epe.toExponential(1)} px`;
    expect(worst.psnr >= 42 && worst.share <= 0.005 && worst.epe <= 0.05, numbers);
    return numbers;
  });

await test('time, cameras, modes and the wipe follow keys and the address', async () => {
  const page = await opened('#time=0.5&compare=wipe'), shown = () => page.run('[gflow.state.time, gflow.state.mode, gflow.state.compare, gflow.state.camera]');
  await page.until('document.getElementById("truth").complete && !document.getElementById("truth").hidden && document.getElementById("truth").naturalWidth > 0');
  const [before] = await shown();
  await page.key('ArrowRight');
  const [after] = await shown();
  expect(after > before, `the time went from ${before} to ${after}`);
  await page.key('4');
  expect((await shown())[1] === 'flow', 'the key 4 does not show flow');
  await page.key('1');
  await page.key('c');
  expect((await shown())[2] === 'beside', 'the key c does not change the comparison');
  await page.drag(200, 250, 60, 20);
  expect((await shown())[3] === null, 'dragging does not free the camera');
  await page.until('location.hash.includes("free=")');
  await page.key(' ');
  await page.until(`gflow.state.playing && gflow.state.time !== ${(await shown())[0]}`);
  expect(!page.errors.length, page.errors[0]);
  await page.close();
});

await test('scrubbing changes the picture as rendering does', async () => {
  const page = await opened(), distance = async (time) => {
    await page.run(`gflow.setTime(${time}); gflow.setCamera(gflow.info.cameras.findIndex((c) => c.split === 'test'))`);
    const index = await page.run('+gflow.state.camera'), [a, b] = [await picture(page, {}), await picture(page, { camera: index, time })];
    return a.pixels.compare(b.pixels);
  };
  for (const time of [0, 0.5, 1]) expect(await distance(time) === 0, `at ${time} the picture differs`);
  await page.close();
});

// A 3DGS PLY of n Gaussians in a cube.
function ply(n) {
  const put = { x: 2, y: 2, z: 2, f_dc_0: 3, f_dc_1: 3, f_dc_2: 3, opacity: 4, scale_0: 1, scale_1: 1, scale_2: 1, rot_0: 1, rot_1: 1, rot_2: 1, rot_3: 1 };
  const shift = { opacity: 2, scale_0: -5, scale_1: -5, scale_2: -5 }, names = Object.keys(put);
  const head = `ply\nformat binary_little_endian 1.0\nelement vertex ${n}\n${names.map((name) => `property float ${name}\n`).join('')}end_header\n`;
  const bytes = Buffer.alloc(head.length + 4 * names.length * n);
  bytes.write(head, 'latin1');
  let seed = 1, at = head.length;
  for (let i = 0; i < n; ++i)
    for (const name of names) {
      seed = (seed * 16807) % 2147483647;
      at = bytes.writeFloatLE(put[name] * (seed / 2147483647 - 0.5) + (shift[name] ?? 0), at);
    }
  return bytes;
}
for (const n of [0, 1, 300000])
  await test(`a model of ${n} Gaussians`, async () => {
    const page = await opened('#panel=0', { width: 320, height: 240 }), path = join(folder, `cube_${n}.ply`);
    writeFileSync(path, ply(n));
    const start = Date.now();
    await page.drop(path);
    await page.until(`gflow.model.count === ${n} && gflow.model.motion === 'static' && gflow.sorter.result`);
    const loaded = Date.now() - start, { pixels } = await picture(page, { width: 320, height: 180 });
    const drawn = pixels.some((x, i) => i % 4 < 3 && x < 250);
    expect(drawn === n > 0, n ? 'nothing is drawn' : 'something is drawn');
    const sort = await page.run(`(async () => { const all = []; for (let i = 1; i <= 3; ++i) { await gflow.capture({ width: 64, height: 64, time: i / 10 });
      all.push(gflow.sorter.result.milliseconds); } return all.sort((a, b) => a - b)[1]; })()`);
    const frame = await page.run(`(async () => { const start = performance.now(); await gflow.capture({ width: 320, height: 180, precise: false }); return performance.now() - start; })()`);
    expect(await text(page, 'message') === '', await text(page, 'message'));
    await page.close();
    if (n === 300000) expect(sort < 100, `sorting takes ${sort.toFixed(1)} ms`);
    return `loaded in ${loaded} ms, sorted in ${sort.toFixed(1)} ms, a frame of 320 x 180 takes ${frame.toFixed(0)} ms`;
  });

const dropped = await opened(`#panel=0&run=${ids.spacetime}`, { width: 320, height: 240 });
const scene = await dropped.run('({ up: gflow.model.up, fps: gflow.info.fps })');
for (const name of readdirSync(folder).filter((one) => one.startsWith('file.')))
  await test(`a dropped ${name}`, async () => {
    const page = dropped;
    await page.run('gflow.model.isOld = true; gflow.commands.dismiss()');
    await page.drop(join(folder, name));
    await page.until('!gflow.model.isOld && gflow.sorter.result');
    const { pixels } = await picture(page, { width: 320, height: 240 });
    expect(pixels.some((x, i) => i % 4 < 3 && x < 250), 'nothing is drawn');
    if (/ply|4dgs/.test(name)) {
      const off = Math.hypot(...(await page.run('gflow.app.free.up')).map((x, k) => x - scene.up[k]));
      expect(off < 1e-4, `up is off by ${off}`);
    }
    if (name.endsWith('4dgs')) expect(await page.run('gflow.model.fps') === scene.fps, 'it plays at another rate');
    const damaged = join(folder, `damaged.${name.slice(5)}`), bytes = readFileSync(join(folder, name));
    writeFileSync(damaged, bytes.subarray(0, Math.floor(bytes.length * 0.6) - 7));
    await page.drop(damaged);
    await page.until('/truncated|damaged/.test(document.getElementById("message").textContent)');
    return `then damaged: "${await text(page, 'message')}"`;
  });
await test('files that are none say why', async () => {
  const said = [];
  for (const [name, bytes, why] of [['empty.ply', '', /empty\.ply is empty/], ['notes.txt', 'x'.repeat(64), /no splat file/], ['named.ply', 'x'.repeat(64), /wrong name/],
    ['scene.html', '<!DOCTYPE html>', /open it in the browser/]]) {
    writeFileSync(join(folder, name), bytes);
    await dropped.drop(join(folder, name));
    await dropped.until(`${why}.test(document.getElementById("message").textContent)`);
    said.push(await text(dropped, 'message'));
  }
  return said.join(' ');
});
await dropped.close();

await test('legends say what colours mean, and why flow is missing', async () => {
  const page = await opened(`#run=${ids.spacetime}&mode=flow&time=0.3`), legend = (part) => page.until(`!document.getElementById('legend').hidden && document.getElementById('legend').textContent.includes(${JSON.stringify(part)})`);
  await legend('px per step');
  await page.run('gflow.setTime(1)');
  await legend('This is the last time step');
  await page.run('gflow.setTime(0.3)');
  await page.key('5');
  await legend('grey does not move');
  await page.key('1');
  await page.until('document.getElementById("legend").hidden');
  await page.run('gflow.state.compare = "difference"; gflow.changed("compare")');
  await legend('black is equal');
  await page.close();
});

await test('Space plays after a click on a chip', async () => {
  const page = await opened('#panel=1', { width: 1000 }), { x, y } = await page.run('document.querySelector(".chips button[value=opacity]").getBoundingClientRect().toJSON()');
  await page.mouse('mousePressed', x + 5, y + 5);
  await page.mouse('mouseReleased', x + 5, y + 5);
  await page.until('gflow.state.mode === "opacity"');
  await page.key(' ', 'Space');
  expect(await page.run('gflow.state.playing'), 'it does not play');
  await page.key('Tab');  // with keys a button keeps Space
  await page.run('document.querySelector(".chips button[value=depth]").focus()');
  await page.key(' ', 'Space');
  expect(await page.run('gflow.state.playing && gflow.state.mode === "depth"'), 'Space does not press a button that has the focus');
  await page.close();
});

await test('a true image that is late is called so', async () => {
  const page = await opened(`#run=${ids.spacetime}&time=0&compare=wipe`), tag = (test) => page.until(`${test}.test(document.getElementById('tag-left').textContent)`);
  await tag(/^True image$/);
  await page.run(`(() => { const image = document.getElementById('truth'); window.late = [];
    Object.defineProperty(image, 'src', { set(address) { late.push(() => image.setAttribute('src', address)); } }); })()`);
  await page.run('gflow.setTime(1)');
  await tag(/^True image of step 0$/);
  await page.until('late.length > 0');
  await page.run('late.pop()()');
  await tag(/^True image$/);
  expect(!page.errors.length, page.errors[0]);
  await page.close();
});

await test('a phone opens files, sets the speed, walks, and finds cameras', async () => {
  const before = `const real = fetch; window.fetch = async (...all) => { const answer = await real(...all); if (!/info$/.test(all[0])) return answer;
    const info = await answer.json(), [one] = info.cameras;
    info.cameras = Array.from({ length: 300 }, (_, k) => ({ ...one, name: 'cam' + k, viewmat: one.viewmat.map((x, j) => (j === 3 ? x + k / 100 : x)) }));
    return new Response(JSON.stringify(info)); };`;
  const page = await opened('#panel=1&style=walk', { width: 390, height: 844, touch: true, before });
  for (const id of ['open', 'speed', 'find']) expect(await page.run(`(() => { const r = document.getElementById('${id}').getBoundingClientRect(); return r.width > 20 && r.left >= 0 && r.right <= innerWidth; })()`), `${id} is not there`);
  await page.run('const find = document.getElementById("find"); find.value = "cam29"; find.dispatchEvent(new Event("input")); find.dispatchEvent(new Event("change"))');
  expect(await page.run('document.querySelectorAll("#camera optgroup option").length') === 11, 'the search finds other cameras');
  expect(await page.run('gflow.info.cameras[gflow.state.camera].name') === 'cam29', 'it does not go to the camera found');
  const touch = (type, y) => page.send('Input.dispatchTouchEvent', { type, touchPoints: type === 'touchEnd' ? [] : [{ x: 100, y, id: 1 }, { x: 200, y, id: 2 }] });
  const place = () => page.run('[...gflow.app.free.eye, ...gflow.app.free.axes[2]]');
  await touch('touchStart', 300);
  await touch('touchMove', 290);
  const from = await place();
  await touch('touchMove', 250);
  await touch('touchEnd');
  const to = await place(), ahead = [0, 1, 2].reduce((sum, k) => sum + (to[k] - from[k]) * from[3 + k], 0);
  expect(ahead > 0, `it walks by ${ahead}`);
  await page.close();
});

await test('WebGL lost and restored', async () => {
  const page = await opened(), before = await picture(page, {});
  await page.run('window.loss = gflow.renderer.gl.getExtension("WEBGL_lose_context"); loss.loseContext()');
  await page.until('document.getElementById("message").textContent.includes("lost")');
  await page.run('loss.restoreContext()');
  await page.until('document.getElementById("message").hidden');
  const after = await picture(page, {});
  expect(before.pixels.equals(after.pixels), 'the picture afterwards differs');
  await page.close();
});

await test('without WebGL2 it says so', async () => {
  const page = await browser.page(address, { files, before: 'HTMLCanvasElement.prototype.getContext = () => null' });
  await page.until('document.getElementById("message")?.textContent.includes("WebGL2")');
  await page.close();
});

const exportedPage = async (path) => browser.page(pathToFileURL(path).href, { width: 640, height: 480 });
for (const model of models)
  await test(`the exported page of ${model} opens from disk and draws the same`, async () => {
    const served = await opened(`#run=${ids[model]}`), camera = await served.run('gflow.info.cameras.findIndex((c) => c.split === "test")');
    const truth = await picture(served, { camera, time: 0.3 });
    await served.close();
    const page = await exportedPage(join(folder, `scene_${model}.html`));
    await page.until('window.gflow?.model && window.gflow.sorter.result');
    const { psnr } = compare((await picture(page, { camera, time: 0.3 })).pixels, { ...truth, channels: 4 });
    expect(!page.errors.length, page.errors[0]);
    await page.close();
    expect(psnr > 45, `PSNR ${psnr.toFixed(1)} dB`);
    return `PSNR ${psnr.toFixed(1)} dB`;
  });

await test('a truncated or changed exported page says so', async () => {
  const whole = readFileSync(join(folder, `scene_${models[0]}.html`), 'latin1'), path = join(folder, 'damaged.html'), said = [];
  const middle = (id) => { const at = whole.indexOf(`id="${id}"`); return Math.floor((at + whole.indexOf('</script>', at)) / 2); };
  const changed = (id, by) => { const at = middle(id); return whole.slice(0, at) + by(whole[at]) + whole.slice(at + 1); }, other = (c) => (c === 'A' ? 'B' : 'A');
  for (const text of [whole.slice(0, middle('gflow-model')), whole.slice(0, middle('gflow-scripts')), whole.slice(0, whole.indexOf('<style>') + 99),
    ...['gflow-model', 'gflow-scripts', 'gflow-info'].map((id) => changed(id, other)), changed('gflow-model', () => '%')]) {
    writeFileSync(path, text, 'latin1');
    const page = await exportedPage(path);
    await page.until('/truncated|damaged/.test(document.body?.innerText)');
    said.push(await page.run('document.body.innerText.match(/This file[^.]*/)[0]'));
    expect(await page.run('document.getElementById("busy")?.hidden !== false'), 'it goes on loading');
    await page.close();
  }
  return [...new Set(said)].join('; ');
});

await finish();
