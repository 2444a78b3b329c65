// Which translucent volumes would hide what is inside them, so that they are better drawn by their edges alone.

import { type Box3, Vector3 } from "three";

/** Volumes along a line of sight: through one more, what is inside has less than half of its own colour. */
const MOST_FILLED = 3;

const along = new Vector3();

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
  box.getCenter(along).sub(eye);
  let crossed = 0;
  for (let k = 0; k < boxes.length; k += 1) if (crosses(boxes[k]!, eye)) crossed += 1;
  return crossed > MOST_FILLED;
}

// Slab by slab, as three.js's own ray does it, whose numbers go from one function to the next and are objects then.
function crosses({ min, max }: Box3, eye: Vector3): boolean {
  let near = 0;
  let far = Number.POSITIVE_INFINITY;
  for (let axis = 0; axis < 3; axis += 1) {
    const at = axis === 0 ? eye.x : axis === 1 ? eye.y : eye.z;
    const way = axis === 0 ? along.x : axis === 1 ? along.y : along.z;
    const low = (axis === 0 ? min.x : axis === 1 ? min.y : min.z) - at;
    const high = (axis === 0 ? max.x : axis === 1 ? max.y : max.z) - at;
    if (way === 0) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    const first = (way > 0 ? low : high) / way;
    const last = (way > 0 ? high : low) / way;
    if (first > near) near = first;
    if (last < far) far = last;
  }
  return near <= far;
}
