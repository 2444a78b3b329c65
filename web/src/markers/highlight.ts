// A whole body in the colour of a verdict: the body itself is painted, nothing is added.

import { Group, Vector3 } from "three";
import type { Highlight } from "../wire";
import type { Drawn } from "./drawn";

export class HighlightDrawn implements Drawn<Highlight> {
  readonly object = new Group();
  readonly anchor = new Vector3();
  marker: Highlight | null = null;

  update(marker: Highlight): void {
    this.marker = marker;
  }

  dispose(): void {}
}
