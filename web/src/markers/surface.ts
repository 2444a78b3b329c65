// A translucent closed surface with its outline drawn, so that it reads against any background.

import { type BufferGeometry, Group, LineSegments, Mesh, type Quaternion } from "three";
import { turnOutward } from "../scene/feature_edges";
import { lineMaterial, markerMaterial } from "../scene/materials";
import { veilMaterial } from "../scene/veil";
import type { Verdict } from "../wire";

/** Turn by a quaternion that has w first. */
export function turn(quaternion: Quaternion, wxyz: readonly [number, number, number, number]): void {
  quaternion.set(wxyz[1], wxyz[2], wxyz[3], wxyz[0]);
}

export class Surface {
  readonly object = new Group();
  private readonly fill: Mesh;
  private readonly lines: LineSegments;
  private smooth = false;

  constructor(fill: BufferGeometry, lines: BufferGeometry) {
    this.fill = new Mesh(fill);
    this.lines = new LineSegments(lines);
    this.fill.renderOrder = 2;
    this.object.add(this.fill, this.lines);
  }

  color(verdict: Verdict | null): void {
    this.fill.material = this.smooth ? veilMaterial(verdict) : markerMaterial("volume", verdict);
    this.lines.material = lineMaterial(verdict);
  }

  /**
   * Replace both shapes; the old ones are freed. Followed by `color`.
   *
   * @param smooth Whether the lines leave the shape open: then its rim shows it, and it needs normals.
   */
  reshape(fill: BufferGeometry, lines: BufferGeometry, smooth = false): void {
    this.free();
    this.smooth = smooth;
    this.fill.userData.volume = !smooth;
    turnOutward(fill);
    this.fill.geometry = fill;
    this.lines.geometry = lines;
  }

  free(): void {
    this.fill.geometry.dispose();
    this.lines.geometry.dispose();
  }
}
