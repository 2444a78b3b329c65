// A translucent closed surface with its outline drawn, so that it reads against any background.

import { type BufferGeometry, Group, LineSegments, Mesh } from "three";
import { lineMaterial, markerMaterial } from "../scene/materials";
import type { Verdict } from "../wire";

export class Surface {
  readonly object = new Group();
  private readonly fill: Mesh;
  private readonly lines: LineSegments;

  constructor(fill: BufferGeometry, lines: BufferGeometry) {
    this.fill = new Mesh(fill);
    this.lines = new LineSegments(lines);
    this.fill.renderOrder = 2;
    this.object.add(this.fill, this.lines);
  }

  color(verdict: Verdict | null): void {
    this.fill.material = markerMaterial("fill", verdict);
    this.lines.material = lineMaterial(verdict);
  }

  /** Replace both shapes; the old ones are freed. */
  reshape(fill: BufferGeometry, lines: BufferGeometry): void {
    this.free();
    this.fill.geometry = fill;
    this.lines.geometry = lines;
  }

  free(): void {
    this.fill.geometry.dispose();
    this.lines.geometry.dispose();
  }
}
