// A translucent ball.

import { Vector3 } from "three";
import type { Sphere } from "../wire";
import type { Drawn } from "./drawn";
import { BALL, CIRCLES } from "./ellipsoid";
import { Surface } from "./surface";

export class SphereDrawn implements Drawn<Sphere> {
  private readonly surface = new Surface(BALL, CIRCLES);
  readonly object = this.surface.object;
  readonly anchor = new Vector3();

  update(marker: Sphere): void {
    this.object.position.fromArray(marker.center);
    this.object.scale.setScalar(Math.max(marker.radius, 1e-6));
    this.anchor.copy(this.object.position);
    this.surface.color(marker.verdict);
  }

  dispose(): void {}
}
