// SPDX-License-Identifier: Apache-2.0
// Convenience only: wipes start in the middle and follow the pointer. They scroll without it, too.
for (const wipe of document.querySelectorAll('.wipe')) {
  const range = () => wipe.scrollWidth - wipe.clientWidth;
  const follow = event => {
    const box = wipe.getBoundingClientRect();
    wipe.scrollLeft = range() * (1 - (event.clientX - box.left) / box.width);
  };
  wipe.style.scrollSnapType = 'none';
  wipe.scrollLeft = range() / 2;
  wipe.addEventListener('pointerdown', event => { if (event.pointerType === 'mouse') follow(event); });
  wipe.addEventListener('pointermove', event => { if (event.pointerType === 'mouse' && event.buttons & 1) follow(event); });
  wipe.addEventListener('dragstart', event => event.preventDefault());
}
