// How the screen sees the world, for what keeps its size in pixels.

import type { PerspectiveCamera } from "three";

export interface View {
  camera: PerspectiveCamera;
  /** World size of a pixel at one metre before the eye [m]. */
  pixel: number;
  /** Whether figures may go to the sides of the picture; in a headset there are none. */
  margins: boolean;
  /** Height of the tools at the upper edge of the picture [px]; of one row of them when not said. */
  toolsPx?: number;
}
