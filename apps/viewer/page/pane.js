// SPDX-License-Identifier: Apache-2.0
// A model on a canvas: its run, its renderer, and the order of its Gaussians.
import { app, changed, fail } from './app.js';
import { motionOf } from './packing.js';
import { Renderer } from './renderer.js';
import { Sorter } from './sorting.js';
import { say } from './ui.js';

export class Pane {
  constructor(canvas) {
    Object.assign(this, { canvas, run: null, info: { cameras: [] }, model: null, renderer: new Renderer(canvas) });
    this.sorter = new Sorter((order, count) => { this.renderer.setOrder(order, count); app.dirty = true; }, fail);
    canvas.addEventListener('webglcontextlost', (event) => { event.preventDefault(); say('The graphics device was lost. Waiting for it …'); });
    canvas.addEventListener('webglcontextrestored', () => {
      try {
        this.renderer.start();
        this.sorter.shown = '';
        say('');
        changed();
      } catch (error) {
        fail(error);
      }
    });
  }

  setModel(model) {
    this.model = model;
    this.renderer.setModel(model);
    model.sorted = motionOf(model);
    const steps = Math.max(model.steps, 1), { times } = this.info;
    this.sorter.start(model.sorted, Array.from({ length: steps }, (_, k) => (times?.length === steps ? times[k] : k / Math.max(steps - 1, 1)) * model.duration));
    app.dirty = true;
  }

  get lost() { return this.renderer.gl.isContextLost(); }
  get ready() { return !!this.model && !!this.sorter.result && !this.lost; }

  // The box of the filter in the model's coordinates, or null.
  crop() {
    const { crop } = app.state, o = this.model.origin ?? [0, 0, 0];
    return crop && { low: o.map((x, k) => crop[k] - x), high: o.map((x, k) => crop[3 + k] - x) };
  }

  // A view of the run shown, in this model's coordinates.
  ownView(view) {
    const from = app.pane.model.origin ?? [0, 0, 0], by = (this.model.origin ?? [0, 0, 0]).map((x, k) => x - from[k]), r = view.rotation;
    if (!by.some(Boolean)) return view;
    return { ...view, translation: view.translation.map((t, k) => t + r[3 * k] * by[0] + r[3 * k + 1] * by[1] + r[3 * k + 2] * by[2]) };
  }

  // The functions below take scene times.
  wantSort(view, time) { return this.sorter.want(this.ownView(view), time * this.model.duration, this.crop()); }
  sortedFor(view, time) { return this.sorter.until(this.ownView(view), time * this.model.duration, this.crop()); }
  draw(view, time, look, left, top, margin) {
    this.wantSort(view, time);
    this.renderer.draw(this.ownView(view), time * this.model.duration, this.own(look), left, top, margin);
  }
  own(look) { return { ...look, nextTime: Math.min(look.nextTime, 1) * this.model.duration }; }
}
