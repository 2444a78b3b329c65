// Written by `python -m seerob.app.wire` from src/seerob/core/snapshot.py. Do not edit.
/**
 * What goes out: plain frozen data that a recorder, a browser and a report can read.
 *
 * `web/src/wire.ts` is generated from this file by `seerob.app.wire`; docstrings go along.
 * What there are many of in each snapshot (results, rows, aspects, markers) is an array of its fields in this
 * order, so that no name travels with each figure; a new field goes to the end, with a default.
 * World frame: right-handed, z up, metres. Quaternions: unit, w first.
 */

/** WebSocket sub-protocol; the server refuses any other. */
export const PROTOCOL = "seerob.v2.msgpack";

/** Hash of the types below; a stale page finds another in `Hello.schema`. */
export const SCHEMA = "bf9da54d7b9c42dd";

/** A vector at a point. */
export interface Arrow {
  type: "arrow";
  origin: Vec3;
  /** From tail to tip [m as drawn]. */
  vector: Vec3;
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

/** A whole body shown in the colour of a verdict. */
export interface Highlight {
  type: "highlight";
  /** Full name of the node. */
  body: string;
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

export type Marker = Arrow | Segment | Sphere | Ellipsoid | Box | Hull | Polyline | Prism | Rays | Label | Highlight;

/** A line through points, such as the edge of a field on the floor or a path. */
export interface Polyline {
  type: "polyline";
  points: Vec3[];
  /** Whether the last point is joined to the first. */
  closed: boolean;
  label: string;
  verdict: Verdict | null;
}

/** A translucent extruded polygon, convex or not, such as a floor area with a height. */
export interface Prism {
  type: "prism";
  /** Corners x, y in its frame [m], either way round, without crossing itself. */
  outline: [number, number][];
  lower: number;
  /** Between which z of its frame it reaches [m]. */
  upper: number;
  position: Vec3;
  /** Its frame in the world. */
  wxyz: Vec4;
  label: string;
  verdict: Verdict | null;
}

/** What a sensor sees: beams that end where something is in their way, or at their range. */
export interface Rays {
  type: "rays";
  /** One for all of them, such as a scanner's, or one each, such as a light curtain's. */
  starts: Vec3[];
  ends: Vec3[];
  /** Indices of those that end on something that is to be detected; drawn solid, the others faint. */
  hits: number[];
  /** Whether the surface between neighbouring beams is filled: a fan, or a sheet. */
  filled: boolean;
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
  /**
   * Robots, people, machines, parts, variables (`variable door`), or `*` for everything, of which no
   * criterion is WITHIN as long as it stands.
   */
  holds: string[];
}

/**
 * Why a row has, or has not, a figure to compare.
 *
 * - `forbidden`: Contact is not permitted, whatever the figure.
 * - `no_limit`: No limit is available for this place.
 * - `excluded`: Kept out by measures that are not evaluated here.
 * - `not_assessed`: What it needs is not measured or was not entered; never a least score.
 */
export type RowState =
  | "judged"
  | "forbidden"
  | "no_limit"
  | "excluded"
  | "not_assessed";

/** One figure behind a row: an angle of a component, the speed that one of several limits allows. */
export interface Aspect {
  name: string;
  /** None when it is not known or not measured. */
  value: number | null;
  unit: string;
  limit: number | null;
  /** Band of the method into which the value falls, with its thresholds: `20° to 45°`. */
  band: string;
}

/**
 * One line about a place of a person's body: for body map, posture panel and manikin.
 *
 * A component of a score (with `scale`) or a body area with a limit of its own.
 */
export interface Row {
  /** Without its side: `upper arm`, `Palm`; `score` for the total of a side or of the whole. */
  name: string;
  /** Body region or table of the method that it belongs to. */
  group: string;
  /** `left` or `right`; empty for the middle or where both sides are meant. */
  side: string;
  state: RowState;
  value: number | null;
  unit: string;
  /** Greatest admissible value, in `unit`. */
  limit: number | null;
  /** Best and worst score that there can be; None for a quantity. */
  scale: [number, number] | null;
  interval: [number, number] | null;
  verdict: Verdict | null;
  /** What governs, or why there is no verdict. */
  reason: string;
  /** Numbers of specific body areas, ISO/TS 15066:2016 Table A.2, 1 to 29. */
  areas: number[];
  /** Full names of the nodes that it speaks of: `operator/right_hand`. */
  bones: string[];
  aspects: Aspect[];
  /** Names of the inputs of the basis that its limit comes from. */
  inputs: string[];
}

/**
 * What one criterion says at one instant; its basis does not change in a run (`CriterionInfo.basis`).
 *
 * A result with a figure and without a limit has no verdict: it informs. UNDECIDED always carries a reason.
 * One that says nothing is UNDECIDED, unless it says that there is nothing to judge, and why.
 */
export interface Result {
  name: string;
  /** The figure, in `unit`; None when it could not be had. A score or a count is an `int` and exact. */
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
  /** One result per link or body area; the worst one gives the verdict. */
  parts: Result[];
  markers: Marker[];
  /** One row per place of a person's body, where a criterion judges such places. */
  rows: Row[];
  /** Instant it speaks of [s] when that is not the snapshot's (a criterion with a period). */
  t: number | null;
  /** Whether the criterion does not apply now, as a variable says: then it says nothing. */
  muted: boolean;
  /** Whether there is nothing to judge now, and `reason` says why: nobody is near. */
  nothing: boolean;
}

/** What a page's `Measure` or `Reach` came to. */
export interface Measured {
  type: "measured";
  id: number;
  /**
   * Least distance of the surfaces at the instant that was shown (`Result.t`), with the line between them;
   * it has no limit, and an interval where the real surfaces may be nearer than the shapes. Of a `Reach` how
   * far outside of the outline, which its markers are, places can be [m].
   */
  result: Result | null;
  /** Why there is none. */
  refusal: string;
}

/** How a live source is heard, or where targets are sent to. */
export interface SourceLine {
  /** Whether it is heard now, or is let in where it is sent to. */
  heard: boolean;
  /** Mean while heard [1/s]. */
  rate: number | null;
  /** Standard deviation of the interval between arrivals [s]. */
  jitter: number | null;
  /** How much later than its fastest sample the newest one arrived [s]; None where it sends no time. */
  latency: number | null;
  /** How late a sample may be to count [s]. */
  bound: number | null;
  /** Samples with news. */
  received: number;
  /** Samples that its own time says are missing. */
  lost: number;
  /** Times it was lost after it had been heard. */
  losses: number;
  /** Targets and bools that were written to it. */
  sent: number;
  /** Why it was not heard last, or was not let in; empty before that happened. */
  word: string;
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
  /**
   * Of people that devices see: bone → how far the twin's bone is from the device's, position [m] and
   * angle [rad]; null where the device has none.
   */
  bones: Record<string, Record<string, [number | null, number | null]>>;
  /**
   * Per robot and human whose live device sends its time: how much later than the fastest sample the newest
   * one arrived, and how late it may be to count [s].
   */
  late: Record<string, [number, number]>;
  results: Result[];
  /** Nodes whose look follows a variable: red, green, blue in 0…1; null where one is not drawn. */
  looks: Record<string, Vec3 | null>;
  /**
   * Robots, humans, machines (with all that they move, `Node.mover`) and single nodes that may not be where
   * `poses` has them, with the reason.
   */
  doubts: Record<string, string>;
  /**
   * How live sources are heard, and targets sent, by name; told about once a second and for a
   * tenth of one, empty in between.
   */
  sources: Record<string, SourceLine>;
  /** What happened to loose workpieces since the last tick. */
  events: Event[];
}

/** One body of the scene; its index is its slot in `Snapshot.poses`. */
export interface Node {
  /** Unique full name, such as `ur10/forearm_link` or `line/fixture/pin_2`. */
  name: string;
  /** `robot`, `human`, `tool`, `workpiece`, `part`, `machine` or `area`. */
  role: string;
  /** The table entry of the workstation file it belongs to. */
  owner: string;
  /** The robot, human or machine that decides where it is; empty for what stands. */
  mover: string;
  /** Hash of its display mesh (binary glTF, metres, z up, in the body's frame), at `/mesh/<hash>.glb`. */
  mesh: string | null;
  triangles: number;
  moves: boolean;
  /** [kg]; None when nobody gave it. */
  mass: number | null;
  mass_origin: Origin;
  /** What to know of its geometry: `envelope, not the maker's mesh`. */
  note: string;
  /** Whether it exists in the real cell: over that it is not drawn, and hides what is behind it. */
  real: boolean;
}

/** A class of scores that a method acts upon, such as an action level. */
export interface Level {
  /** Highest score that belongs to it. */
  up_to: number;
  /** `action level 2`. */
  name: string;
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
  /**
   * What is known of the time between the instants at which it is asked: empty where it is bounded there,
   * `accepted: …` with the reason, or why nothing is known; then the verdict of a run stays undecided.
   */
  between: string;
  /** Classes of the scores, the lowest first; empty when the method has none. */
  levels: Level[];
}

/** A lever, button or switch that people pull in the twin. */
export interface ControlInfo {
  name: string;
  /** `lever`, `switch`, `button` or `enabling`. */
  kind: string;
  /** What is pulled: an owner of nodes, or a node's full name. */
  of: string;
  /** Variable. */
  sets: string;
  lower: number;
  upper: number;
  start: number;
}

/** One joint of a robot or human. */
export interface JointInfo {
  name: string;
  /** `rad` or `m`. */
  unit: string;
  lower: number | null;
  upper: number | null;
}

/** What one link of a robot, or one thing mounted on it, weighs: a row of its mass table. */
export interface LinkMass {
  /** Full name. */
  name: string;
  /** [kg]; None where nobody knows it. */
  mass: number | null;
  origin: Origin;
  source: string;
  moves: boolean;
  /** Link that it is fixed to and moves as one with; empty for that one itself. */
  merged: string;
  /** Why it weighs nothing, or why its mass is not known. */
  note: string;
}

/** A robot or a human, as the page lists it. */
export interface MechanismInfo {
  name: string;
  /** `robot` or `human`. */
  role: string;
  joints: JointInfo[];
  /** Why what its source says is too coarse for energies and forces; empty when it is not. */
  coarse: string;
  /** What each link of a robot or machine and each thing on it weighs. */
  masses: LinkMass[];
}

/** A point of interest of the cell, and how it is turned. */
export interface Place {
  name: string;
  /** Full name of the node that it goes along with; empty where it stands in the world. */
  node: string;
  /** In that node's frame, or in the world [m]. */
  position: Vec3;
  wxyz: Vec4;
  /** How far it may be from there, standard deviation per axis [m]. */
  accuracy: number;
  /** How far it may be turned from there, standard deviation per axis [rad]; None where nobody says. */
  accuracy_turn: number | null;
  /** What is printed on the board that lies there; empty for none. */
  board: string;
}

/** A robot to which waypoints can be given by hand: the tool point that they are of, and their frame. */
export interface Taught {
  /**
   * Number of the source that has them among `sources` of the workstation file; None while nobody drives
   * the robot, so that it can have one.
   */
  source: number | null;
  robot: string;
  /** The tool point. */
  tip: Place;
  /** In whose frame the file has poses. */
  base: Place;
  /** How many it has already. */
  points: number;
}

/** A camera that looks at the real cell; over its picture the twin is shown. */
export interface CameraInfo {
  name: string;
  /** Width and height of its pictures [px]. */
  size: [number, number];
  /** fx, fy, cx, cy [px], k1, k2, p1, p2, k3, as OpenCV has them. */
  lens: [number, number, number, number, number, number, number, number, number];
  /** Where it is: x to the right, y down, z ahead of it; None where nobody knows. */
  place: Place | null;
  /** What 95 % of the error at `tool` stay within, across the line of sight [m]. */
  error: number | null;
  tool: string;
  /** Root mean square of what corners of boards are off in its pictures [px]. */
  error_px: number | null;
  /**
   * Whether the server has its pictures, at `/camera/<its number here>`; else it is one of the device
   * that shows the page.
   */
  fetched: boolean;
  /** Why the twin is not drawn over its picture; empty where it is. */
  mistake: string;
}

/** Everything about a run that does not change while it runs; sent once. */
export interface Scene {
  type: "scene";
  title: string;
  /**
   * Editions of norms that figures are from, as the bases of the criteria say; and the one that the file
   * asks for, where no figure is from it.
   */
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
  /** What people pull. */
  controls: ControlInfo[];
  /**
   * Person whom a page's headset drives → where the floor of its room lies: position [m], quaternion with w
   * first; x is ahead there, z up.
   */
  headsets: Record<string, [number, number, number, number, number, number, number]>;
  /** By which the room of a visitor, or a camera, is placed in the cell. */
  landmarks: Place[];
  /** Point of interest of each robot, by its name. */
  tips: Place[];
  /** Where waypoints can be added by hand. */
  taught: Taught[];
  /** That look at the real cell. */
  cameras: CameraInfo[];
}

/** What happened to a loose workpiece. */
export interface Event {
  /** Run time [s]. */
  t: number;
  /**
   * `taken`, `handed` (another hand has it now), `torn` (out of a hand or gripper), `placed`,
   * `dropped`, `returned` (to where it begins again), `refused` (a hand could not take it), `round`
   * (a round of work ended) or `filled` (it was the last that a place takes).
   */
  what: string;
  piece: string;
  /** Hand or gripper that did it, such as `operator/right_hand`. */
  by?: string;
  /** Place where it was put, or from which it was taken; empty where it is none. */
  where?: string;
  /**
   * Of `placed` and `dropped` the time since it was taken [s], of `round` its cycle time [s], of
   * `filled` the time since a place was filled before, or since anything was taken first [s].
   */
  took?: number | null;
  /** Of `filled` how many places have been filled so far, in all. */
  count?: number;
  /** Why it was refused or torn out. */
  reason?: string;
}

export type Vec3 = [number, number, number];

export type Vec4 = [number, number, number, number];

/** What a limit says of a value. An evaluation, never a certificate. */
export type Verdict =
  | "within"
  | "exceeded"
  | "undecided";

/** First message of the server. */
export interface Hello {
  type: "hello";
  server: string;
  /** `live`, `replay` or `edit` (no run: where everything is at its begin). */
  mode: string;
  /** Length of the recording [s]; None when there is none. */
  duration: number | null;
  /** Hash of the message types; a page built for another one must be built anew. */
  schema: string;
  /**
   * What this page may do, as its token says: `view`, `track` (offer what a headset sees), `control`
   * (play, pause, seek), `edit` (change the workstation file), `measure` (ask how far things are from one
   * another).
   */
  may: string[];
  /** Number of this visitor, which no other has. */
  visitor: number;
}

/** One criterion over a stretch of time, for plots and the timeline's lanes. */
export interface Trace {
  name: string;
  /** Little-endian float64 run times [s]. */
  t: Uint8Array;
  /** Little-endian float64, NaN where there was no value. */
  values: Uint8Array;
  /** Little-endian float64, NaN where there was none. */
  limits: Uint8Array;
  /** One byte each: 0 within, 1 exceeded, 2 undecided, 255 none. */
  verdicts: Uint8Array;
}

/** What happened so far (live) or all of it (replay), thinned without losing an extremum. */
export interface History {
  type: "history";
  traces: Trace[];
  /** Of another run, on the same axis: to look at, and of no verdict here. */
  beside: Trace[];
  /** What that run is called. */
  beside_title: string;
  /** Why the run that was asked for is not there. */
  beside_refusal: string;
  /** What can be asked for: other runs in the folder of the one that is replayed, newest first. */
  others: string[];
}

/** What one criterion came to. */
export interface CriterionSoFar {
  verdict: Verdict | null;
  /** Share of the run in which it was within or exceeded, 0…1. */
  decided: number;
  undecided: number;
  /** It did not apply. */
  muted: number;
  /** It was asked, and there was nothing to judge, or no limit to judge by. */
  nothing: number;
  /** It was not asked, and nothing says what it would have said. */
  open: number;
  /** Why what was within whenever it was asked is not known to be within throughout. */
  reason: string;
}

/** What the run came to by now (live) or as far as the recording was read; sent when it changes. */
export interface SoFar {
  type: "so_far";
  verdict: Verdict | null;
  /**
   * Least share that a criterion with a verdict decided of the time in which it was muted or had something
   * to judge, 0…1.
   */
  decided: number | null;
  criteria: Record<string, CriterionSoFar>;
  /** Whether that is all of the run. */
  whole: boolean;
  /** How much later than real time a live run is by now, because it fell behind [s]. */
  slipped: number;
  /** Run time at which it fell behind last [s]; None when it never did. */
  slipped_at: number | null;
  /** What happened to loose workpieces, the newest 200 at most. */
  events: Event[];
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

/** What a page's headset sees of the person who wears it; only a live run that waits for it takes it. */
export interface Tracking {
  type: "tracking";
  /** Name of the person in the workstation file. */
  human: string;
  /** On the page's clock [s]. */
  t: number;
  /** `viewer`, `left-grip`, `right-grip`, and joints as WebXR Body Tracking names them. */
  names: string[];
  /**
   * Little-endian float32, seven per name: x, y, z [m], w, x, y, z in `local-floor` (x right, y up,
   * z backward); NaN for what is not tracked.
   */
  poses: Uint8Array;
  /** One byte per name, 1 where the headset itself only estimates the position; empty for nowhere. */
  guessed?: Uint8Array;
  /**
   * Which tracking space that is: another one after each recentring and in each session. Where a room lies
   * in the cell is known of the space in which that was found out.
   */
  space?: string;
  /**
   * Metres of the world in a metre of theirs, as they see it. Poses are in theirs: whoever works at another
   * scale than 1 is judged by postures alone.
   */
  scale?: number;
  /**
   * `tpose` (arms to the sides, palms down) or `npose` (arms hanging) while the wearer says that they
   * stand still in that pose: once they say so no more, what was seen meanwhile calibrates the person.
   */
  stands?: string;
}

/** One step of finding out where the room of a page's headset lies in the cell. */
export interface Register {
  type: "register";
  /** The page's own number, by which it knows the answer. */
  id: number;
  /** The person that the visitor is; empty for one who looks. */
  human?: string;
  /** Which tracking space that is (`Tracking.space`); a step in another one begins anew. */
  space: string;
  /**
   * `sweep` (the controller was turned about its tip), `touch` (the tip is on a landmark), `strapped`
   * (the controller is fixed to what carries a landmark), `known` (the controller lies in the pose of a
   * landmark), `seen` (the device's camera sees the board at a landmark), `check` (as touch, of what is
   * known already), `nudge`, `restore`, `drop` (the last touch or look), `forget`.
   */
  step: string;
  /** Of `touch`, `strapped`, `known`, `seen` and `check`. */
  landmark?: string;
  /**
   * Of the controller while it was held: little-endian float32, seven each as in `Tracking.poses`.
   * `seen`: of the camera, one, as WebXR turns it: x to the right, y up, -z ahead.
   */
  poses?: Uint8Array;
  /**
   * `seen`: corners of the board, as `POST /board` found them: little-endian float32, four each, x and
   * y on the board [m] before x and y in the picture [px].
   */
  corners?: Uint8Array;
  /**
   * `seen`: fx, fy, cx and cy of the picture [px]. `nudge`: translation [m] and rotation vector [rad]
   * in the cell's axes. `restore`: what `Registered` said: its `at`, `about` and `covariance`, 46
   * numbers.
   */
  by?: number[];
}

/** What a page's `Register` came to, and all that is known of where its room lies. */
export interface Registered {
  type: "registered";
  id: number;
  accepted: boolean;
  /** Why the step was refused. */
  reason: string;
  /**
   * Where the floor of the room lies: position [m], quaternion with w first; x is ahead there, z up. Empty
   * while too little is known.
   */
  at: number[];
  /** Point of the cell that `covariance` is about [m]. */
  about: number[];
  /** 36 numbers row by row: translation [m] before rotation [rad], in the cell's axes. */
  covariance: number[];
  /** What 95 % of the error at `tool` stay within [m]. */
  error: number | null;
  /** The robot whose point of interest is meant: of several the one with the largest error. */
  tool: string;
  /** Why nothing rests on where the visitor is all the same; empty when it may. */
  doubt: string;
  /** What was touched so far, in order. */
  landmarks: string[];
  /** How far each is from where the registration puts it [m]. */
  residuals: number[];
  /** What 95 % of the error of the controller's tip stay within [m]; null before it was turned about it. */
  tip: number | null;
}

/** What became of a page's `Tracking`; sent at its first, and when that changes. */
export interface Tracked {
  type: "tracked";
  human: string;
  accepted: boolean;
  /** Why not. */
  reason: string;
  /** Whether the newest calibration that the page asked for (`Tracking.stands`) holds; None before one. */
  fits: boolean | null;
  /** What it found, or why it was refused. */
  found: string;
  /**
   * How many times as tall as the person of the workstation file the wearer is, by the height of the eyes;
   * null when that was not found.
   */
  taller: number | null;
}

/** What a page asks of the server. */
export interface Command {
  type: "command";
  /** `play`, `pause`, `seek`, `speed`, `step`, `loop`, `beside` or `ack`. */
  action: string;
  /**
   * `seek`: run time [s]; `speed`: factor; `step`: recorded snapshots forward or back;
   * `loop`: 1 or 0; `beside`: number in `History.others`, -1 for none;
   * `ack`: `Snapshot.seq` that was received.
   */
  value?: number | null;
}

/** One change of the workstation file. */
export interface Change {
  /** `set` a key, `add` a table to a list, `remove` a key or an entry, or `copy` an entry. */
  kind: string;
  /** Keys and numbers of entries: `["robots", 0, "base", "position"]`; for `add` those of the list. */
  path: (string | number)[];
  /** `set`: the value; `add`: the table; `copy`: what is different in the copy. */
  value: unknown;
}

/** What a page asks of the workstation file, all of it or nothing; only where editing is allowed. */
export interface Edit {
  type: "edit";
  /** The page's own number, by which it knows the answer. */
  id: number;
  /** `change`, `undo`, `redo`, `save`, `discard`, `run` or `stop`. */
  action: string;
  /** `Draft.revision` that the page saw. */
  revision: number;
  changes?: Change[];
  /** Instead of `changes`, the number of those that a CAD file makes that a page brought; 0 for none. */
  brought?: number;
}

/** What a page that may control asks of the twin: how far two things are from one another. */
export interface Measure {
  type: "measure";
  /** The page's own number, by which it knows the answer. */
  id: number;
  /** Full names of bodies, or of all that belongs to a robot, a person or another entry. */
  between: [string, string];
  /** Instant that the page shows [s]; None for the newest. */
  t?: number | null;
}

/** What a page that may control asks of the twin: where somebody can reach. */
export interface Reach {
  type: "reach";
  /** The page's own number, by which it knows the answer; not one of a `Measure`. */
  id: number;
  /** A robot (its working point), a person (both hands), or the full name of a body of them. */
  of: string;
  /** Instant that the page shows [s]; None for the newest. */
  t?: number | null;
}

/** One mistake that an edit would make, in the words of `seerob check-file`. */
export interface Mistake {
  /** The place: `robots[0].base.position`; empty for the whole file. */
  key: string;
  what: string;
  remedy: string;
}

/** What became of a page's `Edit`. */
export interface Edited {
  type: "edited";
  id: number;
  accepted: boolean;
  /** Of the draft now. */
  revision: number;
  /** Why it was refused; nothing is changed then. */
  mistakes: Mistake[];
}

/** The workstation file as it is edited; sent on every change, to each page what it may take back. */
export interface Draft {
  type: "draft";
  file: string;
  revision: number;
  /** What a save would change, as a unified diff; empty for nothing. */
  diff: string;
  /** The file as it is read. */
  tables: Record<string, unknown>;
  /** Whether this page has a change to take back. */
  undo: boolean;
  redo: boolean;
  /** Whether the draft is tried: its run begins anew with every edit, and nothing of it is recorded. */
  runs: boolean;
  /** Why the newest of its runs ended or was not begun; empty otherwise. */
  ended: string;
}

/**
 * Who a visitor is, and where and how large they stand; sent first, and when it changes.
 *
 * A point of their room p [m] (x right, y up, z backward) is in the world at
 * `scale · R(turn) · p + position`.
 */
export interface Introduction {
  type: "introduction";
  /** What others read; `visitor` and a number when empty. Recorded only where the run was told to. */
  name?: string;
  /** `#rrggbb`; one of the server's when empty. */
  color?: string;
  /** Of the head: `ball`, `box`, `cone` or `drop`; one of the server's when empty. */
  shape?: string;
  /** `desk`, `vr`, `ar` or `program`. */
  device?: string;
  /** Person of the workstation file whom they are; empty for nobody. */
  human?: string;
  /** Metres of the world in a metre of theirs: 10 for a visitor ten times as large. */
  scale?: number;
  /** Where the floor of their room lies in the world [m]. */
  position?: Vec3;
  /** How the axes of their room are turned in the world, unit quaternion, w first. */
  turn?: Vec4;
  /** Whether they ask the others to follow them. */
  calls?: boolean;
}

/** Where a visitor is now, in the world. */
export interface Presence {
  type: "presence";
  /**
   * Little-endian float32, seven each of head, left and right hand: x, y, z [m], w, x, y, z; the axes of
   * each are right, up and backward; NaN for what is not there.
   */
  poses: Uint8Array;
  /** Little-endian float32, x, y, z [m] of joints of body and hands that the device sees. */
  points?: Uint8Array;
  /** Little-endian float32: from where to where they point, six numbers [m]; empty when they do not. */
  laser?: Uint8Array;
}

/**
 * What a page of `seerob edit` has in its hands: all of it, said again every second.
 *
 * What is not said again for two seconds is let go.
 */
export interface Hold {
  type: "hold";
  /** Entries of the workstation file by name, such as `ur10`; none when nothing is held. */
  names: string[];
}

/** One visitor, as all others know them. */
export interface VisitorInfo {
  /** Number that `Hello.visitor` told them; no other visitor of this server ever has it. */
  id: number;
  /**
   * `viewer`, `operator` or `supervisor`, as the token says; where none is asked for, `operator` of
   * whoever is a person and `supervisor` of others.
   */
  role: string;
  /** Whether they said who they are; if not, name, colour and shape are the server's. */
  introduced: boolean;
  name: string;
  color: string;
  shape: string;
  device: string;
  human: string;
  scale: number;
  position: Vec3;
  turn: Vec4;
  calls: boolean;
  /** What nobody else may change meanwhile. */
  holds: string[];
  /** Whether they were there when what is replayed was recorded; then the number is negative. */
  recorded: boolean;
}

/** What a hand of the person whose headset a page is holds from now on. */
export interface Grab {
  type: "grab";
  /** Full name: `operator/right_hand`. */
  hand: string;
  /** Loose workpiece; empty where it lets go. */
  piece?: string;
}

/** A control that somebody pulls, presses or lets go; while it is held, said four times a second. */
export interface Pull {
  type: "pull";
  control: string;
  /** In SI; 1 and 0 of a bool. */
  value: number;
}

/** Why a `Grab` or `Pull` of a page is not taken. */
export interface Refused {
  type: "refused";
  /** Hand or control. */
  what: string;
  reason: string;
}

/** Who is there; to whoever has introduced themselves, then and on every change. */
export interface Visitors {
  type: "visitors";
  visitors: VisitorInfo[];
}

/** Where one visitor is; what they said last, see `Presence`. */
export interface VisitorPresence {
  id: number;
  poses: Uint8Array;
  points: Uint8Array;
  laser: Uint8Array;
}

/** Where all are who said so, in the order of `Visitors`; of several only the newest is sent. */
export interface Presences {
  type: "presences";
  visitors: VisitorPresence[];
}

export const DEFAULTS = {
  snapshot: { joints: {}, tracking: {}, bones: {}, late: {}, results: [], looks: {}, doubts: {}, sources: {}, events: [] },
};

export const FIELDS = {
  result: ["name", "value", "unit", "limit", "at_most", "verdict", "reason", "interval", "parts", "markers", "rows", "t", "muted", "nothing"],
  row: ["name", "group", "side", "state", "value", "unit", "limit", "scale", "interval", "verdict", "reason", "areas", "bones", "aspects", "inputs"],
  aspect: ["name", "value", "unit", "limit", "band"],
  arrow: ["type", "origin", "vector", "label", "verdict"],
  segment: ["type", "start", "end", "label", "verdict"],
  sphere: ["type", "center", "radius", "label", "verdict"],
  ellipsoid: ["type", "center", "wxyz", "radii", "label", "verdict"],
  box: ["type", "center", "wxyz", "size", "label", "verdict"],
  hull: ["type", "vertices", "faces", "label", "verdict"],
  polyline: ["type", "points", "closed", "label", "verdict"],
  prism: ["type", "outline", "lower", "upper", "position", "wxyz", "label", "verdict"],
  rays: ["type", "starts", "ends", "hits", "filled", "label", "verdict"],
  label: ["type", "position", "text", "verdict"],
  highlight: ["type", "body", "verdict"],
} as const;

export type ServerMessage = Hello | Scene | History | SoFar | Transport | Snapshot | Tracked | Registered | Draft | Edited | Measured | Visitors | Presences | Refused;

export type PageMessage = Command | Tracking | Register | Edit | Measure | Reach | Introduction | Presence | Hold | Grab | Pull;
