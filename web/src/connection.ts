// The page's end of the worker: what it says becomes signals, traces and poses.

import { heardPresences, heardVisitors, ownDevice } from "./company";
import { refused } from "./doing";
import { draft, heardEdited, lostDraft } from "./editing/draft";
import { Form } from "./form";
import { DRAWN, type Frame, type FromWorker, PANELS, type ToldResult, type ToWorker } from "./messages";
import {
  beginScene,
  besideRefusal,
  besideTitle,
  besideTraces,
  frame,
  hello,
  isLive,
  link,
  lookingAt,
  otherRuns,
  reach,
  registered,
  shownAt,
  soFar,
  stale,
  traces,
  tracesRevision,
  tracked,
  transport,
} from "./page_state";
import { FormNumbers, PoseReader } from "./poses";
import { numbersEveryMs } from "./scene/effort";
import { traceFromWire } from "./traces";
import { STATE_ORDER, stateOf } from "./verdicts";
import { heardMeasured } from "./view/measure";
import { heardReach } from "./view/reach";
import { type History, SCHEMA, type Scene } from "./wire";

/** In the room panels are drawn no faster, and nobody sees the page. */
const NUMBERS_IN_ROOM_MS = 240;
/** A frame of a live run that is older is not trusted any more, whatever holds up page or worker. */
const OLD_MS = 1000;
/** When the page began [ms since 1970]. */
const BEGUN = performance.timeOrigin;
/** Points per trace of a live run; a recording comes thinned already. */
const LIVE_POINTS = 40_000;

/** Where the display loop gets poses from. */
export interface PoseFeed {
  /** The newest block, once; valid until the next call. */
  read(): Float32Array | null;
  /** Run time of the block that `read` returned last [s]. */
  readonly t: number;
}

export interface ConnectionEvents {
  scene(scene: Scene, poses: PoseFeed): void;
  /**
   * What is drawn now, at up to the display's rate: markers follow the poses, numbers of panels need not.
   *
   * @param numbers Those of the form, when it has others now; valid during the call.
   */
  drawn(form: Form, numbers: Float64Array | null): void;
}

export class Connection {
  private readonly worker = new Worker(new URL("./worker.ts", import.meta.url), { type: "module" });
  private posted: PostedPoses | null = null;
  private poses: PoseReader | null = null;
  /** When the newest that is known here came [ms since 1970], and whether that is too long ago. */
  private heard = Number.NEGATIVE_INFINITY;
  private silent = false;
  private numbersAt = 0;
  private pending: Frame | null = null;
  /** Whether the panels were sent what they asked for. */
  private asked = true;
  /** What the page asks of the worker, in memory that both share; null where it cannot be shared. */
  private asks: Int32Array | null = null;
  private form: Form | null = null;
  private formId = 0;
  private drawnId = 0;
  private numbers: FormNumbers | null = null;
  /** Run time of what is drawn [s]; panels may be behind it. */
  shownT = Number.NaN;

  constructor(private readonly events: ConnectionEvents) {
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.receive(event.data);
    const url = new URL(`/ws${location.search}`, location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    this.send({ kind: "connect", url: url.href, shared: globalThis.crossOriginIsolated === true });
    setInterval(() => this.watch(), 200);
  }

  send(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  /** To be called once per display frame: passes on numbers that came and asks for those that are due. */
  tick(time: number): void {
    if (this.pending) this.publish(this.pending, time);
    const numbers = this.numbers?.read();
    if (numbers && this.form) {
      this.heard = numbers[1]!;
      this.silent = numbers[2] === 1;
      this.shownT = numbers[0]!;
      this.show(this.form, numbers);
    }
    const drawn = this.drawnId !== this.formId;
    const due = !this.asked && this.due(time);
    if (!drawn && !due) return;
    this.drawnId = this.formId;
    this.asked ||= due;
    if (!this.asks) this.send({ kind: "asks", drawn: this.drawnId, panels: this.asked ? 1 : 0 });
    else {
      Atomics.store(this.asks, DRAWN, this.drawnId);
      if (due) Atomics.store(this.asks, PANELS, 1);
    }
  }

  /** Give panels, of the page or in the room, what they asked for. */
  private publish(heard: Frame, time: number): void {
    this.numbersAt = time;
    this.pending = null;
    this.asked = false;
    if (ownDevice.peek() !== "desk") shownAt[0] = heard.t;
    frame.value = heard;
  }

  private due(time: number): boolean {
    return time - this.numbersAt >= (ownDevice.peek() === "desk" ? numbersEveryMs() : NUMBERS_IN_ROOM_MS);
  }

  private receive(message: FromWorker): void {
    switch (message.kind) {
      case "link":
        if (link.value.state !== "refused") link.value = { state: message.state, reason: message.reason };
        if (message.state !== "open") {
          stale.value = true;
          lostDraft();
        }
        return;
      case "hello":
        hello.value = message.hello;
        if (message.hello.schema !== SCHEMA) {
          link.value = {
            state: "refused",
            reason: "page and server are of different versions; reload, or rebuild the page",
          };
        }
        reach.value = { start: 0, end: message.hello.duration ?? 0 };
        return;
      case "scene":
        this.asks = message.asks && new Int32Array(message.asks);
        this.begin(message.scene, message.shared);
        return;
      case "history":
        this.history(message.history);
        return;
      case "transport":
        transport.value = message.transport;
        return;
      case "so_far":
        soFar.value = message.soFar;
        return;
      case "tracked":
        tracked.value = message.tracked;
        return;
      case "visitors":
        heardVisitors(message.visitors);
        return;
      case "presences":
        heardPresences(message.presences);
        return;
      case "refused":
        refused.value = message.refused;
        return;
      case "draft":
        draft.value = message.draft;
        return;
      case "registered":
        registered.value = message.registered;
        return;
      case "measured":
        if (!heardReach(message.measured)) heardMeasured(message.measured);
        return;
      case "edited":
        heardEdited(message.edited);
        return;
      case "points":
        for (const points of message.points) traces.get(points.name)?.append(points);
        reach.value = {
          start: Number.isNaN(message.oldest) ? message.newest : message.oldest,
          end: message.newest,
        };
        tracesRevision.value += 1;
        return;
      case "poses":
        this.posted?.put(message.buffer, message.t);
        return;
      case "frame":
        this.pending = message.frame;
        return;
      case "form":
        this.heard = message.heard;
        this.silent = message.silent;
        this.form = new Form(message.shown);
        this.formId = message.id;
        this.numbers = message.numbers && new FormNumbers(message.numbers);
        if (this.numbers) this.numbers.form = message.id;
        if (this.poses) this.poses.form = message.id;
        this.shownT = message.shown.t;
        this.show(this.form, null);
        return;
      case "silence":
        this.silent = true;
        this.watch();
        return;
    }
  }

  private begin(scene: Scene, shared: SharedArrayBuffer | null): void {
    this.pending = null;
    this.asked = true;
    this.form = null;
    beginScene(scene);
    this.posted = shared ? null : new PostedPoses((buffer) => this.send({ kind: "recycle", buffer }));
    this.poses = shared && new PoseReader(shared);
    this.numbers = null;
    this.events.scene(scene, this.poses ?? this.posted!);
  }

  private history(history: History): void {
    let start = Number.POSITIVE_INFINITY;
    for (const wire of history.traces) {
      const trace = traceFromWire(wire, isLive.value ? LIVE_POINTS : Number.POSITIVE_INFINITY);
      traces.set(wire.name, trace);
      if (trace.length > 0) start = Math.min(start, trace.t[0]!);
    }
    besideTraces.clear();
    for (const wire of history.beside ?? [])
      besideTraces.set(wire.name, traceFromWire(wire, Number.POSITIVE_INFINITY));
    besideTitle.value = history.beside_title ?? "";
    besideRefusal.value = history.beside_refusal ?? "";
    otherRuns.value = history.others ?? [];
    if (!isLive.value && Number.isFinite(start))
      reach.value = { start: Math.min(start, reach.value.end), end: reach.value.end };
    tracesRevision.value += 1;
  }

  private show(form: Form, numbers: Float64Array | null): void {
    // Whatever got worse is not waited for: no text says within beside what is drawn as exceeded.
    const before = (this.pending ?? frame.peek())?.results;
    if (before && worse(form, numbers, before)) this.numbersAt = Number.NEGATIVE_INFINITY;
    // In the room the cursor is of the figures on the panels there.
    if (ownDevice.peek() === "desk") shownAt[0] = this.shownT;
    this.watch();
    this.events.drawn(form, numbers);
  }

  // Live numbers that stopped coming must not stay on the screen as if they were true.
  private watch(): void {
    if (link.value.state !== "open") stale.value = true;
    else if (isLive.value && lookingAt.value === null)
      stale.value = this.silent || BEGUN + performance.now() - this.heard > OLD_MS;
    else stale.value = frame.value === null && this.pending === null;
  }
}

/** Whether any result is in a worse state than the one before. */
function worse(form: Form, numbers: Float64Array | null, before: readonly ToldResult[]): boolean {
  const { results } = form.shown;
  for (let k = 0; k < results.length; k += 1) {
    const other = before[k];
    if (other?.name !== results[k]!.name) continue;
    if (STATE_ORDER.indexOf(form.stateOf(k, numbers)) < STATE_ORDER.indexOf(stateOf(other))) return true;
  }
  return false;
}

/** Poses that came by message, where memory cannot be shared. */
class PostedPoses implements PoseFeed {
  t = Number.NaN;
  private newest: Float32Array | null = null;
  private newestT = Number.NaN;
  private shown: Float32Array | null = null;

  constructor(private readonly recycle: (buffer: ArrayBuffer) => void) {}

  put(buffer: ArrayBuffer, t: number): void {
    this.newestT = t;
    if (this.newest) this.recycle(this.newest.buffer as ArrayBuffer);
    this.newest = new Float32Array(buffer);
  }

  read(): Float32Array | null {
    if (!this.newest) return null;
    if (this.shown) this.recycle(this.shown.buffer as ArrayBuffer);
    this.shown = this.newest;
    this.t = this.newestT;
    this.newest = null;
    return this.shown;
  }
}
