// What a sensor sees: beams as thin lines, those that hit something solid and with a dot at their end, and
// the surface between neighbours.

import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Group,
  LineSegments,
  Mesh,
  Points,
  Vector3,
} from "three";
import { dotMaterial, faintMaterial, lineMaterial, markerMaterial } from "../scene/materials";
import type { Rays, Vec3 } from "../wire";
import type { Drawn } from "./drawn";

export class RaysDrawn implements Drawn<Rays> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  private readonly passing = new LineSegments(new BufferGeometry());
  private readonly hitting = new LineSegments(new BufferGeometry());
  private readonly dots = new Points(new BufferGeometry());
  private readonly sheet = new Mesh(new BufferGeometry());

  constructor() {
    this.sheet.renderOrder = 2;
    this.object.add(this.passing, this.hitting, this.dots, this.sheet);
    // Its box is not kept up to date at every frame.
    for (const part of this.object.children) part.frustumCulled = false;
  }

  update(marker: Rays): void {
    const { starts, ends, hits, filled, verdict } = marker;
    const several = starts.length === ends.length;
    const count = starts.length > 0 ? ends.length : 0;
    if (hit.length < count) hit = new Uint8Array(2 * count);
    hit.fill(0, 0, count);
    for (let k = 0; k < hits.length; k += 1) if (hits[k]! < count) hit[hits[k]!] = 1;
    let met = 0;
    for (let i = 0; i < count; i += 1) met += hit[i]!;
    const between = filled ? Math.max(count - 1, 0) : 0;
    const passing = begin(this.passing.geometry, 2 * (count - met));
    const hitting = begin(this.hitting.geometry, 2 * met);
    const dots = begin(this.dots.geometry, met);
    const sheet = begin(this.sheet.geometry, between * (several ? 6 : 3));
    let p = 0;
    let h = 0;
    let d = 0;
    let s = 0;
    for (let i = 0; i < count; i += 1) {
      const start = several ? starts[i]! : starts[0]!;
      const end = ends[i]!;
      if (hit[i] === 1) {
        h = put(hitting, h, start, end);
        d = put(dots, d, end);
      } else p = put(passing, p, start, end);
      if (i >= between) continue;
      const next = ends[i + 1]!;
      s = put(sheet, s, start, end, next);
      if (several) s = put(sheet, s, start, next, starts[i + 1]!);
    }
    if (count > 0) this.anchor.fromArray(starts[0]!);
    this.passing.material = faintMaterial(verdict);
    this.hitting.material = lineMaterial(verdict);
    this.dots.material = dotMaterial(verdict);
    this.sheet.material = markerMaterial("fill", verdict);
  }

  dispose(): void {
    for (const part of [this.passing, this.hitting, this.dots, this.sheet]) part.geometry.dispose();
  }
}

/** Beams that hit, of the marker that is drawn. */
let hit = new Uint8Array();

// In place as long as it fits: a scanner has hundreds of beams in every frame.
function begin(geometry: BufferGeometry, points: number): Float32Array {
  let position = geometry.getAttribute("position") as BufferAttribute | undefined;
  if (!position || position.array.length < 3 * points) {
    // A buffer cannot grow on the graphics card: the old one is given back.
    geometry.dispose();
    position = new BufferAttribute(new Float32Array(Math.max(points * 6, 30)), 3);
    position.setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", position);
  }
  position.needsUpdate = true;
  geometry.setDrawRange(0, points);
  return position.array as Float32Array;
}

/** Write points one after another; where the next one goes. */
function put(into: Float32Array, at: number, a: Vec3, b?: Vec3, c?: Vec3): number {
  into[at] = a[0];
  into[at + 1] = a[1];
  into[at + 2] = a[2];
  if (!b) return at + 3;
  return c ? put(into, at + 3, b, c) : put(into, at + 3, b);
}
