// A line through points, open or closed.

import { Group, Vector3 } from "three";
import type { Polyline } from "../wire";
import type { Drawn } from "./drawn";
import { Stroke } from "./stroke";
import type { View } from "./view";

const WIDTH_PX = 3;

export class PolylineDrawn implements Drawn<Polyline> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  private legs: Stroke[] = [];

  update(marker: Polyline): void {
    const { points, closed, verdict } = marker;
    const count = points.length < 2 ? 0 : points.length - (closed ? 0 : 1);
    if (this.legs.length > count) for (const leg of this.legs.splice(count)) leg.object.removeFromParent();
    for (let i = 0; i < count; i += 1) {
      let leg = this.legs[i];
      if (!leg) {
        leg = new Stroke(WIDTH_PX);
        this.legs[i] = leg;
        this.object.add(leg.object);
      }
      leg.update(points[i]!, points[(i + 1) % points.length]!, verdict);
    }
    // In the middle: where two lines meet their captions would.
    const middle = points[points.length >> 1];
    if (middle) this.anchor.fromArray(middle);
  }

  face(view: View): void {
    for (const leg of this.legs) leg.face(view);
  }

  dispose(): void {}
}
