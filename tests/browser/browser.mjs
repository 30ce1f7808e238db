// SPDX-License-Identifier: Apache-2.0
// A headless Chromium, driven over the pipe of its DevTools protocol: no package is needed.
import { spawn } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { extname, join } from 'node:path';

export class Browser {
  static async start({ program = process.env.CHROMIUM || 'chromium', flags = [] } = {}) {
    const browser = new Browser();
    browser.profile = mkdtempSync(join(tmpdir(), 'gflow-browser-'));
    browser.process = spawn(program, ['--headless=new', '--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader',
      '--enable-unsafe-swiftshader', '--remote-debugging-pipe', `--user-data-dir=${browser.profile}`, '--no-first-run',
      '--disable-extensions', '--disable-background-networking', '--hide-scrollbars', ...flags, 'about:blank'],
    { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
    browser.next = 1;
    browser.waiting = new Map();
    browser.listeners = [];
    let rest = Buffer.alloc(0);
    browser.process.stdio[4].on('data', (bytes) => {
      rest = Buffer.concat([rest, bytes]);
      for (let end; (end = rest.indexOf(0)) >= 0; rest = rest.subarray(end + 1)) browser.receive(JSON.parse(rest.subarray(0, end)));
    });
    return browser;
  }
  receive(message) {
    const waiting = this.waiting.get(message.id);
    if (waiting) {
      this.waiting.delete(message.id);
      if (message.error) waiting.fail(new Error(message.error.message));
      else waiting.done(message.result);
    }
    for (const listen of this.listeners) listen(message);
  }
  send(method, params = {}, sessionId) {
    const id = this.next++;
    this.process.stdio[3].write(`${JSON.stringify({ id, method, params, sessionId })}\0`);
    return new Promise((done, fail) => this.waiting.set(id, { done, fail }));
  }
  async page(address, { width = 1280, height = 800, ratio = 1, touch = false, before = '', files = '' } = {}) {
    const { targetId } = await this.send('Target.createTarget', { url: 'about:blank' });
    const { sessionId } = await this.send('Target.attachToTarget', { targetId, flatten: true });
    const page = new Page(this, sessionId, targetId);
    await page.send('Runtime.enable');
    await page.send('Log.enable');
    await page.send('Page.enable');
    await page.send('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: ratio, mobile: touch });
    if (touch) await page.send('Emulation.setTouchEmulationEnabled', { enabled: true });
    if (files) await page.takeFilesFrom(files);
    if (before) await page.send('Page.addScriptToEvaluateOnNewDocument', { source: before });
    await page.send('Page.navigate', { url: address });
    return page;
  }
  async close() {
    await this.send('Browser.close').catch(() => {});
    await new Promise((done) => (this.process.exitCode === null ? this.process.on('exit', done) : done()));
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5, retryDelay: 200 });
  }
}

export class Page {
  constructor(browser, session, target) {
    Object.assign(this, { browser, session, target, errors: [] });
    browser.listeners.push((message) => {
      if (message.sessionId !== session) return;
      if (message.method === 'Runtime.exceptionThrown')
        this.errors.push(message.params.exceptionDetails.exception?.description ?? message.params.exceptionDetails.text);
      if (message.method === 'Runtime.consoleAPICalled' && ['error', 'warning'].includes(message.params.type))
        this.errors.push(message.params.args.map((a) => a.description ?? a.value).join(' '));
      if (message.method === 'Log.entryAdded' && message.params.entry.level === 'error')
        this.errors.push(`${message.params.entry.text} ${message.params.entry.url ?? ''}`);
    });
  }
  send(method, params) { return this.browser.send(method, params, this.session); }
  // Serves the page's own files from a folder instead of the server, to test them without a build.
  async takeFilesFrom(folder) {
    const types = { '.js': 'text/javascript', '.css': 'text/css', '.html': 'text/html' };
    this.browser.listeners.push(({ method, params, sessionId }) => {
      if (method !== 'Fetch.requestPaused' || sessionId !== this.session) return;
      const { pathname } = new URL(params.request.url), path = join(folder, pathname === '/' ? 'index.html' : pathname.replace('/viewer/', ''));
      if (!existsSync(path)) return void this.send('Fetch.continueRequest', { requestId: params.requestId }).catch(() => {});
      this.send('Fetch.fulfillRequest', { requestId: params.requestId, responseCode: 200, body: readFileSync(path).toString('base64'),
        responseHeaders: [{ name: 'Content-Type', value: types[extname(path)] }] }).catch(() => {});  // of a page that is gone
    });
    await this.send('Fetch.enable', { patterns: [{ urlPattern: '*/viewer/*' }, { urlPattern: 'http://*/', resourceType: 'Document' }] });
  }
  // The value of an expression, which may be a promise.
  async run(expression) {
    const { result, exceptionDetails } = await this.send('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
    if (exceptionDetails) throw new Error(exceptionDetails.exception?.description ?? exceptionDetails.text);
    return result.value;
  }
  async until(expression, seconds = 60) {
    for (const end = Date.now() + 1000 * seconds; Date.now() < end; await new Promise((done) => setTimeout(done, 50)))
      if (await this.run(expression).catch(() => false)) return;
    throw new Error(`${expression} did not become true; the page reports: ${this.errors.join('; ') || 'nothing'}`);
  }
  async screenshot(path) {
    const { data } = await this.send('Page.captureScreenshot', { format: 'png' });
    writeFileSync(path, Buffer.from(data, 'base64'));
  }
  async drop(path, selector = '#file') {
    const { root } = await this.send('DOM.getDocument'), { nodeId } = await this.send('DOM.querySelector', { nodeId: root.nodeId, selector });
    await this.send('DOM.setFileInputFiles', { nodeId, files: [path] });
  }
  close() { return this.browser.send('Target.closeTarget', { targetId: this.target }); }
  async key(key, code = key) {
    const text = key.length === 1 ? key : undefined;
    await this.send('Input.dispatchKeyEvent', { type: 'keyDown', key, code, text });
    await this.send('Input.dispatchKeyEvent', { type: 'keyUp', key, code });
  }
  async mouse(type, x, y, more = {}) { await this.send('Input.dispatchMouseEvent', { type, x, y, button: 'left', clickCount: 1, ...more }); }
  async drag(x, y, dx, dy) {
    await this.mouse('mousePressed', x, y);
    for (let i = 1; i <= 5; ++i) await this.mouse('mouseMoved', x + dx * i / 5, y + dy * i / 5, { buttons: 1 });
    await this.mouse('mouseReleased', x + dx, y + dy);
  }
}
