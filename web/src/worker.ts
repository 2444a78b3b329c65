// Beside the page: the socket, decoding, the pose buffer, and what was heard lately. The screen never
// waits for the network, and the network never waits for the screen.

import { Decoder } from "@msgpack/msgpack";
import { completed, completedMeasure } from "./completed";
import { countOf, HEAD, numbersOf } from "./form";
import {
  DRAWN,
  type Frame,
  type FromWorker,
  PANELS,
  type Shown,
  type ToldMarker,
  type ToldResult,
  type ToWorker,
} from "./messages";
import { PointCollector } from "./points";
import { FLOATS_PER_NODE, FormNumbers, numberBufferBytes, PoseWriter, poseBufferBytes } from "./poses";
import { Recent } from "./recent";
import { Socket } from "./socket";
import type { Marker, Result, Scene, ServerMessage, Snapshot } from "./wire";

const RECENT_BYTES = 64 * 1024 * 1024;
const RECENT_SPACING_S = 0.04;
const POINTS_EVERY_MS = 80;
/** A live run that says nothing for so long is not trusted any more; a slow one, for three of its ticks. */
const SILENCE_MS = 300;
const LISTEN_EVERY_MS = 50;
/** Snapshots that are acknowledged together: an eighth of what may be on its way. */
const ACKNOWLEDGED = 4;

let socket: Socket | null = null;
let mayShare = false;
let live = false;
let writer: PoseWriter | null = null;
let poseBytes = 0;
let lookingAt: number | null = null;
/** What the page asks; in its own memory, too, where that can be shared. */
let asks: Int32Array = new Int32Array([0, 1]);
let asksShared: SharedArrayBuffer | null = null;
/** Not drawn yet, and not read by panels yet. */
let waiting: { shown: Shown; poses: Uint8Array; seq: number } | null = null;
let unread: Frame | null = null;
/** What the page was told last, as far as not its numbers alone have changed since, and those. */
let form: Shown | null = null;
let formId = 0;
let numbers = new Float64Array();
let numbersShared: SharedArrayBuffer | null = null;
let numbersWriter: FormNumbers | null = null;
let newest = Number.NaN;
let newestRaw: Uint8Array | null = null;
/** When the newest snapshot came [ms since 1970]. */
let heardAt = Number.NEGATIVE_INFINITY;
let silence = SILENCE_MS;
/** Whether the newest came soon after another: one that was on its way when the run was stopped is old. */
let steady = false;
let saidSilent = false;
/** Snapshots since the last acknowledgement. */
let unheard = 0;
/** A live run that has ended: no present any more. */
let ended = false;
const spare: ArrayBuffer[] = [];
const collector = new PointCollector();
const recent = new Recent(RECENT_BYTES, RECENT_SPACING_S);
const decoder = new Decoder();

const post = (message: FromWorker, transfer: Transferable[] = []): void => {
  self.postMessage(message, { transfer });
};

function received(message: ServerMessage, raw: Uint8Array): void {
  switch (message.type) {
    case "snapshot":
      heard(completed(message), raw);
      return;
    case "scene":
      begin(message);
      return;
    case "hello":
      live = message.mode === "live";
      post({ kind: "hello", hello: message });
      return;
    case "history":
      post({ kind: "history", history: message });
      return;
    case "transport":
      ended = !message.playing;
      post({ kind: "transport", transport: message });
      return;
    case "so_far":
      post({ kind: "so_far", soFar: message });
      return;
    case "tracked":
      post({ kind: "tracked", tracked: message });
      return;
    case "visitors":
      post({ kind: "visitors", visitors: message.visitors });
      return;
    case "presences":
      post({ kind: "presences", presences: message });
      return;
    case "refused":
      post({ kind: "refused", refused: message });
      return;
    case "draft":
      post({ kind: "draft", draft: message });
      return;
    case "registered":
      post({ kind: "registered", registered: message });
      return;
    case "measured":
      post({ kind: "measured", measured: completedMeasure(message) });
      return;
    case "edited":
      post({ kind: "edited", edited: message });
      return;
  }
}

function begin(scene: Scene): void {
  const floats = scene.nodes.length * FLOATS_PER_NODE;
  poseBytes = floats * 4;
  const shared = mayShare ? new SharedArrayBuffer(poseBufferBytes(floats)) : null;
  writer = shared ? new PoseWriter(shared) : null;
  lookingAt = null;
  form = waiting = unread = null;
  newest = Number.NaN;
  newestRaw = null;
  silence = Math.max(SILENCE_MS, 3000 * scene.period);
  recent.clear();
  collector.clear();
  if (mayShare && !asksShared) {
    asksShared = new SharedArrayBuffer(asks.byteLength);
    asks = new Int32Array(asksShared);
  }
  // What panels were sent last the page may have thrown away with the scene before.
  Atomics.store(asks, PANELS, 1);
  post({ kind: "scene", scene, shared, asks: asksShared });
}

function heard(snapshot: Snapshot, raw: Uint8Array): void {
  unheard += 1;
  if (unheard >= ACKNOWLEDGED) {
    unheard = 0;
    socket?.send({ type: "command", action: "ack", value: snapshot.seq });
  }
  if (snapshot.poses.byteLength !== poseBytes) return; // belongs to another scene
  newest = snapshot.t;
  const at = clock();
  steady = at - heardAt <= silence;
  heardAt = at;
  saidSilent = false;
  if (live) {
    collector.add(snapshot);
    // One may go to the worst instant of an exceedance, and a neighbour would show another verdict.
    const exceeded = snapshot.results.some((result) => result.verdict === "exceeded");
    recent.keep(snapshot.t, raw, exceeded);
    newestRaw = raw;
  }
  if (lookingAt === null) show(snapshot);
}

// Told now and then; what was told last stands.
let sources: Snapshot["sources"] = {};

function show(snapshot: Snapshot): void {
  const { seq, t, joints, tracking, late, results, looks, doubts } = snapshot;
  if (Object.keys(snapshot.sources).length > 0) sources = snapshot.sources;
  unread = { seq, t, joints, tracking, late, results: results.map(toldOf), looks, doubts, sources };
  waiting = { shown: drawnOf(snapshot), poses: snapshot.poses, seq };
  deliver();
}

// Latest wins: what is not drawn yet, or not read yet, is replaced. Bodies are never ahead of what is said of them.
function deliver(): void {
  if (unread && Atomics.load(asks, PANELS) === 1) {
    Atomics.store(asks, PANELS, 0);
    post({ kind: "frame", frame: unread });
    unread = null;
  }
  if (!waiting) return;
  const { shown, poses, seq } = waiting;
  if (form && numbersWriter && numbersOf(form, shown, numbers, HEAD) === numbers.length) {
    numbers[0] = shown.t;
    numbers[1] = heardAt;
    numbers[2] = isSilent() ? 1 : 0;
    numbersWriter.write(numbers, formId);
  } else if (Atomics.load(asks, DRAWN) === formId) told(shown);
  else return;
  waiting = null;
  if (writer) {
    writer.write(poses, shown.t, seq, formId);
    return;
  }
  let buffer = spare.pop();
  if (!buffer || buffer.byteLength !== poseBytes) buffer = new ArrayBuffer(poseBytes);
  new Uint8Array(buffer).set(poses);
  post({ kind: "poses", buffer, t: shown.t, seq }, [buffer]);
}

function told(shown: Shown): void {
  form = shown;
  formId += 1;
  numbers = new Float64Array(HEAD + countOf(shown));
  if (mayShare && !(numbersWriter && numbersWriter.room >= numbers.length)) {
    numbersShared = new SharedArrayBuffer(numberBufferBytes(2 * numbers.length));
    numbersWriter = new FormNumbers(numbersShared);
  }
  post({ kind: "form", id: formId, shown, numbers: numbersShared, heard: heardAt, silent: isSilent() });
}

// Without where markers are: the browser copies for the page what it is told, four times a second and more.
function toldOf(result: Result): ToldResult {
  return { ...result, parts: result.parts.map(toldOf), markers: result.markers.map(writtenOf) };
}

function writtenOf(marker: Marker): ToldMarker {
  const { type, verdict } = marker;
  if ("label" in marker) return { type, verdict, label: marker.label };
  return marker.type === "label" ? { type, verdict, text: marker.text } : { type, verdict };
}

// Without what is written: that the panels say.
function drawnOf({ t, looks, doubts, results }: Snapshot): Shown {
  return {
    t,
    looks,
    doubts,
    results: results.map(({ name, value, limit, at_most, verdict, markers }) => {
      return { name, value, limit, at_most, verdict, markers };
    }),
  };
}

const clock = () => performance.timeOrigin + performance.now();
const isSilent = () => live && (ended || !steady || clock() - heardAt > silence);

// Here, because the page itself may be late: what it has not drawn yet is no silence.
setInterval(() => {
  // What the page asked for since the newest came.
  deliver();
  if (saidSilent || !isSilent()) return;
  saidSilent = true;
  post({ kind: "silence" });
}, LISTEN_EVERY_MS);

function look(t: number | null): void {
  lookingAt = t;
  if (t === null) return;
  const raw = recent.at(t) ?? newestRaw;
  if (raw) show(completed(decoder.decode(raw) as Snapshot));
}

setInterval(() => {
  if (!live) return;
  const points = collector.take();
  const transfer = points.flatMap((p) => [p.t.buffer, p.values.buffer, p.limits.buffer, p.verdicts.buffer]);
  if (points.length > 0) post({ kind: "points", points, newest, oldest: recent.oldest }, transfer);
}, POINTS_EVERY_MS);

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  switch (message.kind) {
    case "connect":
      mayShare = message.shared;
      socket = new Socket(message.url, {
        message: received,
        state: (state, reason, retryInMs) => post({ kind: "link", state, reason, retryInMs }),
      });
      return;
    case "asks":
      asks[DRAWN] = message.drawn;
      if (message.panels === 1) asks[PANELS] = 1;
      deliver();
      return;
    case "recycle":
      spare.push(message.buffer);
      return;
    case "command":
      socket?.send({ type: "command", action: message.action, value: message.value });
      return;
    case "doing":
      socket?.send(message.doing);
      return;
    case "register":
      socket?.send(message.asked);
      return;
    case "tracking":
      socket?.send(message.tracking);
      return;
    case "company":
      socket?.send(message.said);
      return;
    case "measure":
      socket?.send(message.measure);
      return;
    case "edit":
      socket?.send(message.edit);
      return;
    case "look":
      look(message.t);
      return;
  }
};
