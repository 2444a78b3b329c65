// Lines from captions to where they belong.

import {
  BufferGeometry,
  DynamicDrawUsage,
  Float32BufferAttribute,
  LineBasicMaterial,
  LineSegments,
  Vector3,
} from "three";
import { colorOf, once } from "../scene/materials";
import { type Caption, depthOf } from "./caption";
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
  private readonly up = new Vector3();

  constructor() {
    this.places.setUsage(DynamicDrawUsage);
    const geometry = new BufferGeometry().setAttribute("position", this.places);
    const material = once("leader none", () => {
      const look = {
        transparent: true,
        opacity: 0.7,
        depthTest: false,
        depthWrite: false,
        toneMapped: false,
      };
      return new LineBasicMaterial({ color: colorOf("none"), ...look });
    });
    this.object = new LineSegments(geometry, material);
    this.object.frustumCulled = false;
    this.object.renderOrder = 9;
    this.object.raycast = () => {};
  }

  /** Draw them for these captions, after they were placed. */
  update(captions: readonly Caption[], { camera, pixel }: View): void {
    let count = 0;
    for (let k = 0; k < captions.length; k += 1) {
      const caption = captions[k]!;
      const { widthPx, heightPx, bottomPx, rightPx } = caption;
      // The point of the plate that is nearest to where it belongs.
      const right = rightPx - Math.sign(rightPx) * Math.min(Math.abs(rightPx), widthPx / 2);
      const up = Math.min(Math.max(bottomPx, 0), bottomPx + heightPx);
      if (right * right + up * up < LEAST_PX * LEAST_PX || count === MOST) continue;
      const depth = depthOf(caption.object, camera);
      caption.object.getWorldPosition(this.from);
      this.to.setFromMatrixColumn(camera.matrixWorld, 0).multiplyScalar(right * pixel * depth);
      this.up.setFromMatrixColumn(camera.matrixWorld, 1).multiplyScalar(up * pixel * depth);
      this.to.add(this.up).add(this.from);
      this.object.parent?.worldToLocal(this.from);
      this.object.parent?.worldToLocal(this.to);
      this.places.setXYZ(2 * count, this.from.x, this.from.y, this.from.z);
      this.places.setXYZ(2 * count + 1, this.to.x, this.to.y, this.to.z);
      count += 1;
    }
    this.places.needsUpdate = true;
    this.object.geometry.setDrawRange(0, 2 * count);
  }
}
