// SPDX-License-Identifier: Apache-2.0
// Cameras of the scene, in groups that share a place: a fixed camera has an image per time step.
import { app } from './app.js';

const sameNumber = (a, b) => Math.abs(a - b) < 1e-9 * (1 + Math.abs(a));
const sameCamera = (a, b) => a.split === b.split && a.fx === b.fx && a.width === b.width && a.viewmat.every((x, k) => sameNumber(x, b.viewmat[k]));

// [{ label, split, members: indices of cameras in the order of time }]
export function groupCameras(cameras) {
  const groups = [], byPlace = new Map();
  cameras.forEach((camera, index) => {
    const place = camera.viewmat.map((x) => x.toPrecision(6)).join() + camera.split;
    let group = byPlace.get(place);
    if (!group || !sameCamera(cameras[group.members[0]], camera)) {
      group = { split: camera.split, members: [] };
      byPlace.set(place, group);
      groups.push(group);
    }
    group.members.push(index);
  });
  for (const group of groups) {
    group.members.sort((a, b) => cameras[a].time - cameras[b].time);
    const names = group.members.map((index) => String(cameras[index].name)), [name] = names;
    const same = names.every((one) => one === name);  // else they end with the number of the time step
    group.label = same ? name : name.replace(/([/_ -]|images)*\d+(\.\w+)?$/, '') || name;
  }
  // A camera that moves has one name for all its places.
  for (const group of groups) {
    const step = cameras[group.members[0]].step;
    if (group.members.length === 1 && groups.filter((other) => other.label === group.label && other.split === group.split).length > 1)
      group.longLabel = `${group.label} at ${step}`;
  }
  for (const group of groups) group.label = group.longLabel ?? group.label;
  return groups;
}

// The member of a group whose time is nearest.
export function memberAt(group, cameras, time) {
  let best = group.members[0];
  for (const index of group.members)
    if (Math.abs(cameras[index].time - time) < Math.abs(cameras[best].time - time)) best = index;
  return best;
}

// The camera of the scene that the picture is of, -1: the free one.
export function cameraIndex() {
  const { camera } = app.state, { length } = app.info.cameras;
  return camera === null || !length ? -1 : Math.min(Math.max(+camera || 0, 0), length - 1);
}
export const groupOf = (index) => app.groups.find((group) => group.members.includes(index));

// The places of a camera that moves: their names differ in the last number, and each has its own time.
export function pathOf(index) {
  const { cameras } = app.info, stem = (camera) => `${camera.split} ${String(camera.name).replace(/\d+(\.\w+)?$/, '')}`, own = stem(cameras[index]);
  const members = cameras.flatMap((camera, k) => (stem(camera) === own ? [k] : []));
  return { members: new Set(members.map((k) => cameras[k].time)).size === members.length ? members : [index] };
}
