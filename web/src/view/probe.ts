// How fast a point of a body moves, from where it is shown: a point is picked, and followed with its body.

import { signal } from "@preact/signals";
import { type Object3D, Vector3 } from "three";

export interface Probe {
  /** Full name of the body. */
  name: string;
  /** The point in the body's frame [m]. */
  local: Vector3;
  /** Where it is in the world, z up [m]. */
  at: readonly [number, number, number];
  /** Mean speed between the last two instants that were shown [m/s]; null while there is one only. */
  speed: number | null;
  /** Time between those [s]. */
  over: number;
}

/** Longest time between two instants of which a mean speed is said [s]. */
const LONGEST_S = 0.25;

export const probing = signal(false);
export const probe = signal<Probe | null>(null);

let last: { t: number; at: Vector3 } | null = null;

export function toggleProbe(): void {
  probing.value = !probing.peek();
  probe.value = null;
  last = null;
}

/** Probe a point of a body. */
export function probeAt(name: string, point: Vector3, body: Object3D): void {
  last = null;
  probe.value = { name, local: body.worldToLocal(point.clone()), at: [0, 0, 0], speed: null, over: 0 };
}

/** Follow the body to where it is shown at an instant. */
export function followProbe(t: number, group: Object3D | undefined): void {
  const now = probe.peek();
  if (!now || !group) return;
  group.updateWorldMatrix(true, false);
  const place = group.localToWorld(now.local.clone());
  const at = new Vector3(place.x, -place.z, place.y);
  if (last && t === last.t) return;
  const over = last ? t - last.t : 0;
  const speed = last && over > 0 && over <= LONGEST_S ? at.distanceTo(last.at) / over : null;
  last = { t, at };
  probe.value = { ...now, at: [at.x, at.y, at.z], speed, over };
}
