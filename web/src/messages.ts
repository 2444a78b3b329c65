// What the worker and the page tell each other. The worker owns the socket; the page owns the screen.

import type {
  Draft,
  Edit,
  Edited,
  Grab,
  Hello,
  History,
  Hold,
  Introduction,
  Marker,
  Measure,
  Measured,
  Presence,
  Presences,
  Pull,
  Reach,
  Refused,
  Register,
  Registered,
  Result,
  Scene,
  Snapshot,
  SoFar,
  Tracked,
  Tracking,
  Transport,
  Verdict,
  Visitors,
} from "./wire";

/** What a page asks of the server; `ack` is the worker's own affair. */
export type Action = "play" | "pause" | "seek" | "speed" | "step" | "loop" | "beside";

export type LinkState = "connecting" | "open" | "lost" | "refused";

/** One point of one criterion per received snapshot, for plots and lanes while live. */
export interface TracePoints {
  name: string;
  t: Float64Array;
  values: Float64Array;
  limits: Float64Array;
  /** 0 within, 1 exceeded, 2 undecided, 255 none. */
  verdicts: Uint8Array;
}

/** What panels write of a marker: where it is the room alone needs. */
export interface ToldMarker {
  type: Marker["type"];
  verdict: Verdict | null;
  label?: string;
  text?: string;
}
export type ToldResult = Omit<Result, "markers" | "parts"> & { parts: ToldResult[]; markers: ToldMarker[] };

/** A snapshot without its poses, and without where markers are: those travel through shared memory. */
export interface Frame {
  seq: number;
  t: number;
  joints: { [name: string]: number[] };
  tracking: { [name: string]: number };
  late: Snapshot["late"];
  results: ToldResult[];
  looks: Snapshot["looks"];
  doubts: Snapshot["doubts"];
  /** What was told last of them. */
  sources: Snapshot["sources"];
}

/** What of a frame is drawn in the room: numbers are read more slowly than bodies move. */
export interface Shown extends Pick<Frame, "t" | "looks" | "doubts"> {
  results: readonly ShownResult[];
}
export type ShownResult = Pick<Result, "name" | "value" | "limit" | "at_most" | "verdict" | "markers">;
/** What is written in the room. */
export type WrittenResult = Omit<ShownResult, "markers"> & { markers: readonly ToldMarker[] };

/** Where of what a page asks of the worker it says which form it has drawn, and whether its panels can take numbers. */
export const DRAWN = 0;
export const PANELS = 1;

export type FromWorker =
  | { kind: "link"; state: LinkState; reason: string; retryInMs: number | null }
  | { kind: "hello"; hello: Hello }
  | { kind: "scene"; scene: Scene; shared: SharedArrayBuffer | null; asks: SharedArrayBuffer | null }
  | { kind: "history"; history: History }
  | { kind: "transport"; transport: Transport }
  /** What the run came to. */
  | { kind: "so_far"; soFar: SoFar }
  /** What became of what this page's headset sees. */
  | { kind: "tracked"; tracked: Tracked }
  /** Why what this page did in the room was not taken. */
  | { kind: "refused"; refused: Refused }
  | { kind: "draft"; draft: Draft }
  /** What became of what this page asked of the file. */
  | { kind: "edited"; edited: Edited }
  | { kind: "measured"; measured: Measured }
  | { kind: "visitors"; visitors: Visitors["visitors"] }
  | { kind: "presences"; presences: Presences }
  /** Where the room of this page's headset lies, as far as is known. */
  | { kind: "registered"; registered: Registered }
  /** For the panels. */
  | { kind: "frame"; frame: Frame }
  /**
   * For the room: what has another form than before; its numbers alone come through shared memory, where there is some.
   * `heard` is when the newest snapshot came [ms since 1970]; `silent`: too long ago for a live run.
   */
  | {
      kind: "form";
      id: number;
      shown: Shown;
      numbers: SharedArrayBuffer | null;
      heard: number;
      silent: boolean;
    }
  /** A live run has said nothing for too long. */
  | { kind: "silence" }
  | { kind: "points"; points: TracePoints[]; newest: number; oldest: number }
  | { kind: "poses"; buffer: ArrayBuffer; t: number; seq: number };

export type ToWorker =
  | { kind: "connect"; url: string; shared: boolean }
  /** Where memory cannot be shared, which form the page has drawn, and whether its panels can take numbers. */
  | { kind: "asks"; drawn: number; panels: number }
  | { kind: "recycle"; buffer: ArrayBuffer }
  | { kind: "command"; action: Action; value: number | null }
  | { kind: "tracking"; tracking: Tracking }
  | { kind: "doing"; doing: Grab | Pull }
  | { kind: "register"; asked: Register }
  | { kind: "edit"; edit: Edit }
  | { kind: "measure"; measure: Measure | Reach }
  /** What this visitor says of themselves. */
  | { kind: "company"; said: Introduction | Presence | Hold }
  /** While live: show the kept snapshot of this run time, or follow the newest (null). */
  | { kind: "look"; t: number | null };
