// A translucent ellipsoid with its three principal ellipses.

import { BufferGeometry, Float32BufferAttribute, SphereGeometry, Vector3 } from "three";
import type { Ellipsoid } from "../wire";
import type { Drawn } from "./drawn";
import { Surface, turn } from "./surface";

export const BALL = new SphereGeometry(1, 32, 20);
export const CIRCLES = circles(48);

export class EllipsoidDrawn implements Drawn<Ellipsoid> {
  private readonly surface = new Surface(BALL, CIRCLES);
  readonly object = this.surface.object;
  readonly anchor = new Vector3();

  update(marker: Ellipsoid): void {
    this.object.position.fromArray(marker.center);
    turn(this.object.quaternion, marker.wxyz);
    this.object.scale.fromArray(marker.radii).clampScalar(1e-6, Number.POSITIVE_INFINITY);
    this.anchor.copy(this.object.position);
    this.surface.color(marker.verdict);
  }

  dispose(): void {}
}

// The unit circles of the three coordinate planes.
function circles(count: number): BufferGeometry {
  const points: number[] = [];
  for (let plane = 0; plane < 3; plane += 1) {
    for (let i = 0; i < count; i += 1) {
      for (const k of [i, i + 1]) {
        const at = [0, 0, 0];
        at[plane] = Math.cos((2 * Math.PI * k) / count);
        at[(plane + 1) % 3] = Math.sin((2 * Math.PI * k) / count);
        points.push(...at);
      }
    }
  }
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}
