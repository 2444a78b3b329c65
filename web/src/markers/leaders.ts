// Lines from captions that were lifted to where they belong.

import {
  BufferGeometry,
  DynamicDrawUsage,
  Float32BufferAttribute,
  LineBasicMaterial,
  LineSegments,
  Vector3,
} from "three";
import { NEUTRAL_COLOR } from "../verdicts";
import type { Caption } from "./caption";
import type { View } from "./view";

/** Captions nearer to their point than this need none [px]. */
const LEAST_PX = 16;
/** There are fewer captions at a time than this. */
const MOST = 128;

export class Leaders {
  readonly object: LineSegments;
  private readonly places = new Float32BufferAttribute(new Float32Array(MOST * 6), 3);
  private readonly from = new Vector3();
  private readonly to = new Vector3();

  constructor() {
    this.places.setUsage(DynamicDrawUsage);
    const geometry = new BufferGeometry().setAttribute("position", this.places);
    const material = new LineBasicMaterial({
      color: NEUTRAL_COLOR,
      transparent: true,
      opacity: 0.7,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
    });
    this.object = new LineSegments(geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 9;
    this.object.raycast = () => {};
  }

  /** Draw them for these captions, after they were stacked. */
  update(captions: Iterable<Caption>, { camera, pixel }: View): void {
    let count = 0;
    for (const caption of captions) {
      if (Math.abs(caption.liftedPx) < LEAST_PX || count === MOST) continue;
      caption.object.getWorldPosition(this.from);
      const depth = this.to.copy(this.from).sub(camera.position).length();
      this.to.setFromMatrixColumn(camera.matrixWorld, 1).multiplyScalar(caption.bottomPx * pixel * depth);
      this.to.add(this.from);
      for (const point of [this.from, this.to]) this.object.parent?.worldToLocal(point);
      this.places.setXYZ(2 * count, this.from.x, this.from.y, this.from.z);
      this.places.setXYZ(2 * count + 1, this.to.x, this.to.y, this.to.z);
      count += 1;
    }
    this.places.needsUpdate = true;
    this.object.geometry.setDrawRange(0, 2 * count);
  }
}
