// A translucent box with its edges.

import { BoxGeometry, EdgesGeometry, Vector3 } from "three";
import type { Box } from "../wire";
import type { Drawn } from "./drawn";
import { Surface, turn } from "./surface";

const CUBE = new BoxGeometry(1, 1, 1);
const EDGES = new EdgesGeometry(CUBE);

export class BoxDrawn implements Drawn<Box> {
  private readonly surface = new Surface(CUBE, EDGES);
  readonly object = this.surface.object;
  readonly anchor = new Vector3();

  update(marker: Box): void {
    this.object.position.fromArray(marker.center);
    turn(this.object.quaternion, marker.wxyz);
    this.object.scale.fromArray(marker.size).clampScalar(1e-6, Number.POSITIVE_INFINITY);
    this.anchor.copy(this.object.position);
    this.anchor.z += marker.size[2] / 2;
    this.surface.color(marker.verdict);
  }

  dispose(): void {}
}
