// SPDX-License-Identifier: Apache-2.0
// Where models come from: the server that gflow view runs, the exported page itself, or a dropped file.
import { embeddedModel, FileError, parseContainer } from './container.js';

async function fetched(address, options) {
  let answer;
  try {
    answer = await fetch(address, options);
  } catch {
    throw new FileError('The server does not answer. gflow view may have ended.');
  }
  if (!answer.ok && answer.status !== 304) {
    const { error } = await answer.json().catch(() => ({}));
    throw Object.assign(new FileError(error || `The server answers ${answer.status} for ${address}.`), { comesLater: answer.status === 503 });
  }
  return answer;
}
const json = async (address) => (await fetched(address)).json();

export const serverIsGone = () => fetch('/api/runs').then(() => false, () => true);

// A run of the server.
export class ServedRun {
  constructor(entry) {
    Object.assign(this, entry, { isServed: true });
    this.tag = null;
    this.nextLine = 0;
    this.lines = [];
  }
  async state() { return json(`/api/run/${this.id}/state`); }
  async info() { return (this.latestInfo = await json(`/api/run/${this.id}/info`)); }
  // The newest model, or null if it has not changed since the last call.
  async model() {
    const answer = await fetched(`/api/run/${this.id}/model`, this.tag ? { headers: { 'If-None-Match': this.tag } } : {});
    if (answer.status === 304) return null;
    const tag = answer.headers.get('ETag');
    if (tag && tag === this.tag) return null;
    const model = parseContainer(await answer.arrayBuffer());
    this.tag = tag;
    return model;
  }
  imageAddress(camera) { return `/api/run/${this.id}/image?camera=${camera}`; }
  // New lines of metrics.jsonl; true if there were any.
  async readMetrics() {
    const { lines, next } = await json(`/api/run/${this.id}/metrics?from=${this.nextLine}`);
    if (next < this.nextLine) this.lines = [];  // the training began again
    this.nextLine = next;
    this.lines.push(...lines);
    return lines.length > 0;
  }
}

// A model that is at hand, from a file or the exported page.
export class LocalRun {
  constructor(name, model, info = {}) {
    Object.assign(this, { id: name, name, kind: 'file', live: false, lines: info.lines || [] });
    this.given = model;
    this.latestInfo = { name, steps: model.steps, cameras: [], ...info };
  }
  async info() { return this.latestInfo; }
  async model() { return this.given; }
  imageAddress(camera) { return this.latestInfo.cameras[camera]?.image_data || ''; }
  async readMetrics() { return false; }
}

// All runs that this page can show.
export async function findRuns() {
  const embedded = await embeddedModel();
  if (embedded) return [new LocalRun(embedded.info.name || 'scene', embedded.model, embedded.info)];
  if (location.protocol === 'file:') return [];
  return (await json('/api/runs')).map((entry) => new ServedRun(entry));
}

// The worker that sorts: its own script in an exported page, else a module of the server.
export function makeSorter() {
  const text = document.getElementById('gflow-worker')?.textContent;
  if (!text) return new Worker('/viewer/sort.worker.js', { type: 'module' });
  return new Worker(URL.createObjectURL(new Blob([text], { type: 'text/javascript' })));
}
