// How the screen sees the world, for what keeps its size in pixels.

import type { PerspectiveCamera } from "three";

export interface View {
  camera: PerspectiveCamera;
  /** World size of a pixel at one metre from the eye [m]. */
  pixel: number;
}
