// What is moved of the workstation file, by a handle on the desk or a hand in the room: its bodies go along until
// the server has said what it is.

import { Euler, MathUtils, Matrix4, Quaternion, Vector3 } from "three";
import { change, type Entry } from "../editing/draft";
import { moveTo, ORDER, placing, poseKey, tidy } from "../editing/pose";
import { scene } from "../page_state";
import type { Place } from "../wire";
import type { Bodies, Body } from "./bodies";

const ONE = new Vector3(1, 1, 1);

/**
 * Frame that the file gives the place of an entry in, in the world (z up).
 *
 * @returns Whether there is one: what is swept has no place, and where a carrier is may not be known here.
 */
export function frameOf(entry: Entry, bodies: Bodies, into: Matrix4): boolean {
  const { group, path, table } = entry;
  into.identity();
  if (group === "waypoints") {
    const base = scene.peek()?.taught.find(({ source }) => source === path[1])?.base;
    return poseKey(entry) !== null && base !== undefined && whereIs(base, bodies, into);
  }
  if (table.swept !== undefined) return false;
  if (typeof table.on !== "string") return true;
  const carrier = bodies.byName.get(table.on);
  if (carrier) into.copy(carrier.group.matrix);
  return carrier !== undefined;
}

/** Where a place is, in the world (z up); whether its node is there. */
export function whereIs(
  { node, position, wxyz: [w, x, y, z] }: Place,
  bodies: Bodies,
  into: Matrix4,
): boolean {
  const carrier = bodies.byName.get(node);
  into.compose(new Vector3(...position), new Quaternion(x, y, z, w), ONE);
  if (carrier) into.premultiply(carrier.group.matrix);
  return node === "" || carrier !== undefined;
}

/**
 * A place as the file has one of a waypoint; null where its frame is not known here.
 *
 * @param base In whose frame it is given.
 * @param point Where it is, in the world (z up).
 */
export function placeIn(
  base: Place,
  bodies: Bodies,
  point: Matrix4,
): { position: number[]; rpy_deg: number[] } | null {
  const from = new Matrix4();
  if (!whereIs(base, bodies, from)) return null;
  const [position, turn] = [new Vector3(), new Quaternion()];
  from.invert().multiply(point).decompose(position, turn, new Vector3());
  const { x, y, z } = new Euler().setFromQuaternion(turn, ORDER);
  return {
    position: position.toArray().map((v) => tidy(v, 4)),
    rpy_deg: [x, y, z].map((angle) => tidy(MathUtils.radToDeg(angle), 3)),
  };
}

export class Carried {
  private readonly frame = new Matrix4();
  private readonly bodies: { body: Body; from: Matrix4 }[];
  /** From where it was to where it is, in the world (z up). */
  readonly motion = new Matrix4();

  private constructor(
    readonly entry: Entry,
    bodies: Bodies,
    private readonly moved: () => void,
  ) {
    this.bodies = [...bodies.byName.values()]
      .filter(({ node }) => node.owner === entry.name || node.mover === entry.name)
      .map((body) => ({ body, from: body.group.matrix.clone() }));
  }

  /** Take an entry; null where it cannot be moved. */
  static of(entry: Entry, bodies: Bodies, moved: () => void): Carried | null {
    const carried = new Carried(entry, bodies, moved);
    return frameOf(entry, bodies, carried.frame) ? carried : null;
  }

  /** Where it was taken, in the world (z up) [m]. */
  origin(into: Vector3): Vector3 {
    return into.copy(placing(this.entry).position).applyMatrix4(this.frame);
  }

  /** Show its bodies where `motion` has them. */
  show(): void {
    for (const { body, from } of this.bodies) {
      body.group.matrix.multiplyMatrices(this.motion, from);
      body.group.matrixWorldNeedsUpdate = true;
      body.carried = true;
      body.follow();
    }
    this.moved();
  }

  /** Ask for it to be where it is now; back it goes where that is refused. Whether it was accepted. */
  async put(turned: boolean): Promise<boolean> {
    const before = placing(this.entry);
    const now = this.frame
      .clone()
      .multiply(new Matrix4().compose(before.position, before.rotation, ONE))
      .premultiply(this.motion)
      .premultiply(this.frame.clone().invert());
    const [position, rotation] = [new Vector3(), new Quaternion()];
    now.decompose(position, rotation, new Vector3());
    const changes = turned ? moveTo(this.entry, null, rotation) : moveTo(this.entry, position, null);
    const done = await change(...changes);
    if (!done) {
      this.motion.identity();
      this.show();
    }
    return done;
  }
}
