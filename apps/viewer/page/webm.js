// SPDX-License-Identifier: Apache-2.0
// Encoders of videos. With WebCodecs each picture has exactly its time, however long it took to draw; else
// (Firefox before 130, Safari before 16.4, pages over plain HTTP from elsewhere) MediaRecorder sees them at its own clock.

const kinds = ['video/webm;codecs=vp9', 'video/webm;codecs=vp8', 'video/webm', 'video/mp4;codecs=avc1.42E01E', 'video/mp4'];
const pause = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

// An encoder { add(canvas, seconds), end() } of pictures of even width and height, or null if the browser has none.
// add() waits until the next picture may come, end() gives the file as a Blob.
export async function videoEncoder(canvas, perSecond) {
  const { width, height } = canvas, bitrate = Math.round(Math.min(Math.max(0.25 * width * height * perSecond, 4e6), 5e7));
  for (const [codec, id] of typeof VideoEncoder === 'undefined' ? [] : [['vp09.00.51.08', 'V_VP9'], ['vp8', 'V_VP8']]) {
    const config = { codec, width, height, bitrate, framerate: perSecond, latencyMode: 'realtime' };
    if ((await VideoEncoder.isConfigSupported(config).catch(() => ({}))).supported) return codecEncoder(config, id);
  }
  const type = typeof MediaRecorder !== 'undefined' && canvas.captureStream && kinds.find((kind) => MediaRecorder.isTypeSupported(kind));
  return type ? streamEncoder(canvas, type, bitrate, perSecond) : null;
}

function codecEncoder(config, id) {
  const blocks = [];
  let failure = null, count = 0;
  const encoder = new VideoEncoder({
    output: (chunk) => { const data = new Uint8Array(chunk.byteLength); chunk.copyTo(data); blocks.push({ at: Math.round(chunk.timestamp / 1000), key: chunk.type === 'key', data }); },
    error: (error) => { failure = error; },
  });
  encoder.configure(config);
  const checked = () => { if (failure) throw new Error(`The browser could not encode the video: ${failure.message}`); };
  return {
    async add(canvas, seconds) {
      const picture = new VideoFrame(canvas, { timestamp: Math.round(1e6 * seconds), duration: Math.round(1e6 / config.framerate) });
      encoder.encode(picture, { keyFrame: count++ % Math.round(config.framerate) === 0 });
      picture.close();
      while (encoder.encodeQueueSize > 3 && !failure) await pause(2);
      checked();
    },
    async end() {
      await encoder.flush().catch(() => {});
      checked();
      encoder.close();
      return new Blob([webm(blocks, id, config, count * 1000 / config.framerate)], { type: 'video/webm' });
    },
  };
}

async function streamEncoder(canvas, type, bitrate, perSecond) {
  const stream = canvas.captureStream(0), [track] = stream.getVideoTracks(), parts = [];
  const recorder = new MediaRecorder(stream, { mimeType: type, videoBitsPerSecond: bitrate });
  recorder.ondataavailable = ({ data }) => parts.push(data);
  const ended = new Promise((done, failed) => { recorder.onstop = done; recorder.onerror = () => failed(new Error('The browser could not encode the video.')); });
  recorder.start();
  let due = 0;
  return {
    async add() {
      track.requestFrame?.();
      due = Math.max(due, performance.now()) + 1000 / perSecond;
      await pause(due - performance.now());
    },
    async end() {
      recorder.stop();
      await ended;
      track.stop();
      return new Blob(parts, { type: type.split(';')[0] });
    },
  };
}

// ---- the container: EBML elements of an id, a size in eight bytes, and contents
const joined = (parts) => {
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => { all.set(part, at); return at + part.length; }, 0);
  return all;
};
const bytesOf = (value, least = 1) => {
  const bytes = [];
  for (let rest = value; rest > 0 || bytes.length < least; rest = Math.floor(rest / 256)) bytes.unshift(rest % 256);
  return Uint8Array.from(bytes);
};
function element(id, contents) {
  const body = typeof contents === 'number' ? bytesOf(contents) : typeof contents === 'string' ? new TextEncoder().encode(contents)
    : Array.isArray(contents) ? joined(contents) : contents;
  return joined([bytesOf(id), Uint8Array.of(1), bytesOf(body.length, 7), body]);
}
function double(value) {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return bytes;
}

// blocks: { at [ms], key, data }; a cluster begins with each key picture.
function webm(blocks, codec, { width, height }, duration) {
  const clusters = [];
  for (const block of blocks) {
    if (block.key || !clusters.length) clusters.push({ at: block.at, parts: [element(0xe7, block.at)] });
    const { at, parts } = clusters.at(-1);
    parts.push(element(0xa3, [Uint8Array.of(0x81), bytesOf(block.at - at, 2), Uint8Array.of(block.key ? 0x80 : 0), block.data]));
  }
  const head = element(0x1a45dfa3, [element(0x4286, 1), element(0x42f7, 1), element(0x42f2, 4), element(0x42f3, 8), element(0x4282, 'webm'), element(0x4287, 2), element(0x4285, 2)]);
  const info = element(0x1549a966, [element(0x2ad7b1, 1e6), element(0x4489, double(duration)), element(0x4d80, 'gflow'), element(0x5741, 'gflow')]);
  const track = element(0xae, [element(0xd7, 1), element(0x73c5, 1), element(0x83, 1), element(0x86, codec), element(0xe0, [element(0xb0, width), element(0xba, height)])]);
  return joined([head, element(0x18538067, [info, element(0x1654ae6b, [track]), ...clusters.map(({ parts }) => element(0x1f43b675, parts))])]);
}
