// SPDX-License-Identifier: Apache-2.0
// Opens runs and files, follows those that train, and opens the run to compare with.
import { $, app, changed, fail, onChange, onShow, showState } from './app.js';
import { drawCharts, fillList, trainingEntries } from './charts.js';
import { Pane } from './pane.js';
import { LocalRun, serverIsGone } from './source.js';
import { readSplatFiles } from './splat_files.js';
import { setTime, steps } from './timeline.js';
import { say, setBusy } from './ui.js';
import { useCameras } from './views.js';

const { state } = app;
const runOf = (id) => app.runs.find((one) => String(one.id) === id);
let awaited = null;  // a training that has no model yet

// The run's info and model in a pane, if that is still wanted when they are there.
async function load(pane, run, wanted = () => true) {
  const info = await run.info();
  if (pane.run !== run) run.tag = null;  // the whole model, not what has changed
  const model = await run.model();
  if (!wanted()) return;
  Object.assign(pane, { run, info: { cameras: [], ...info } });
  pane.setModel(model ?? pane.model);
}

export async function openRun(run) {
  const { pane } = app;
  if (run !== awaited) setBusy('Loading the model …');
  try {
    await load(pane, run);
    app.info = pane.info;
    state.run = String(run.id);
    const { model } = pane;
    app.free.speed = 0.6 * model.size;
    useCameras();
    fillOthers();
    document.title = `${run.name} – gflow view`;
    $('live').hidden = !app.info.live;
    document.querySelector('.transport').hidden = model.motion === 'static' && steps() < 2;
    $('run').value = state.run;
    await readTraining();
    setTime(state.time);
    showState();
    say('');
    awaited = null;
  } catch (error) {
    awaited = error.comesLater ? run : null;
    const shown = pane.model && pane.run !== run ? ` The picture is still of ${pane.run.name}.` : '';
    if (awaited) say(`${error.message} …${shown}`);
    else {
      if (shown) $('run').value = String(pane.run.id);
      fail(Object.assign(error, { message: error.message + shown }));
    }
  }
  setBusy('');
}

async function readTraining() {
  const { run } = app.pane, { info } = app;
  await run.readMetrics().catch(() => false);
  $('training').hidden = !run.lines.length && !info.metrics;
  if ($('training').hidden) return;
  drawCharts($('charts'), run.lines);
  fillList($('results'), trainingEntries(info, run.lines));
}

// The newest model of a pane's run, if it trains; true if there was one.
async function refresh(pane) {
  const { run } = pane;
  if (!run || !pane.info.live) return false;
  const now = await run.state();
  if (now.live === false) Object.assign(pane.info, await run.info());  // the evaluation is there now
  const next = now.model && now.model !== run.tag ? await run.model() : null;
  if (pane.run !== run) return false;
  Object.assign(pane.info, { iteration: now.iteration, live: now.live });
  if (next) pane.setModel(next);
  return true;
}

// Says when the server has ended, and no longer when it answers again.
async function lookForServer() {
  if (!app.runs.some((run) => run.isServed)) return;
  const gone = await serverIsGone();
  $('gone').hidden = !gone;
  $('live').hidden = gone || !app.info.live;
}

// While a training runs and somebody looks: its newest model and curves.
export async function follow() {
  if (document.visibilityState === 'visible' && !app.recording) {
    await lookForServer();
    try {
      if (awaited) await openRun(awaited);
      else if (await refresh(app.pane)) {
        $('live').hidden = !app.info.live;
        await readTraining();
        app.dirty = true;
      }
      if (app.other) await refresh(app.other);
    } catch { /* the next try may succeed */ }
  }
  setTimeout(follow, 1000);
}

export async function openFiles(files) {
  if (!files.length) return;
  setBusy(`Reading ${files[0].name} …`);
  try {
    const read = await readSplatFiles([...files]), local = new LocalRun(read.name, read.model);
    app.runs.push(local);
    $('run').append(new Option(local.name, local.id));
    document.querySelector('.run').hidden = false;
    Object.assign(state, { camera: null, free: null, compare: 'off', crop: null });
    await openRun(local);
    if (read.note) say(read.note, 8);
  } catch (error) {
    fail(error, 10);
  }
  setBusy('');
}

// ---- the run to compare with
function fillOthers() {
  const others = app.runs.filter((run) => run !== app.pane.run), select = $('with');
  if (!others.some((run) => String(run.id) === state.with)) state.with = '';
  select.replaceChildren(new Option(app.groups.length ? 'True image' : 'Nothing', ''), ...others.map((run) => new Option(run.name, String(run.id))));
  select.value = state.with;
  select.parentElement.hidden = !others.length;
  $('compare-section').hidden = !app.groups.length && !others.length;
  openOther();
}
let otherPane = null, opened = '';
async function openOther() {
  if (opened === state.with) return;
  const id = opened = state.with, run = runOf(id);
  app.other = null;
  if (!run) return;
  setBusy(`Loading ${run.name} …`);
  try {
    otherPane ??= new Pane($('other'));
    await load(otherPane, run.given ? run : Object.assign(Object.create(run), { tag: null }), () => opened === id);
    if (opened === id) app.other = otherPane;
  } catch (error) {
    state.with = opened = $('with').value = '';
    fail(error, 8);
  }
  setBusy('');
  changed('with');
}

export function attachRuns() {
  $('run').addEventListener('change', () => openRun(runOf($('run').value)));
  $('with').addEventListener('change', () => {
    state.with = $('with').value;
    if (state.with && state.compare === 'off') state.compare = 'beside';
    changed('compare');
  });
  onShow(() => { $('with').value = state.with; });
  onChange((name) => { if (name) openOther(); });
  $('open').addEventListener('click', () => $('file').click());
  $('file').addEventListener('change', () => openFiles($('file').files));
  addEventListener('dragover', (event) => { event.preventDefault(); document.body.classList.add('dropping'); });
  addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('dropping');
    openFiles(event.dataTransfer.files);
  });
}
