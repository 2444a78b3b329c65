// A line between two points, with a dot at either end.

import { Group, Mesh, SphereGeometry, Vector3 } from "three";
import { markerMaterial } from "../scene/materials";
import type { Segment } from "../wire";
import type { Drawn } from "./drawn";
import { pixelAt, Stroke } from "./stroke";
import type { View } from "./view";

const DOT = new SphereGeometry(1, 16, 12);
const WIDTH_PX = 3.5;
const DOT_PX = 4.5;

export class SegmentDrawn implements Drawn<Segment> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  private readonly stroke = new Stroke(WIDTH_PX);
  private readonly dots = [new Mesh(DOT), new Mesh(DOT)] as const;

  constructor() {
    this.object.add(this.stroke.object, ...this.dots);
  }

  update(marker: Segment): void {
    this.stroke.update(marker.start, marker.end, marker.verdict);
    this.anchor.addVectors(this.stroke.start, this.stroke.end).multiplyScalar(0.5);
    this.dots[0].position.copy(this.stroke.start);
    this.dots[1].position.copy(this.stroke.end);
    for (const dot of this.dots) dot.material = markerMaterial("line", marker.verdict);
  }

  face(view: View): void {
    this.stroke.face(view);
    for (const dot of this.dots) dot.scale.setScalar(DOT_PX * pixelAt(dot, view));
  }

  dispose(): void {}
}
