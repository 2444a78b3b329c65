// What a headset sees of the person who wears it, at one of its pictures: head, hands, body joints.

import { Matrix4, Quaternion, Vector3 } from "three";
import type { Tracking } from "../wire";

/** Floats per name: x, y, z [m], w, x, y, z. */
const FLOATS = 7;
/** Names per message at most; the server takes no more. */
const MOST = 160;

/** What a frame knows of a body, where the browser has Body Tracking. */
interface BodyFrame extends XRFrame {
  readonly body?: Iterable<[string, XRSpace]>;
}

/** `left-hand-index-metacarpal` of a hand's `index-finger-metacarpal`, as Body Tracking names it. */
export function handName(side: string, joint: string): string {
  return `${side}-hand-${joint.replace("-finger", "")}`;
}

/** Everything that is tracked, by name; first what counts most, as there is a most. */
function* spaces(frame: BodyFrame, sources: Iterable<XRInputSource>): Generator<[string, XRSpace]> {
  const named = [...sources].filter((s) => s.handedness === "left" || s.handedness === "right");
  for (const source of named)
    if (source.gripSpace && !source.hand) yield [`${source.handedness}-grip`, source.gripSpace];
  // The draft has one name that is spelled otherwise on the left; the server knows both.
  if (frame.body) for (const [name, space] of frame.body) yield [name, space];
  for (const source of named)
    if (source.hand)
      for (const [joint, space] of source.hand as unknown as Iterable<[string, XRSpace]>)
        yield [handName(source.handedness, joint), space];
}

const MOVED = new Matrix4();
const PLACE = new Vector3();
const TURN = new Quaternion();
const SCALE = new Vector3();

function within({ transform }: XRPose, roomFromFloor: Matrix4 | null) {
  if (!roomFromFloor) return { p: transform.position, q: transform.orientation };
  MOVED.fromArray(transform.matrix).premultiply(roomFromFloor).decompose(PLACE, TURN, SCALE);
  return { p: PLACE, q: TURN };
}

/**
 * Where joints of body and hands are, three numbers [m] each in `space`; how many were written.
 *
 * @param into Takes as many as it has room for.
 */
export function bodyJoints(
  frame: XRFrame,
  space: XRReferenceSpace,
  sources: Iterable<XRInputSource>,
  into: Float32Array,
): number {
  let count = 0;
  for (const [name, each] of spaces(frame, sources)) {
    if (name.endsWith("-grip") || 3 * (count + 1) > into.length) continue;
    const pose = frame.getPose(each, space);
    if (!pose) continue;
    const { x, y, z } = pose.transform.position;
    into.set([x, y, z], 3 * count);
    count += 1;
  }
  return count;
}

/**
 * The message of one picture; null when not even the head is tracked.
 *
 * @param space `local-floor`
 * @param t of the picture [ms]
 * @param name Which tracking space it is (`Tracking.space`).
 * @param roomFromFloor The space that poses are told in, from ``space``.
 */
export function sight(
  frame: XRFrame,
  space: XRReferenceSpace,
  sources: Iterable<XRInputSource>,
  human: string,
  t: number,
  name = "",
  roomFromFloor: Matrix4 | null = null,
): Tracking | null {
  const viewer = frame.getViewerPose(space);
  if (!viewer) return null;
  const found = new Map<string, XRPose | null>([["viewer", viewer]]);
  for (const [name, each] of spaces(frame, sources)) {
    if (found.size >= MOST) break;
    if (!found.get(name)) found.set(name, frame.getPose(each, space) ?? null);
  }
  const poses = new Float32Array(found.size * FLOATS).fill(Number.NaN);
  const guessed = new Uint8Array(found.size);
  let row = 0;
  for (const pose of found.values()) {
    if (pose) {
      const { p, q } = within(pose, roomFromFloor);
      poses.set([p.x, p.y, p.z, q.w, q.x, q.y, q.z], row * FLOATS);
      guessed[row] = pose.emulatedPosition ? 1 : 0;
    }
    row += 1;
  }
  const names = [...found.keys()];
  const bytes = new Uint8Array(poses.buffer);
  return { type: "tracking", human, t: t / 1000, names, poses: bytes, guessed, space: name };
}
