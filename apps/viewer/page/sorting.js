// SPDX-License-Identifier: Apache-2.0
// The order of a model's Gaussians, made by a worker: one request at a time, and the latest wish waits.
import { makeSorter } from './source.js';

export class Sorter {
  // sorted(order, count) gets each order, failed(error) what goes wrong.
  constructor(sorted, failed) {
    Object.assign(this, { sorted, failed, worker: null, waiting: [] });
  }

  // Begins with another model; times: model times at which the box of crop is tested.
  start(motion, times) {
    this.worker?.terminate();
    this.worker = makeSorter();
    Object.assign(this, { busy: false, wanted: null, shown: '', buffer: null, result: null });
    this.worker.onmessage = ({ data }) => {
      this.busy = false;
      this.result = data;
      this.shown = data.id;
      this.sorted(data.order, data.count);
      this.buffer = data.order.buffer;
      for (const wake of this.waiting.splice(0)) wake();
      if (this.wanted) this.send();
    };
    this.worker.onerror = (event) => this.failed(new Error(`The sorter failed: ${event.message}`));
    this.worker.postMessage({ motion, times });
  }

  send() {
    const { wanted, buffer } = this;
    Object.assign(this, { wanted: null, busy: true, buffer: null });
    this.worker.postMessage({ ...wanted, buffer }, buffer ? [buffer] : []);
  }

  // Asks for the order of a view at a model time, of what is inside of a box { low, high } or of all.
  want(view, time, crop) {
    const row = view.rotation.slice(6), offset = view.translation[2];
    const id = [time, ...row, offset, view.near, crop?.low, crop?.high].join();
    if (id === this.shown && !this.wanted || id === this.wanted?.id) return id;
    this.wanted = { id, time, row, offset, near: view.near, crop };
    if (!this.busy) this.send();
    return id;
  }

  // Waits until the order is exactly that.
  async until(view, time, crop) {
    const id = this.want(view, time, crop);
    while (this.shown !== id) {
      if (!this.busy && !this.wanted) this.want(view, time, crop);
      await new Promise((wake) => this.waiting.push(wake));
    }
  }
}
