// What every kind of marker is once it is on the screen.

import type { Object3D, Vector3 } from "three";
import type { Caption } from "./caption";
import type { View } from "./view";

export interface Drawn<M> {
  /** In world coordinates: z up, metres. */
  readonly object: Object3D;
  /** Where its caption goes, in world coordinates. */
  readonly anchor: Vector3;
  /** Of a marker that is text. */
  readonly caption?: Caption;
  /** Draw this marker instead of the one before it. */
  update(marker: M): void;
  /** Keep widths and letters constant in pixels; called before each picture. */
  face?(view: View): void;
  dispose(): void;
}
