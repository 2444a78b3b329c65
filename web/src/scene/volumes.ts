// Which translucent volumes would hide what is inside them, so that they are better drawn by their edges alone.

import { type Box3, Ray, Vector3 } from "three";

/** Volumes along a line of sight: through one more, what is inside has less than half of its own colour. */
const MOST_FILLED = 3;

const sight = new Ray();
const middle = new Vector3();

/**
 * Whether a volume hides: the eye is within it, or it is one of too many on the way to its middle. Allocates nothing.
 *
 * @param boxes Around each volume, in the world.
 * @param index Which of them.
 * @param eye Where one looks from, in the world.
 */
export function hides(boxes: readonly Box3[], index: number, eye: Vector3): boolean {
  const box = boxes[index]!;
  if (box.containsPoint(eye)) return true;
  sight.set(eye, box.getCenter(middle).sub(eye).normalize());
  let along = 0;
  for (let k = 0; k < boxes.length; k += 1) if (sight.intersectsBox(boxes[k]!)) along += 1;
  return along > MOST_FILLED;
}
