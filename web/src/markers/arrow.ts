// A vector at a point: a shaft and a head.

import { ConeGeometry, Group, Mesh, Quaternion, Vector3 } from "three";
import { markerMaterial } from "../scene/materials";
import type { Arrow } from "../wire";
import type { Drawn } from "./drawn";
import { pixelAt, Stroke } from "./stroke";
import type { View } from "./view";

const HEAD = new ConeGeometry(1, 2.6, 16).translate(0, -1.3, 0);
const UP = new Vector3(0, 1, 0);
const WIDTH_PX = 4;
const HEAD_PX = 7;
const vector = new Vector3();
const origin = new Vector3();
const turn = new Quaternion();

export class ArrowDrawn implements Drawn<Arrow> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  private readonly stroke = new Stroke(WIDTH_PX);
  private readonly head = new Mesh(HEAD);
  private length = 0;

  constructor() {
    this.object.add(this.stroke.object, this.head);
  }

  update(marker: Arrow): void {
    origin.fromArray(marker.origin);
    vector.fromArray(marker.vector);
    this.length = vector.length();
    this.anchor.addVectors(origin, vector);
    this.stroke.update(origin, this.anchor, marker.verdict);
    this.head.visible = this.length > 1e-9;
    this.head.position.copy(this.anchor);
    if (this.head.visible)
      this.head.quaternion.copy(turn.setFromUnitVectors(UP, vector.divideScalar(this.length)));
    this.head.material = markerMaterial("line", marker.verdict);
  }

  face(view: View): void {
    this.stroke.face(view);
    // A short arrow keeps its proportions instead of being all head.
    this.head.scale.setScalar(Math.min(HEAD_PX * pixelAt(this.head, view), this.length / 3));
  }

  dispose(): void {}
}
