// SPDX-License-Identifier: Apache-2.0
// A training that somebody watches: its models arrive, and it ends with the same bytes as one that nobody watches.
import { spawn } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { browser, expect, files, finish, folder, gflow, test } from './harness.mjs';

await test('a training shows its models and is not changed by it', async () => {
  const steps = readFileSync(join(folder, 'unwatched.steps'), 'utf8').trim(), result = join('point_cloud', `iteration_${steps}`, 'point_cloud.ply');
  const training = spawn(gflow, ['train', process.env.SCENE, '-o', join(folder, 'watched'), '--iterations', steps, '--view', '--port', '0']);
  let said = '';
  for (const stream of [training.stdout, training.stderr]) stream.on('data', (bytes) => { said += bytes; });
  const ended = new Promise((done) => training.on('exit', done));
  for (let i = 0; i < 300 && !/http:\/\/[^\s]+/.test(said); ++i) await new Promise((done) => setTimeout(done, 100));
  const [address] = /http:\/\/[^\s]+/.exec(said) ?? [];
  expect(address, `it names no address: ${said.slice(-300)}`);
  const page = await browser.page(address, { files, width: 320, height: 240 }), counts = [];
  await page.until('window.gflow?.model', 60);
  let models = 0, over = false;
  ended.then(() => { over = true; });
  await page.run('window.seen = new Set([gflow.model]); setInterval(() => seen.add(gflow.model), 50)');
  while (!over) {
    const now = await page.run('[seen.size, gflow.info.iteration]').catch(() => null);
    if (now) { models = now[0]; if (counts.at(-1) !== now[1]) counts.push(now[1]); }
    await new Promise((done) => setTimeout(done, 200));
  }
  expect(await ended === 0, `it ended with ${await ended}: ${said.slice(-300)}`);
  expect(models >= 3, `only ${models} models arrived`);
  expect(readFileSync(join(folder, 'watched', result)).equals(readFileSync(join(folder, 'unwatched', result))), 'the model differs from that of a training without viewer');
  await page.close();
  return `${models} models, steps ${counts.join(' ')}`;
});

await test('the page says when the server has ended, and what it still shows', async () => {
  const names = ['spacetime', 'unwatched'].map((name) => join(folder, name)), server = spawn(gflow, ['view', ...names, '--port', '0']);
  const address = await new Promise((done) => server.stdout.on('data', (bytes) => { const found = /http:\/\/[^\s]+/.exec(bytes); if (found) done(found[0]); }));
  const page = await browser.page(address, { files, width: 640, height: 480 }), shown = (id) => page.run(`!document.getElementById('${id}').hidden && document.getElementById('${id}').textContent`);
  await page.until('window.gflow?.model && gflow.sorter.result', 60);
  await page.until('document.querySelectorAll("#run option").length === 2');
  expect(await shown('gone') === false, 'it says so while the server runs');
  const ended = new Promise((done) => server.on('exit', done));
  server.kill('SIGINT');
  await ended;
  await page.until('!document.getElementById("gone").hidden');
  await page.run('const select = document.getElementById("run"); select.selectedIndex = 1; select.dispatchEvent(new Event("change"))');
  await page.until('document.getElementById("message").textContent.includes("The picture is still of spacetime.")');
  expect(await page.run('document.getElementById("run").selectedIndex') === 0, 'the list names the other run');
  const note = await shown('message');
  await page.close();
  return `"${note}"`;
});

await finish();
