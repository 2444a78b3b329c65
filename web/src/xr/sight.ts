// What a headset sees of the person who wears it, at one of its pictures: head, hands, body joints.

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Tracking } from "../wire";

/** Floats per name: x, y, z [m], w, x, y, z. */
const FLOATS = 7;
/** Names per message at most; the server takes no more. */
const MOST = 160;

/** What a frame knows of a body, where the browser has Body Tracking. */
interface BodyFrame extends XRFrame {
  readonly body?: ReadonlyMap<string, XRSpace>;
}

/** `left-hand-index-metacarpal` of a hand's `index-finger-metacarpal`, as Body Tracking names it. */
export function handName(side: string, joint: string): string {
  return `${side}-hand-${joint.replace("-finger", "")}`;
}

const SIDES: readonly string[] = ["left", "right"];

/** What is tracked: names, each once, and spaces with the row of their name; first what counts most, as there is a most. */
class Tracked {
  names: string[] = [];
  spaces: XRSpace[] = [];
  rows: number[] = [];
  poses = new Float32Array(0);
  guessed = new Uint8Array(0);
  private sources: XRInputSource[] = [];
  private hands: (XRHand | undefined)[] = [];
  private body = -1;

  /** Find out anew what there is, where that has changed: a picture allocates nothing of ours. */
  look(frame: BodyFrame, sources: ArrayLike<XRInputSource>): this {
    if (!this.same(frame, sources)) this.list(frame, Array.from(sources));
    return this;
  }

  private same({ body }: BodyFrame, sources: ArrayLike<XRInputSource>): boolean {
    if (sources.length !== this.sources.length || (body?.size ?? -1) !== this.body) return false;
    for (let k = 0; k < sources.length; k += 1)
      if (sources[k] !== this.sources[k] || sources[k]!.hand !== this.hands[k]) return false;
    return true;
  }

  private list({ body }: BodyFrame, sources: XRInputSource[]): void {
    this.sources = sources;
    this.hands = sources.map(({ hand }) => hand);
    this.body = body?.size ?? -1;
    this.names = ["viewer"];
    this.spaces = [];
    this.rows = [];
    const named = sources.filter(({ handedness }) => SIDES.includes(handedness));
    for (const { gripSpace, hand, handedness } of named)
      if (gripSpace && !hand) this.add(`${handedness}-grip`, gripSpace);
    // The draft has one name that is spelled otherwise on the left; the server knows both.
    body?.forEach((space, name) => {
      this.add(name, space);
    });
    for (const { hand, handedness } of named)
      (hand as unknown as ReadonlyMap<string, XRSpace> | undefined)?.forEach((space, joint) => {
        this.add(handName(handedness, joint), space);
      });
    this.poses = new Float32Array(this.names.length * FLOATS);
    this.guessed = new Uint8Array(this.names.length);
  }

  private add(name: string, space: XRSpace): void {
    let row = this.names.indexOf(name);
    if (row < 0) {
      if (this.names.length === MOST) return;
      row = this.names.push(name) - 1;
    }
    this.spaces.push(space);
    this.rows.push(row);
  }
}

const tracked = new Tracked();
const MOVED = new Matrix4();
const PLACE = new Vector3();
const TURN = new Quaternion();
const SCALE = new Vector3();

/** Put a pose into a row, in the space that poses are told in. */
function put({ transform, emulatedPosition }: XRPose, row: number, roomFromFloor: Matrix4 | null): void {
  const { poses, guessed } = tracked;
  let { position: p, orientation: q }: { position: Point; orientation: Turned } = transform;
  if (roomFromFloor) {
    MOVED.fromArray(transform.matrix).premultiply(roomFromFloor).decompose(PLACE, TURN, SCALE);
    p = PLACE;
    q = TURN;
  }
  const at = row * FLOATS;
  poses[at] = p.x;
  poses[at + 1] = p.y;
  poses[at + 2] = p.z;
  poses[at + 3] = q.w;
  poses[at + 4] = q.x;
  poses[at + 5] = q.y;
  poses[at + 6] = q.z;
  guessed[row] = emulatedPosition ? 1 : 0;
}

type Point = Readonly<Record<"x" | "y" | "z", number>>;
type Turned = Readonly<Record<"x" | "y" | "z" | "w", number>>;

/**
 * Where joints of body and hands are, three numbers [m] each in `space`; how many were written.
 *
 * @param into Takes as many as it has room for.
 */
export function bodyJoints(
  frame: XRFrame,
  space: XRReferenceSpace,
  sources: ArrayLike<XRInputSource>,
  into: Float32Array,
): number {
  const { names, spaces, rows } = tracked.look(frame, sources);
  let count = 0;
  for (let k = 0; k < spaces.length; k += 1) {
    if (names[rows[k]!]!.endsWith("-grip") || 3 * (count + 1) > into.length) continue;
    const pose = frame.getPose(spaces[k]!, space);
    if (!pose) continue;
    const { x, y, z } = pose.transform.position;
    into[3 * count] = x;
    into[3 * count + 1] = y;
    into[3 * count + 2] = z;
    count += 1;
  }
  return count;
}

const MESSAGE: Tracking = {
  type: "tracking",
  human: "",
  t: 0,
  names: [],
  poses: new Uint8Array(),
  guessed: new Uint8Array(),
  space: "",
};

/**
 * The message of one picture, valid until the next one; null when not even the head is tracked.
 *
 * @param space `local-floor`
 * @param t of the picture [ms]
 * @param name Which tracking space it is (`Tracking.space`).
 * @param roomFromFloor The space that poses are told in, from ``space``.
 */
export function sight(
  frame: XRFrame,
  space: XRReferenceSpace,
  sources: ArrayLike<XRInputSource>,
  human: string,
  t: number,
  name = "",
  roomFromFloor: Matrix4 | null = null,
): Tracking | null {
  const viewer = frame.getViewerPose(space);
  if (!viewer) return null;
  const { names, spaces, rows, poses, guessed } = tracked.look(frame, sources);
  poses.fill(Number.NaN);
  guessed.fill(0);
  put(viewer, 0, roomFromFloor);
  for (let k = 0; k < spaces.length; k += 1) {
    if (!Number.isNaN(poses[rows[k]! * FLOATS]!)) continue;
    const pose = frame.getPose(spaces[k]!, space);
    if (pose) put(pose, rows[k]!, roomFromFloor);
  }
  if (MESSAGE.poses.buffer !== poses.buffer) MESSAGE.poses = new Uint8Array(poses.buffer);
  MESSAGE.human = human;
  MESSAGE.t = t / 1000;
  MESSAGE.names = names;
  MESSAGE.guessed = guessed;
  MESSAGE.space = name;
  return MESSAGE;
}
