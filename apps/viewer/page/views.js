// SPDX-License-Identifier: Apache-2.0
// Which camera the picture is of, and where it lies on the stage.
import { $, app, changed, onChange, onShow, showState } from './app.js';
import { dot3, FreeCamera, unit3, viewOfCamera } from './camera.js';
import { cameraIndex, groupCameras, groupOf, memberAt } from './groups.js';
import { setTime } from './timeline.js';

const { state, free } = app, stage = $('stage');
const degrees = (angle) => Math.round(angle * 180 / Math.PI);
export const isMoving = () => state.playing || app.pathAt !== null || performance.now() - app.movedAt < 250;

// The view and its place on the canvas, whose size is that of the stage times the ratio: w, h. pixels: of the
// canvas in one of the camera's; frame, second: places of the picture and of what it is compared with in CSS pixels.
export function frameView(full = false) {
  const width = stage.clientWidth || 1, height = stage.clientHeight || 1;
  const part = full ? 1 : { full: 1, half: 0.5, auto: isMoving() ? app.share : 1 }[state.resolution];
  const ratio = Math.min(devicePixelRatio || 1, 2) * part;
  const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
  const index = cameraIndex(), near = app.pane.model?.near ?? 0.01, camera = app.info.cameras[index];
  const beside = state.compare === 'beside' && (state.with ? !!app.other?.model : camera && camera.image !== false);
  const upright = beside && width < height, across = beside && !upright ? Math.floor(w / 2) : w, down = upright ? Math.floor(h / 2) : h;
  let view, pixels = 1;
  if (camera) {
    pixels = Math.min(across / camera.width, down / camera.height);
    view = viewOfCamera(camera, near, pixels);
  } else {
    view = free.view(across, down, near);
    const trained = app.info.cameras[0];  // small Gaussians look as in training, not thinner
    if (trained) { view.filter = view.fy / trained.fy; pixels = Math.max(view.filter, 1e-3); }
  }
  const left = Math.round((across - view.width) / 2) + (beside && !upright ? w - across : 0), top = Math.round((down - view.height) / 2) + (upright ? h - down : 0);
  const second = upright ? { left, top: top - (h - down) } : { left: beside ? left - (w - across) : left, top };
  const css = (place) => ({ left: place.left / ratio, top: place.top / ratio, width: view.width / ratio, height: view.height / ratio });
  return { view, left, top, ratio, w, h, pixels, index, frame: css({ left, top }), second: css(second) };
}

// A free camera that shows what is shown now.
export function cameraNow() {
  if (cameraIndex() < 0) return free;
  const { view, h, index } = frameView(), camera = app.info.cameras[index], { result } = app.pane.sorter, taken = new FreeCamera();
  taken.takeView({ ...viewOfCamera(camera, view.near), height: h / (view.fy / camera.fy) });
  taken.distance = result?.count ? result.middle : app.pane.model.size;
  return taken;
}
// The free camera takes over where the camera of the scene is.
export function takeCamera() {
  app.pathAt = null;
  if (cameraIndex() < 0) return;
  const { eye, axes, fov, distance } = cameraNow();
  Object.assign(free, { eye, axes, fov, distance });
  state.camera = null;
  $('camera').value = '';
}
export function cameraMoved() {
  app.movedAt = performance.now();
  state.camera = null;
  $('camera').value = '';
  state.free = free.toText();
  state.fov = degrees(free.fov);
  changed('free');
}

export function setCamera(index) {
  app.pathAt = null;
  state.camera = String(index);
  state.free = null;
  const group = groupOf(index), { cameras } = app.info;
  if (group.members.length > 1) state.camera = String(memberAt(group, cameras, state.time));
  else setTime(cameras[index].time ?? state.time);
  $('camera').value = String(group.members[0]);
  state.fov = degrees(2 * Math.atan(cameras[index].height / 2 / cameras[index].fy));
  changed('camera');
}
export function stepCamera(by) {
  const { groups } = app;
  if (!groups.length) return;
  const at = groups.indexOf(groupOf(cameraIndex())), next = at < 0 ? 0 : (at + by + groups.length) % groups.length;
  setCamera(groups[next].members[0]);
}
export function resetCamera() {
  const first = app.info.cameras.findIndex((camera) => camera.split === 'test');
  if (app.info.cameras.length) setCamera(Math.max(first, 0));
  else lookFromOutside();
}
function lookFromOutside() {
  const side = Math.abs(free.up[1]) > 0.9 ? [0.35, 0, 1] : [0.35, 1, 0], { centre, size } = app.pane.model;
  free.look(centre, side.map((x, k) => x - 0.25 * free.up[k]), 3.2 * size);
  free.fov = 0.8;
  app.pathAt = null;
  cameraMoved();
}
export function nextUp() {
  const axes = [[0, -1, 0], [0, 0, 1], [0, 1, 0], [0, 0, -1]], at = axes.findIndex((a) => dot3(a, free.up) > 0.9);
  free.up = axes[(at + 1) % axes.length];
  lookFromOutside();
}

// The cameras in the list: those whose name contains what is searched for.
function listCameras() {
  const { groups } = app, select = $('camera'), word = $('find').value.trim().toLowerCase(), { value } = select;
  let found = 0;
  select.replaceChildren(new Option('Free camera', ''));
  for (const [split, title] of [['test', 'Test cameras'], ['val', 'Validation cameras'], ['train', 'Training cameras'], ['view', 'Cameras']]) {
    const part = groups.filter((group) => group.split === split && group.label.toLowerCase().includes(word));
    if (!part.length) continue;
    found += part.length;
    const section = document.createElement('optgroup');
    section.label = title;
    for (const group of part) section.append(new Option(group.label, String(group.members[0])));
    select.append(section);
  }
  select.value = value;
  $('find').setCustomValidity(found || !groups.length ? '' : 'No camera has this name');
}
// Shows the first camera found.
function goToFound() {
  const option = $('camera').querySelector('optgroup option');
  if ($('find').value && option) setCamera(+option.value);
}

// For the cameras of another run: their list, upwards, and the camera that the state names.
export function useCameras() {
  const { cameras } = app.info, groups = app.groups = groupCameras(cameras);
  $('find').value = '';
  $('find').hidden = groups.length < 30;
  listCameras();
  for (const id of ['previous', 'following', 'camera']) $(id).disabled = !groups.length;
  // Up is that of the cameras on average: minus their y axes.
  const sum = [0, 1, 2].map((k) => -cameras.reduce((all, { viewmat }) => all + viewmat[4 + k], 0)), norm = Math.hypot(...sum);
  free.up = app.pane.model.up ? unit3(app.pane.model.up) : (norm > 0.1 * cameras.length && norm > 0 ? sum.map((x) => x / norm) : [0, -1, 0]);
  const wanted = cameraIndex(), { time } = state;
  if (state.free && free.fromText(state.free)) { state.camera = null; state.fov = degrees(free.fov); } else if (wanted >= 0) setCamera(wanted);
  else resetCamera();
  if (time > 0) setTime(time);  // that of the address, rather than of the camera
}

export function attachViews() {
  $('find').addEventListener('input', listCameras);
  $('find').addEventListener('change', goToFound);
  $('camera').addEventListener('change', () => { if ($('camera').value === '') { takeCamera(); cameraMoved(); } else setCamera(+$('camera').value); });
  $('fov').addEventListener('input', () => { takeCamera(); free.fov = state.fov * Math.PI / 180; cameraMoved(); });
  onShow(() => { free.style = state.style; });
  onChange((name) => { if (name === 'follow') setTime(state.time); });
  showState();
}
