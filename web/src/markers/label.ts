// Text at a point; what it says the layer knows.

import { Group, Vector3 } from "three";
import type { Label } from "../wire";
import { Caption } from "./caption";
import type { Drawn } from "./drawn";

export class LabelDrawn implements Drawn<Label> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  readonly caption = new Caption("name");

  constructor() {
    this.object.add(this.caption.object);
  }

  update(marker: Label): void {
    this.object.position.fromArray(marker.position);
    this.anchor.copy(this.object.position);
  }

  dispose(): void {
    this.caption.dispose();
  }
}
