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
    const { starts, ends, verdict } = marker;
    const hits = new Set(marker.hits);
    const startOf = (i: number): Vec3 => (starts.length === ends.length ? starts[i]! : starts[0]!);
    const [passing, hitting, dots, sheet]: [number[], number[], number[], number[]] = [[], [], [], []];
    if (starts.length > 0) {
      ends.forEach((end, i) => {
        (hits.has(i) ? hitting : passing).push(...startOf(i), ...end);
        if (hits.has(i)) dots.push(...end);
        const next = ends[i + 1];
        if (marker.filled && next) {
          sheet.push(...startOf(i), ...end, ...next);
          if (starts.length === ends.length) sheet.push(...startOf(i), ...next, ...startOf(i + 1));
        }
      });
      this.anchor.fromArray(starts[0]!);
    }
    write(this.passing.geometry, passing);
    write(this.hitting.geometry, hitting);
    write(this.dots.geometry, dots);
    write(this.sheet.geometry, sheet);
    this.passing.material = faintMaterial(verdict);
    this.hitting.material = lineMaterial(verdict);
    this.dots.material = dotMaterial(verdict);
    this.sheet.material = markerMaterial("fill", verdict);
  }

  dispose(): void {
    for (const part of [this.passing, this.hitting, this.dots, this.sheet]) part.geometry.dispose();
  }
}

// In place as long as it fits: a scanner has hundreds of beams in every frame.
function write(geometry: BufferGeometry, values: readonly number[]): void {
  let position = geometry.getAttribute("position") as BufferAttribute | undefined;
  if (!position || position.array.length < values.length) {
    // A buffer cannot grow on the graphics card: the old one is given back.
    geometry.dispose();
    position = new BufferAttribute(new Float32Array(Math.max(values.length * 2, 30)), 3);
    position.setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", position);
  }
  (position.array as Float32Array).set(values);
  position.needsUpdate = true;
  geometry.setDrawRange(0, values.length / 3);
}
