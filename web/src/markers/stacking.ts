// Captions that would lie over each other on the screen are stacked upward, in a steady order; below where
// they belong when the room ends above, and beside it when the room ends at a side.

import { Vector3 } from "three";
import type { Caption } from "./caption";
import type { View } from "./view";

const GAP_PX = 2;
/** Height of the tools at the upper edge of the room, and how far captions are above their points [px]. */
const TOOLS_PX = 56;
const at = new Vector3();

interface Place {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Lift each caption above the ones before it that it would cover, or lower it below them. */
export function stackCaptions(captions: Iterable<Caption>, { camera, pixel }: View): void {
  const half = Math.tan((camera.fov * Math.PI) / 360) / pixel;
  const placed: Place[] = [];
  for (const caption of captions) {
    caption.object.getWorldPosition(at).project(camera);
    // Beside the picture or behind the eye: nobody sees it, and there is no room to look for.
    if (!(Math.abs(at.x) < 2 && Math.abs(at.y) < 2)) {
      caption.lift(0);
      continue;
    }
    const edge = half * camera.aspect;
    const belongs = at.x * edge;
    // Of a point that is out of sight, or where the room is too narrow, it stays over its point.
    const room = Math.abs(at.x) < 1 ? Math.max(edge - caption.widthPx / 2, 0) : Number.POSITIVE_INFINITY;
    const place = {
      x: room > 0 ? Math.min(Math.max(belongs, -room), room) : belongs,
      y: at.y * half,
      width: caption.widthPx,
      height: caption.heightPx + GAP_PX,
    };
    const from = place.y;
    for (let below = covered(placed, place); below; below = covered(placed, place)) {
      place.y = below.y + below.height;
    }
    if (place.y > from && place.y + place.height > half - TOOLS_PX) {
      place.y = from - place.height;
      for (let above = covered(placed, place); above; above = covered(placed, place)) {
        place.y = above.y - place.height;
      }
    }
    caption.lift(place.y - from, place.x - belongs);
    placed.push(place);
  }
}

function covered(placed: readonly Place[], { x, y, width, height }: Place): Place | undefined {
  return placed.find(
    (p) => Math.abs(p.x - x) < (p.width + width) / 2 && y < p.y + p.height - 1e-6 && p.y < y + height - 1e-6,
  );
}
