import assert from "node:assert/strict";
import { test } from "node:test";
import { Worker } from "node:worker_threads";
import { built, load } from "./source.mjs";

const address = await built("poses");
const { PoseReader, PoseWriter, poseBufferBytes } = await import(address);
const bytesOf = (floats) => new Uint8Array(Float32Array.from(floats).buffer);

test("the reader gets the newest block, once", () => {
  const buffer = new SharedArrayBuffer(poseBufferBytes(7));
  const writer = new PoseWriter(buffer);
  const reader = new PoseReader(buffer);
  assert.equal(reader.read(), null);
  for (let k = 1; k <= 5; k += 1) assert.ok(writer.write(bytesOf(Array(7).fill(k)), k / 10, k));
  assert.deepEqual([...reader.read()], Array(7).fill(5));
  assert.equal(reader.t, 0.5);
  assert.equal(reader.read(), null);
});

test("what is being read is never written", () => {
  const buffer = new SharedArrayBuffer(poseBufferBytes(7));
  const writer = new PoseWriter(buffer);
  const reader = new PoseReader(buffer);
  writer.write(bytesOf(Array(7).fill(1)), 1, 1);
  const held = reader.read();
  for (let k = 2; k < 50; k += 1) {
    writer.write(bytesOf(Array(7).fill(k)), k, k);
    assert.deepEqual([...held], Array(7).fill(1));
  }
});

test("a block of another scene is refused", () => {
  const writer = new PoseWriter(new SharedArrayBuffer(poseBufferBytes(14)));
  assert.equal(writer.write(bytesOf(Array(7).fill(1)), 0, 0), false);
});

test("two threads: no torn block and no step back in two thousand reads", async () => {
  const floats = 700;
  const buffer = new SharedArrayBuffer(poseBufferBytes(floats));
  const enough = new Int32Array(new SharedArrayBuffer(4));
  const code = `
    const { workerData } = require("node:worker_threads");
    import(workerData.address).then(({ PoseWriter }) => {
      const writer = new PoseWriter(workerData.buffer);
      const block = new Float32Array(workerData.floats);
      const bytes = new Uint8Array(block.buffer);
      for (let k = 1; Atomics.load(workerData.enough, 0) === 0; k += 1) { block.fill(k); writer.write(bytes, k, k); }
    });`;
  const worker = new Worker(code, { eval: true, workerData: { address, buffer, floats, enough } });
  const ended = new Promise((resolve) => worker.once("exit", resolve));
  const reader = new PoseReader(buffer);
  let last = 0;
  for (let reads = 0; reads < 2000; ) {
    const block = reader.read();
    if (!block) {
      await new Promise(setImmediate);
      continue;
    }
    reads += 1;
    const first = block[0];
    if (first < last || block.some((x) => x !== first))
      assert.fail(`torn or stepped back at ${first} after ${last}`);
    last = first;
  }
  Atomics.store(enough, 0, 1);
  await ended;
  assert.ok(last >= 2000);
});

test("looking back finds the first kept snapshot at or after an instant, within the budget", async () => {
  const { Recent } = await load("recent");
  const recent = new Recent(800, 0.04);
  const at = (t) => new Float64Array(recent.at(t).slice().buffer)[0];
  for (let k = 0; k < 500; k += 1) recent.keep(k / 100, new Uint8Array(Float64Array.of(k / 100).buffer));
  const kept = 4.99 - recent.oldest;
  assert.ok(kept > 90 * 0.04 && kept < 110 * 0.05, `${kept} s are kept`);
  for (const t of [4.01, 3.333, 4.5]) assert.ok(at(t) >= t && at(t) < t + 0.06, `${at(t)} for ${t}`);
  assert.equal(at(0), recent.oldest);
  assert.equal(recent.at(99), null);
});

test("what matters is kept however closely it follows, so that it is found at its own instant", async () => {
  const { Recent } = await load("recent");
  const recent = new Recent(8000, 0.04);
  const message = (k) => new Uint8Array([k]);
  recent.keep(1.0, message(0));
  recent.keep(1.01, message(1));
  recent.keep(1.02, message(2), true);
  recent.keep(1.03, message(3));
  assert.equal(recent.at(1.02)[0], 2);
  assert.equal(recent.at(1.005)[0], 2);
  assert.equal(recent.at(1.03), null);
});
