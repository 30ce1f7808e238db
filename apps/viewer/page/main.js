// SPDX-License-Identifier: Apache-2.0
// The page: loads runs, keeps the time, and draws when something has changed.
import { attachCamera, dot3, FreeCamera, viewOfCamera } from './camera.js';
import { drawCharts, fillList, trainingEntries } from './charts.js';
import { groupCameras, memberAt, TruthOverlay } from './compare.js';
import { motionOf } from './packing.js';
import { Renderer } from './renderer.js';
import { wheelColors } from './shaders.js';
import { findRuns, LocalRun, makeSorter } from './source.js';
import { readSplatFiles } from './splat_files.js';
import { drawTrails, findTrails } from './trails.js';
import { addressOf, attachControls, attachKeys, firstState, say, setBusy, setPart, stateOfAddress } from './ui.js';

const $ = (id) => document.getElementById(id);
const state = stateOfAddress(), canvas = $('canvas'), stage = $('stage'), free = new FreeCamera();
const truth = new TruthOverlay(stage);
let trails = null;
let renderer, runs = [], run = null, info = { cameras: [] }, model = null, groups = [], showState = () => {}, moveHeld = () => false;
let dirty = true, lastFrame = 0, movedAt = -1e9, share = 1, frameTimes = [], addressTimer = 0, framing = null, psnrTimer = 0;

// ---- sorting: one request at a time; the latest wish waits
const sorter = { worker: null, busy: false, wanted: null, done: null, shown: '', buffer: null, result: null, waiting: [] };
function setSortedModel() {
  sorter.worker?.terminate();
  sorter.worker = makeSorter();
  Object.assign(sorter, { busy: false, wanted: null, shown: '', buffer: null, result: null });
  sorter.worker.onmessage = ({ data }) => {
    sorter.busy = false;
    sorter.result = data;
    sorter.shown = data.id;
    renderer.setOrder(data.order, data.count);
    sorter.buffer = data.order.buffer;
    dirty = true;
    for (const wake of sorter.waiting.splice(0)) wake();
    if (sorter.wanted) sendSort();
  };
  sorter.worker.onerror = (event) => fail(new Error(`The sorter failed: ${event.message}`));
  model.sorted = motionOf(model);
  sorter.worker.postMessage({ motion: model.sorted });
}
function sendSort() {
  const { wanted } = sorter, buffer = sorter.buffer;
  sorter.wanted = null;
  sorter.busy = true;
  sorter.buffer = null;
  sorter.worker.postMessage({ ...wanted, buffer }, buffer ? [buffer] : []);
}
function wantSort(view, time) {
  const row = view.rotation.slice(6), offset = view.translation[2];
  const id = [time, ...row, offset, view.near].join();
  if (id === sorter.shown && !sorter.wanted || id === sorter.wanted?.id) return id;
  sorter.wanted = { id, time, row, offset, near: view.near };
  if (!sorter.busy) sendSort();
  return id;
}
// Waits until the order is exactly that of a view.
async function sortedFor(view, time) {
  const id = wantSort(view, time);
  while (sorter.shown !== id) {
    if (!sorter.busy && !sorter.wanted) wantSort(view, time);
    await new Promise((wake) => sorter.waiting.push(wake));
  }
}

// ---- what is drawn
const steps = () => Math.max(info.steps || model?.steps || 1, 1);
const modelTime = (time = state.time) => time * (model?.duration ?? 1);
const timeOf = (frame) => {
  const at = Math.min(Math.max(frame, 0), steps() - 1);
  return info.times?.length === steps() ? info.times[at] : at / Math.max(steps() - 1, 1);
};
// The time step at a time, with a fraction between two.
function stepAt(time) {
  const last = steps() - 1, { times } = info;
  if (times?.length !== last + 1 || last < 1) return time * last;
  let k = 0;
  while (k < last - 1 && times[k + 1] <= time) ++k;
  return Math.min(Math.max(k + (time - times[k]) / (times[k + 1] - times[k] || 1), 0), last);
}
const frameOf = (time) => Math.round(stepAt(time));
const cameraIndex = () => (state.camera === null || !info.cameras.length ? -1 : Math.min(Math.max(+state.camera || 0, 0), info.cameras.length - 1));
const groupOf = (index) => groups.find((group) => group.members.includes(index));

// The places of a camera that moves: their names differ in the last number, and each has its own time.
function pathOf(index) {
  const stem = (camera) => `${camera.split} ${String(camera.name).replace(/\d+(\.\w+)?$/, '')}`, own = stem(info.cameras[index]);
  const members = info.cameras.flatMap((camera, k) => (stem(camera) === own ? [k] : []));
  return { members: new Set(members.map((k) => info.cameras[k].time)).size === members.length ? members : [index] };
}

function backgroundColor() {
  return { scene: model?.background ?? [1, 1, 1], black: [0, 0, 0], grey: [0.5, 0.5, 0.5], white: [1, 1, 1] }[state.background];
}
function look() {
  const { crop } = state, o = model?.centre ?? [0, 0, 0], e = (crop ?? 1) * (model?.size ?? 1), result = sorter.result;
  const longest = state.longestFlow ?? 0.04 * (framing?.view.height ?? 500);
  return {
    mode: state.mode, show: state.show, background: backgroundColor(), minOpacity: state.minOpacity, maxSize: state.maxSize,
    crop: crop === null ? null : { low: o.map((x) => x - e), high: o.map((x) => x + e) },
    depthRange: result?.count ? [result.near, result.far] : [0, 1], longestFlow: longest * (state.longestFlow ? framing?.pixels ?? 1 : 1),
    pointRadius: 1.6 * (framing?.ratio ?? 1), nextTime: nextTimeOf(state.time),
  };
}

// One time step later, in model time: where flow leads.
function nextTimeOf(time) {
  const at = stepAt(time), whole = Math.floor(at + 1e-4), step = whole + 1 < steps() ? timeOf(whole + 1) - timeOf(whole) : timeOf(whole) - timeOf(whole - 1);
  return Math.min(modelTime(time + step), modelTime(1));
}

// The view and its place on the canvas, whose size is that of the stage times the ratio.
function frameView() {
  const width = stage.clientWidth || 1, height = stage.clientHeight || 1;
  const moving = state.playing || performance.now() - movedAt < 250;
  const part = { full: 1, half: 0.5, auto: moving ? share : 1 }[state.resolution];
  const ratio = Math.min(devicePixelRatio || 1, 2) * part;
  const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
  const index = cameraIndex(), near = model?.near ?? 0.01;
  let view, left = 0, top = 0, pixels = 1, second = null;
  if (index >= 0) {
    const camera = info.cameras[index], beside = state.compare === 'beside' && camera.image !== false;
    const upright = beside && width < height, across = beside && !upright ? w / 2 : w, down = upright ? h / 2 : h;
    pixels = Math.min(across / camera.width, down / camera.height);
    view = viewOfCamera(camera, near, pixels);
    left = Math.round((across - view.width) / 2) + (beside && !upright ? Math.round(w / 2) : 0);
    top = Math.round((down - view.height) / 2) + (upright ? Math.round(h / 2) : 0);
    if (beside) second = upright ? { left, top: top - h / 2 } : { left: left - w / 2, top };
  } else {
    view = free.view(w, h, near);
    const trained = info.cameras[0];  // small Gaussians look as in training, not thinner
    if (trained) { view.filter = view.fy / trained.fy; pixels = Math.max(view.filter, 1e-3); }
  }
  const css = (place) => ({ left: place.left / ratio, top: place.top / ratio, width: view.width / ratio, height: view.height / ratio });
  return { view, left, top, ratio, w, h, pixels, index, frame: css({ left, top }), second: second && css(second) };
}

function draw(now) {
  framing = frameView();
  const { view, left, top, w, h, index } = framing;
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  wantSort(view, modelTime());
  renderer.draw(view, modelTime(), look(), left, top, [15 / 255, 17 / 255, 21 / 255]);
  const camera = info.cameras[index], address = camera && camera.image !== false ? run.imageAddress(index) : '';
  const taken = camera && Math.abs(stepAt(camera.time) - stepAt(state.time)) > 0.5 ? ` at step ${frameOf(camera.time)}` : '';
  truth.show(state.compare, address, framing.frame, framing.second ?? framing.frame, state.wipe, `True image${taken}`);
  const gain = $('gain');
  gain.hidden = !(address && state.compare === 'difference');
  for (const side of ['left', 'top', 'width', 'height']) gain.style[side] = `${framing.frame[side]}px`;
  const over = $('trails');
  over.hidden = !state.trails;
  if (state.trails) {
    if (over.width !== w || over.height !== h) { over.width = w; over.height = h; }
    trails ??= findTrails(model, Array.from({ length: steps() }, (_, k) => k / Math.max(steps() - 1, 1)));
    drawTrails(over, trails, view, modelTime(), left, top);
  }
  if (now - lastShown > 200 || !state.playing) showNumbers(now);
}

// ---- the loop
let lastShown = 0;
function tick(now) {
  requestAnimationFrame(tick);
  const seconds = Math.min((now - lastFrame) / 1000, 0.25);
  lastFrame = now;
  if (!model || renderer.gl.isContextLost()) return;
  if (moveHeld(seconds)) dirty = true;
  if (state.playing) {
    advance(seconds);
    dirty = true;
  }
  if (state.resolution === 'auto') adapt(seconds, now);
  if (!dirty) return;
  if (!sorter.result) return void wantSort(frameView().view, modelTime());  // a new model: the last picture stays meanwhile
  dirty = false;
  try {
    draw(now);
  } catch (error) {
    fail(error);
  }
}

function advance(seconds) {
  const whole = Math.max(steps() - 1, 1) / (info.fps || model.fps || 24);
  let time = state.time + seconds * state.speed / whole;
  if (time > 1) {
    if (!state.loop) { time = 1; state.playing = false; showState(); } else time %= 1;
  }
  setTime(time);
}

// Draws fewer pixels while something moves on a slow device, all of them when it stands still.
let wasMoving = false;
function adapt(seconds, now) {
  const moving = state.playing || now - movedAt < 250;
  if (moving) {
    frameTimes.push(seconds);
    if (frameTimes.length >= 6) {
      const mean = frameTimes.reduce((a, b) => a + b) / frameTimes.length;
      frameTimes = [];
      if (mean > 0.05) share = Math.max(0.3, share * Math.max(0.6, Math.sqrt(0.04 / mean)));
      else if (mean < 0.022) share = Math.min(1, share * 1.15);
    }
  } else if (wasMoving) {
    frameTimes = [];
    dirty = true;
  }
  wasMoving = moving;
}

function setTime(time) {
  state.time = Math.min(Math.max(time, 0), 1);
  $('time').value = state.time;
  setPart($('time'));
  const index = cameraIndex();
  if (index >= 0) {
    const group = groupOf(index);
    if (group?.members.length > 1) state.camera = String(memberAt(group, info.cameras, state.time));
    else if (group && state.follow) {
      const path = pathOf(index);
      state.camera = String(memberAt(path, info.cameras, state.time));
      $('camera').value = state.camera;
    }
  }
  const fps = info.fps || model?.fps, last = steps() - 1, frame = stepAt(state.time);
  $('clock').innerHTML = '<b></b> <span></span>';
  $('clock').firstChild.textContent = `${Number.isInteger(+frame.toFixed(3)) ? Math.round(frame) : frame.toFixed(1)} / ${last}`;
  $('clock').lastChild.textContent = fps ? `${(frame / fps).toFixed(2)} s` : '';
  changed();
}

function showNumbers(now) {
  lastShown = now;
  const result = sorter.result, { view } = framing, kind = { color: '', opacity: '' };
  canvas.setAttribute('aria-label', `${run.name} at time ${state.time.toFixed(3)}${kind[state.mode] ?? `, ${state.mode}`}`);
  fillList($('statistics'), [
    ['Gaussians', model.count.toLocaleString('en')], ['in this view and time', result?.count.toLocaleString('en')],
    ['that may move', model.motion === 'static' ? '0' : model.moving.toLocaleString('en')], ['Motion model', info.motion || model.model || model.motion],
    ['Colour degree', String(model.sh_degree)], ['Picture', `${view.width} × ${view.height}`],
    ['Sorting', result && `${result.milliseconds.toFixed(1)} ms`], ['PSNR of this view', truthPsnr && `${truthPsnr.toFixed(2)} dB`],
  ]);
  const legend = $('legend'), shown = state.mode === 'flow' || state.mode === 'depth';
  legend.hidden = !shown;
  if (shown) drawLegend(legend);
  $('summary').textContent = [model.count.toLocaleString('en') + ' Gaussians', info.motion || model.model || model.motion,
    info.iteration ? `step ${info.iteration.toLocaleString('en')}` : ''].filter(Boolean).join(' · ');
  $('follow').hidden = !(framing.index >= 0 && groupOf(framing.index)?.members.length === 1 && pathOf(framing.index).members.length > 1);
  $('compare-note').textContent = info.cameras.length ? (framing.index < 0 ? 'Choose a camera of the scene to compare.' : '') : 'Files have no true images.';
}

let legendKind = '';
function drawLegend(element) {
  const paint = element.firstElementChild.getContext('2d'), size = 128, options = look();
  element.classList.toggle('depth', state.mode === 'depth');
  const asTrained = ['material', 'translate'].includes(model.transport) ? '' : `, by material transport (the run: ${model.transport})`;
  element.lastElementChild.textContent = state.mode === 'flow' ? `${(options.longestFlow / framing.pixels).toPrecision(2)} px per step${asTrained}`
    : `${options.depthRange[0].toPrecision(3)} … ${options.depthRange[1].toPrecision(3)}`;
  if (legendKind === state.mode) return;
  legendKind = state.mode;
  const data = paint.createImageData(size, size), wheel = wheelColors();
  const stops = [[252, 232, 173], [245, 158, 82], [204, 74, 107], [107, 41, 133], [23, 20, 64]];
  for (let y = 0; y < size; ++y)
    for (let x = 0; x < size; ++x) {
      const u = (x - 63.5) / 63.5, v = (y - 63.5) / 63.5, o = 4 * (size * y + x);
      const at = state.mode === 'flow' ? (Math.atan2(-v, -u) / Math.PI + 1) / 2 * 54 : x / (size - 1) * 3.999;
      const k = Math.floor(at), f = at - k, r = Math.min(Math.hypot(u, v), 1);
      for (let c = 0; c < 3; ++c)
        data.data[o + c] = state.mode === 'flow' ? 255 * (1 - r * (1 - ((1 - f) * wheel[3 * k + c] + f * wheel[3 * ((k + 1) % 55) + c])))
          : (1 - f) * stops[k][c] + f * stops[k + 1][c];
      data.data[o + 3] = 255;
    }
  paint.putImageData(data, 0, 0);
}

// ---- changes
function changed(name) {
  dirty = true;
  if (name === 'fov') { takeCamera(); free.fov = state.fov * Math.PI / 180; cameraMoved(); }
  if (name === 'style') free.style = state.style;
  if (name && name !== 'time') showState();
  if (name === 'compare' && state.compare !== 'off' && cameraIndex() >= 0) {  // true images are of whole time steps
    state.playing = false;
    setTime(timeOf(frameOf(state.time)));
    showState();
  }
  truthPsnr = null;
  clearTimeout(psnrTimer);
  if (state.compare !== 'off' && cameraIndex() >= 0) psnrTimer = setTimeout(measurePsnr, 500);
  clearTimeout(addressTimer);
  addressTimer = setTimeout(() => history.replaceState(null, '', addressOf(state)), 300);
}

let truthPsnr = null;
async function measurePsnr() {
  const index = cameraIndex();
  if (state.playing || index < 0 || state.mode !== 'color') return;
  const { width, height, pixels } = await capture({ camera: index });
  truthPsnr = truth.psnr(pixels, width, height);
  if (truthPsnr === null && !truth.image.complete) psnrTimer = setTimeout(measurePsnr, 300);
  dirty = true;
}

// The free camera takes over where the camera of the scene is.
function takeCamera() {
  if (cameraIndex() < 0) return;
  const { view, h, index } = framing ?? frameView();
  free.takeView({ ...viewOfCamera(info.cameras[index], view.near), height: h / (view.fy / info.cameras[index].fy) });
  free.distance = sorter.result?.count ? sorter.result.middle : model.size;
  state.camera = null;
  $('camera').value = '';
}
function cameraMoved() {
  movedAt = performance.now();
  state.free = free.toText();
  state.fov = Math.round(free.fov * 180 / Math.PI);
  changed();
  showState();
}
function setCamera(index) {
  state.camera = String(index);
  state.free = null;
  const group = groupOf(index), { cameras } = info;
  if (group.members.length > 1) state.camera = String(memberAt(group, cameras, state.time));
  else setTime(cameras[index].time ?? state.time);
  $('camera').value = String(group.members[0]);
  state.fov = Math.round(2 * Math.atan(cameras[index].height / 2 / cameras[index].fy) * 180 / Math.PI);
  changed('camera');
}
function stepCamera(by) {
  if (!groups.length) return;
  const at = groups.indexOf(groupOf(cameraIndex())), next = at < 0 ? 0 : (at + by + groups.length) % groups.length;
  setCamera(groups[next].members[0]);
}
function resetCamera() {
  const first = info.cameras.findIndex((camera) => camera.split === 'test');
  if (info.cameras.length) setCamera(Math.max(first, 0));
  else lookFromOutside();
}
function lookFromOutside() {
  const side = Math.abs(free.up[1]) > 0.9 ? [0.35, 0, 1] : [0.35, 1, 0];
  free.look(model.centre, side.map((x, k) => x - 0.25 * free.up[k]), 3.2 * model.size);
  free.fov = 0.8;
  state.camera = null;
  cameraMoved();
}

function fillCameras() {
  const select = $('camera');
  select.replaceChildren(new Option('Free camera', ''));
  for (const [split, title] of [['test', 'Test cameras'], ['val', 'Validation cameras'], ['train', 'Training cameras'], ['view', 'Cameras']]) {
    const part = groups.filter((group) => group.split === split);
    if (!part.length) continue;
    const section = document.createElement('optgroup');
    section.label = title;
    for (const group of part) section.append(new Option(group.label, String(group.members[0])));
    select.append(section);
  }
  for (const id of ['previous', 'following', 'camera']) $(id).disabled = !groups.length;
  $('compare-section').hidden = !groups.length;
}

// ---- runs
let awaited = null;  // a training that has no model yet
async function openRun(next) {
  if (next !== awaited) setBusy('Loading the model …');
  try {
    const nextInfo = await next.info(), nextModel = await next.model();
    if (run && run !== next && next.given === undefined) next.tag = null;
    run = next;
    info = { cameras: [], ...nextInfo };
    state.run = String(run.id);
    groups = groupCameras(info.cameras);
    takeModel(nextModel ?? model);
    fillCameras();
    setUp();
    const wanted = cameraIndex();
    if (state.free && free.fromText(state.free)) { state.camera = null; state.fov = Math.round(free.fov * 180 / Math.PI); } else if (wanted >= 0) setCamera(wanted);
    else resetCamera();
    document.title = `${run.name} – gflow view`;
    $('live').hidden = !info.live;
    document.querySelector('.transport').hidden = model.motion === 'static' && steps() < 2;
    $('run').value = String(run.id);
    await readTraining();
    setTime(state.time);
    showState();
    say('');
    awaited = null;
  } catch (error) {
    awaited = error.comesLater ? next : null;
    if (awaited) say(`${error.message} …`);
    else fail(error);
  }
  setBusy('');
}

function takeModel(next) {
  model = next;
  renderer.setModel(model);
  setSortedModel();
  free.speed = 0.6 * model.size;
  trails = null;
  dirty = true;
}
// Up is that of the cameras on average: minus their y axes.
function setUp() {
  const sum = [0, 0, 0];
  for (const { viewmat: m } of info.cameras) for (let k = 0; k < 3; ++k) sum[k] -= m[4 + k];
  const norm = Math.hypot(...sum);
  if (model.up) free.up = model.up;
  else free.up = norm > 0.1 * info.cameras.length && norm > 0 ? sum.map((x) => x / norm) : [0, -1, 0];
}

async function readTraining() {
  await run.readMetrics().catch(() => false);
  const some = run.lines.length > 0 || !!info.metrics;
  $('training').hidden = !some;
  if (!some) return;
  drawCharts($('charts'), run.lines);
  fillList($('results'), trainingEntries(info, run.lines));
}

// While a training runs and somebody looks: its newest model and curves.
async function follow() {
  if (document.visibilityState === 'visible' && awaited) await openRun(awaited);
  else if (document.visibilityState === 'visible' && run && info.live) {
    try {
      const current = run, now = await current.state();
      if (now.live === false) info = { ...info, ...(await current.info()) };  // the evaluation is there now
      const next = now.model && now.model !== current.tag ? await current.model() : null;
      if (current === run) {
        info = { ...info, iteration: now.iteration, live: now.live };
        if (next) takeModel(next);
        $('live').hidden = !info.live;
        await readTraining();
        dirty = true;
      }
    } catch { /* the next try may succeed */ }
  }
  setTimeout(follow, 2000);
}

async function openFiles(files) {
  if (!files.length) return;
  setBusy(`Reading ${files[0].name} …`);
  try {
    const read = await readSplatFiles([...files]);
    const local = new LocalRun(read.name, read.model);
    runs.push(local);
    $('run').append(new Option(local.name, local.id));
    document.querySelector('.run').hidden = false;
    Object.assign(state, { camera: null, free: null, compare: 'off' });
    await openRun(local);
    if (read.note) say(read.note, 8);
  } catch (error) {
    fail(error, 10);
  }
  setBusy('');
}

function fail(error, seconds = 0) {
  console.error(error);
  say(error.message, seconds);
}

// ---- pictures
// The picture of a camera of the scene, or of the free one, at its own size.
export async function capture({ camera = cameraIndex(), time = state.time, width, height, mode = state.mode, sums = false, precise = true, ...more } = {}) {
  const wide = width ?? canvas.width, high = height ?? canvas.height;
  const view = camera >= 0 ? viewOfCamera(info.cameras[camera], model.near) : free.view(wide, high, model.near);
  await sortedFor(view, modelTime(time));
  const options = { ...look(), mode, nextTime: nextTimeOf(time), ...more };
  const pixels = sums ? renderer.captureSums(view, modelTime(time), options) : renderer.capture(view, modelTime(time), options, precise);
  dirty = true;
  return { width: view.width, height: view.height, pixels };
}
async function savePicture() {
  const { width, height, pixels } = await capture({}), paper = document.createElement('canvas');
  paper.width = width;
  paper.height = height;
  paper.getContext('2d').putImageData(new ImageData(pixels, width, height), 0, 0);
  const link = document.createElement('a');
  link.href = URL.createObjectURL(await new Promise((done) => paper.toBlob(done)));
  link.download = `${run.name}_${String(frameOf(state.time)).padStart(4, '0')}_${state.mode}.png`.replace(/[^\w.-]+/g, '_');
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const commands = {
  play: () => { if (!state.playing && !state.loop && state.time >= 1) setTime(0); state.playing = !state.playing; changed('playing'); },
  step: (by = 1) => { state.playing = false; setTime(timeOf(by > 0 ? Math.floor(stepAt(state.time) + 1e-4) + 1 : Math.ceil(stepAt(state.time) - 1e-4) - 1)); showState(); },
  stepBack: () => commands.step(-1),
  first: () => setTime(0),
  last: () => setTime(1),
  up: () => {
    const axes = [[0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 0, -1]], at = axes.findIndex((a) => dot3(a, free.up) > 0.9);
    free.up = axes[(at + 1) % axes.length];
    lookFromOutside();
  },
  previousCamera: () => stepCamera(-1),
  nextCamera: () => stepCamera(1),
  reset: () => resetCamera(),
  mode: (mode) => { state.mode = mode; changed('mode'); },
  compare: () => {
    const kinds = ['off', 'wipe', 'beside', 'difference'];
    if (cameraIndex() < 0 && groups.length) resetCamera();
    state.compare = kinds[(kinds.indexOf(state.compare) + 1) % kinds.length];
    changed('compare');
  },
  save: () => savePicture().catch(fail),
  link: async () => {
    history.replaceState(null, '', addressOf(state));
    const copied = await navigator.clipboard?.writeText(location.href).then(() => true, () => false);
    say(copied ? 'The address of this view is copied.' : 'The address of this view is in the address bar.', 2);
  },
  panel: () => { state.panel = !state.panel; changed('panel'); },
  help: () => $('keys').showModal(),
  dismiss: () => say(''),
};

function attach() {
  showState = attachControls(state, changed);
  attachKeys(commands);
  moveHeld = attachCamera(canvas, free, takeCamera, cameraMoved);
  truth.attach(() => framing.frame, (part) => { state.wipe = typeof part === 'function' ? part(state.wipe) : part; changed('wipe'); });
  truth.image.addEventListener('load', () => { changed(); });
  const click = (id, act) => $(id).addEventListener('click', () => act());
  for (const [id, act] of [['play', 'play'], ['step', 'step'], ['step-back', 'stepBack'], ['save', 'save'], ['link', 'link'], ['help', 'help'], ['toggle', 'panel'],
    ['previous', 'previousCamera'], ['following', 'nextCamera']]) click(id, commands[act]);
  click('follow', () => { state.follow = !state.follow; changed('follow'); setTime(state.time); });
  click('trail', () => { state.trails = !state.trails; changed('trails'); });
  click('loop', () => { state.loop = !state.loop; changed('loop'); });
  click('open', () => $('file').click());
  $('file').addEventListener('change', () => openFiles($('file').files));
  $('time').addEventListener('input', () => { state.playing = false; setTime(+$('time').value); showState(); });
  $('speed').addEventListener('change', () => { state.speed = +$('speed').value; changed('speed'); });
  $('camera').addEventListener('change', () => { if ($('camera').value === '') { takeCamera(); cameraMoved(); } else setCamera(+$('camera').value); });
  $('run').addEventListener('change', () => openRun(runs.find((one) => String(one.id) === $('run').value)));
  new ResizeObserver(() => { dirty = true; }).observe(stage);
  addEventListener('dragover', (event) => { event.preventDefault(); document.body.classList.add('dropping'); });
  addEventListener('dragleave', (event) => { if (!event.relatedTarget) document.body.classList.remove('dropping'); });
  addEventListener('drop', (event) => {
    event.preventDefault();
    document.body.classList.remove('dropping');
    openFiles(event.dataTransfer.files);
  });
  addEventListener('hashchange', () => { Object.assign(state, firstState, stateOfAddress()); if (state.free) free.fromText(state.free); setTime(state.time); showState(); });
  canvas.addEventListener('webglcontextlost', (event) => { event.preventDefault(); say('The graphics device was lost. Waiting for it …'); });
  canvas.addEventListener('webglcontextrestored', () => {
    try {
      renderer.start();
      sorter.shown = '';
      dirty = true;
      say('');
    } catch (error) {
      fail(error);
    }
  });
}

async function start() {
  try {
    renderer = new Renderer(canvas);
  } catch (error) {
    setBusy('');
    return fail(error);
  }
  attach();
  if (!renderer.hasFloats)
    for (const name of ['depth', 'flow']) {
      const button = document.querySelector(`.chips button[value=${name}]`);
      button.disabled = true;
      button.title = 'This device cannot draw into floating-point textures';
    }
  try {
    runs = await findRuns();
    for (const one of runs) $('run').append(new Option(one.name, String(one.id)));
    document.querySelector('.run').hidden = !runs.length;
    if (runs.length) await openRun(runs.find((one) => String(one.id) === state.run) ?? runs[0]);
    else say('Drop a splat file to see it.');
  } catch (error) {
    fail(error);
  }
  setBusy('');
  requestAnimationFrame(tick);
  follow();
}

// For tests and scripts.
window.gflow = { state, capture, setTime, setCamera, commands, openFiles, get renderer() { return renderer; }, get info() { return info; },
  get model() { return model; }, get sorter() { return sorter; }, changed };
start();
