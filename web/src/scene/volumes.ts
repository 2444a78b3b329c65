// Which translucent volumes would hide what is inside them, so that they are better drawn by their edges alone.

import { type Box3, Ray, Vector3 } from "three";

/** Volumes along a line of sight: through one more, what is inside has less than half of its own colour. */
const MOST_FILLED = 3;

/**
 * Of each volume whether it hides: the eye is within it, or it is one of too many on the way to its middle.
 *
 * @param boxes Around each volume, in the world.
 * @param eye Where one looks from, in the world.
 */
export function hiding(boxes: readonly Box3[], eye: Vector3): boolean[] {
  const sight = new Ray();
  return boxes.map((box) => {
    if (box.containsPoint(eye)) return true;
    sight.set(eye, box.getCenter(new Vector3()).sub(eye).normalize());
    return boxes.filter((other) => sight.intersectsBox(other)).length > MOST_FILLED;
  });
}
