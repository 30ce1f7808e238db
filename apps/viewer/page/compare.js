// SPDX-License-Identifier: Apache-2.0
// Cameras of the scene, in groups that share a place (a fixed camera has an image per time step), and
// the true image beside, under or minus the model's.

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

// Shows the true image over a frame of the stage: { left, top, width, height } in CSS pixels.
export class TruthOverlay {
  constructor(stage) {
    this.stage = stage;
    this.image = stage.querySelector('#truth');
    this.handle = stage.querySelector('#wipe');
    this.tags = [stage.querySelector('#tag-left'), stage.querySelector('#tag-right')];
    this.address = '';
  }

  show(kind, address, frame, second, share, title) {
    const shown = kind !== 'off' && !!address;
    this.image.hidden = !shown;
    this.handle.hidden = !shown || kind !== 'wipe';
    this.stage.classList.toggle('difference', shown && kind === 'difference');
    for (const tag of this.tags) tag.hidden = !shown || kind === 'difference';
    if (!shown) return;
    if (address !== this.address) {
      this.image.src = address;
      this.address = address;
    }
    const place = kind === 'beside' ? second : frame;
    for (const side of ['left', 'top', 'width', 'height']) this.image.style[side] = `${place[side]}px`;
    this.image.style.clipPath = kind === 'wipe' ? `inset(0 ${100 * (1 - share)}% 0 0)` : '';
    this.handle.style.left = `${frame.left + share * frame.width}px`;
    this.handle.style.top = `${frame.top}px`;
    this.handle.style.height = `${frame.height}px`;
    this.handle.setAttribute('aria-valuenow', String(Math.round(100 * share)));
    this.tags[0].textContent = title;
    this.tags[1].textContent = 'Model';
    this.tags[0].style.left = `${place.left + 8}px`;
    this.tags[0].style.top = this.tags[1].style.top = `${Math.max(frame.top, 0) + 8}px`;
    this.tags[1].style.left = kind === 'beside' ? `${frame.left + 8}px` : '';
    this.tags[1].style.right = kind === 'beside' ? '' : `${this.stage.clientWidth - frame.left - frame.width + 8}px`;
  }

  // Calls changed(share) while the handle is moved.
  attach(frame, changed) {
    const { handle } = this;
    handle.addEventListener('pointerdown', (event) => handle.setPointerCapture(event.pointerId));
    handle.addEventListener('pointermove', (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const { left, width } = frame(), x = event.clientX - this.stage.getBoundingClientRect().left;
      changed(Math.min(Math.max((x - left) / width, 0), 1));
    });
    handle.addEventListener('keydown', (event) => {
      const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      changed((share) => Math.min(Math.max(share + by, 0), 1));
    });
  }

  // PSNR [dB] of RGBA pixels against the image shown, or null if that is not loaded or of another size.
  psnr(pixels, width, height) {
    const { image } = this;
    if (image.hidden || !image.complete || image.naturalWidth !== width || image.naturalHeight !== height) return null;
    const canvas = document.createElement('canvas');
    canvas.width = width;
    canvas.height = height;
    const context = canvas.getContext('2d', { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const truth = context.getImageData(0, 0, width, height).data;
    let sum = 0;
    for (let i = 0; i < truth.length; ++i) if (i % 4 !== 3) sum += (truth[i] - pixels[i]) ** 2;
    return -10 * Math.log10(sum / (width * height * 3) / 255 ** 2);
  }
}
