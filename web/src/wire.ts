// Written by `python -m seerob.wire` from src/seerob/snapshot.py. Do not edit.
/**
 * What goes out: plain frozen data that a recorder, a browser and a report can read.
 *
 * `web/src/wire.ts` is generated from this file by `seerob.wire`; docstrings go along.
 * World frame: right-handed, z up, metres. Quaternions: unit, w first.
 */

/** WebSocket sub-protocol; the server refuses any other. */
export const PROTOCOL = "seerob.v1.msgpack";

/** Hash of the types below; a stale page finds another in `Hello.schema`. */
export const SCHEMA = "cf3c11c1b6fd31e0";

export type Vec3 = [number, number, number];

export type Vec4 = [number, number, number, number];

/** What a limit says of a value. An evaluation, never a certificate. */
export type Verdict =
  | "within"
  | "exceeded"
  | "undecided";

/**
 * Where a number comes from, best first.
 *
 * - `measured`: Heard from the real thing.
 * - `stated`: Published by the maker or by a norm; the source is named.
 * - `given`: Written by the user in the workstation file.
 * - `computed`: Follows from the others by the formula.
 * - `estimated`: By a stated method with a stated error, asked for by the user.
 * - `choice`: What a method leaves open, decided by seerob in the open; the workstation file can choose otherwise.
 * - `assumed`: Nobody gave it; a verdict that needs it is UNDECIDED.
 */
export type Origin =
  | "measured"
  | "stated"
  | "given"
  | "computed"
  | "estimated"
  | "choice"
  | "assumed"
  | "missing";

/** One number that a result was made from. */
export interface Input {
  name: string;
  value: number | string | null;
  unit: string;
  origin: Origin;
  /** Document, file or device; for norms with edition, clause and confidence. */
  source: string;
}

/** Why a result is what it is; enough to defend it line by line. */
export interface Basis {
  formula: string;
  /** Clause and edition of the norm, or equation of the paper. */
  source: string;
  inputs: Input[];
  /** What this number leaves out. */
  not_modelled: string[];
}

/** Something noticed while a model was built that whoever reads a result must know. */
export interface Finding {
  /** `note`, `assumed` or `warning`. */
  level: string;
  /** Full name of the thing it is about. */
  subject: string;
  text: string;
}

/** A vector at a point. */
export interface Arrow {
  type: "arrow";
  origin: Vec3;
  /** From tail to tip [m as drawn]. */
  vector: Vec3;
  label: string;
  verdict: Verdict | null;
}

/** A line between two points, such as a shortest distance. */
export interface Segment {
  type: "segment";
  start: Vec3;
  end: Vec3;
  label: string;
  verdict: Verdict | null;
}

/** A translucent ball. */
export interface Sphere {
  type: "sphere";
  center: Vec3;
  radius: number;
  label: string;
  verdict: Verdict | null;
}

/** A translucent ellipsoid. */
export interface Ellipsoid {
  type: "ellipsoid";
  center: Vec3;
  /** Orientation of the half axes in the world. */
  wxyz: Vec4;
  /** Half axes [m as drawn]. */
  radii: Vec3;
  label: string;
  verdict: Verdict | null;
}

/** A translucent box. */
export interface Box {
  type: "box";
  center: Vec3;
  wxyz: Vec4;
  /** Full edge lengths [m]. */
  size: Vec3;
  label: string;
  verdict: Verdict | null;
}

/** A translucent closed surface, convex or not. */
export interface Hull {
  type: "hull";
  vertices: Vec3[];
  faces: [number, number, number][];
  label: string;
  verdict: Verdict | null;
}

/** Text at a point. */
export interface Label {
  type: "label";
  position: Vec3;
  text: string;
  verdict: Verdict | null;
}

/** A whole body shown in the colour of a verdict. */
export interface Highlight {
  type: "highlight";
  /** Full name of the node. */
  body: string;
  verdict: Verdict | null;
}

export type Marker = Arrow | Segment | Sphere | Ellipsoid | Box | Hull | Label | Highlight;

/**
 * What one criterion says at one instant.
 *
 * A result without a limit has no verdict: it informs. UNDECIDED always carries a reason.
 */
export interface Result {
  name: string;
  /** The figure, in `unit`; None when it could not be had. */
  value: number | null;
  unit: string;
  /** Admissible value, in `unit`. */
  limit: number | null;
  /** Whether the limit bounds from above (a speed) or from below (a distance). */
  at_most: boolean;
  verdict: Verdict | null;
  /** Why UNDECIDED, or what governs: `forearm_link ↔ right hand`. */
  reason: string;
  /** Where the true value lies, given the tolerances of the inputs. */
  interval: [number, number] | null;
  /** The same per link or body area; the worst one gives the verdict. */
  parts: Result[];
  markers: Marker[];
  /** None on parts, which share their parent's, and on the wire, where it is sent once. */
  basis: Basis | null;
  /** Instant it speaks of [s] when that is not the snapshot's (a criterion with a period). */
  t: number | null;
}

/** The twin and its results at one tick. */
export interface Snapshot {
  type: "snapshot";
  seq: number;
  /** Run time [s]. */
  t: number;
  /** Little-endian float32, seven per node of `Scene.nodes`: x, y, z [m], w, x, y, z. */
  poses: Uint8Array;
  /** Joint positions of the twin per robot and human [rad or m]. */
  joints: Record<string, number[]>;
  /** Largest joint error between the twin and what was heard, per robot and human [rad or m]. */
  tracking: Record<string, number>;
  results: Result[];
}

/** One body of the scene; its index is its slot in `Snapshot.poses`. */
export interface Node {
  /** Unique full name, such as `ur10/forearm_link` or `line/fixture/pin_2`. */
  name: string;
  /** `robot`, `tool`, `workpiece`, `part`, `area` or `human`. */
  role: string;
  /** The robot, tool, part or human of the workstation file it belongs to. */
  owner: string;
  /** Hash of its display mesh (binary glTF, metres, z up, in the body's frame), at `/mesh/<hash>.glb`. */
  mesh: string | null;
  triangles: number;
  moves: boolean;
  /** [kg]; None when nobody gave it. */
  mass: number | null;
  mass_origin: Origin;
  /** What to know of its geometry: `envelope, not the maker's mesh`. */
  note: string;
}

/** A criterion of this run. */
export interface CriterionInfo {
  name: string;
  kind: string;
  /** `safety` or `ergonomics`. */
  group: string;
  /** First line of the criterion's documentation. */
  title: string;
  /** Full names it speaks of. */
  subjects: string[];
  unit: string;
  limit: number | null;
  at_most: boolean;
  basis: Basis | null;
}

/** One joint of a robot or human. */
export interface JointInfo {
  name: string;
  /** `rad` or `m`. */
  unit: string;
  lower: number | null;
  upper: number | null;
}

/** A robot or a human, as the page lists it. */
export interface MechanismInfo {
  name: string;
  /** `robot` or `human`. */
  role: string;
  joints: JointInfo[];
}

/** Everything about a run that does not change while it runs; sent once. */
export interface Scene {
  type: "scene";
  title: string;
  /** Edition of the norm that limits are taken from, as the workstation file says. */
  edition: string;
  /** Version of seerob that wrote this. */
  version: string;
  /** SHA-256 of the workstation file and of every file it names. */
  workstation_hash: string;
  /** Tick period [s]. */
  period: number;
  nodes: Node[];
  mechanisms: MechanismInfo[];
  criteria: CriterionInfo[];
  findings: Finding[];
}

/** First message of the server. */
export interface Hello {
  type: "hello";
  server: string;
  /** `live` or `replay`. */
  mode: string;
  /** Length of the recording [s]; None when live. */
  duration: number | null;
  /** Hash of the message types; a page built for another one must be built anew. */
  schema: string;
}

/** One criterion over a stretch of time, for plots and the timeline's lanes. */
export interface Trace {
  name: string;
  /** Little-endian float64 run times [s]. */
  t: Uint8Array;
  /** Little-endian float32, NaN where there was no value. */
  values: Uint8Array;
  /** Little-endian float32, NaN where there was none. */
  limits: Uint8Array;
  /** One byte each: 0 within, 1 exceeded, 2 undecided, 255 none. */
  verdicts: Uint8Array;
}

/** What happened so far (live) or all of it (replay), thinned without losing an extremum. */
export interface History {
  type: "history";
  traces: Trace[];
}

/** State of the player; sent on every change. */
export interface Transport {
  type: "transport";
  playing: boolean;
  t: number;
  speed: number;
  live: boolean;
  /** Whether the player starts again at the end. */
  loop: boolean;
}

/** What a page asks of the server. */
export interface Command {
  type: "command";
  /** `play`, `pause`, `seek`, `speed`, `step`, `loop` or `ack`. */
  action: string;
  /**
   * `seek`: run time [s]; `speed`: factor; `step`: recorded snapshots forward or back;
   * `loop`: 1 or 0; `ack`: `Snapshot.seq` that was received.
   */
  value?: number | null;
}

export type ServerMessage = Hello | Scene | History | Transport | Snapshot;

export type PageMessage = Command;
