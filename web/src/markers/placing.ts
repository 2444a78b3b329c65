// Where captions are on the screen: names at their places, stacked where they would cover each other; figures at
// the nearer side of the room, level with what they are about, so that they cover nothing in its middle.

import { Vector3 } from "three";
import type { Caption } from "./caption";
import type { View } from "./view";

const GAP_PX = 2;
/** Height of a row of tools at the upper edge of the room, with what is left free around it [px]. */
const TOOLS_PX = 56;
/** Height of the legend at the lower edge, and distance from the sides [px]. */
const LEGEND_PX = 52;
const SIDE_PX = 10;
/** In a narrower room figures go to its upper edge, as at its sides they would lie over its middle [px]. */
const NARROW_PX = 520;
/** Share of the half room in which a caption keeps the side that it has, so that it does not jump. */
const KEEPS_SIDE = 0.12;
const at = new Vector3();

interface Place {
  x: number;
  /** Lower edge. */
  y: number;
  width: number;
  height: number;
}

interface Belonging {
  caption: Caption;
  x: number;
  y: number;
}

/** Give each caption a place that no other one covers. */
export function placeCaptions(
  captions: Iterable<Caption>,
  { camera, pixel, margins, toolsPx = TOOLS_PX }: View,
): void {
  const half = Math.tan((camera.fov * Math.PI) / 360) / pixel;
  const edge = half * camera.aspect;
  const top = half - toolsPx;
  const placed: Place[] = [];
  const aside: Belonging[] = [];
  for (const caption of captions) {
    caption.object.getWorldPosition(at).project(camera);
    const belonging = { caption, x: at.x * edge, y: at.y * half };
    // Beside the picture or behind the eye: nobody sees it, and there is no room to look for.
    const far = !(Math.abs(at.x) < 2 && Math.abs(at.y) < 2);
    const seen = Math.abs(at.x) < 1 && Math.abs(at.y) < 1 && at.z < 1;
    if (far) caption.lift(0);
    else if (margins && seen && caption.aside) aside.push(belonging);
    else placed.push(stack(belonging, placed, top, edge, seen));
  }
  // From above, so that lines to what they are about seldom cross.
  for (const belonging of aside.sort((a, b) => b.y - a.y))
    placed.push(putAside(belonging, placed, half, top, edge));
}

function putAside(
  { caption, x, y }: Belonging,
  placed: readonly Place[],
  half: number,
  top: number,
  edge: number,
): Place {
  const { widthPx: width, heightPx } = caption;
  const height = heightPx + GAP_PX;
  if (caption.side === 0 || Math.abs(x) > KEEPS_SIDE * edge) caption.side = x < 0 ? -1 : 1;
  const lowest = -half + LEGEND_PX;
  const highest = top - height;
  const level = 2 * edge < NARROW_PX ? highest : Math.max(Math.min(y - height / 2, highest), lowest);
  const place = { x: caption.side * Math.max(edge - SIDE_PX - width / 2, 0), y: level, width, height };
  for (let other = covered(placed, place); other; other = covered(placed, place)) place.y = other.y - height;
  if (place.y < lowest) {
    place.y = level;
    for (let other = covered(placed, place); other; other = covered(placed, place))
      place.y = other.y + other.height;
  }
  caption.lift(place.y - y, place.x - x);
  return place;
}

// Above those before it that it would cover, or below them when the room ends above; beside its point when the
// room ends at a side.
function stack(
  { caption, x, y }: Belonging,
  placed: readonly Place[],
  top: number,
  edge: number,
  seen: boolean,
): Place {
  // Of a point that is out of sight, or where the room is too narrow, it stays over its point.
  const room = seen ? Math.max(edge - caption.widthPx / 2, 0) : Number.POSITIVE_INFINITY;
  const place = {
    x: room > 0 ? Math.min(Math.max(x, -room), room) : x,
    y,
    width: caption.widthPx,
    height: caption.heightPx + GAP_PX,
  };
  for (let below = covered(placed, place); below; below = covered(placed, place)) {
    place.y = below.y + below.height;
  }
  if (place.y > y && place.y + place.height > top) {
    place.y = y - place.height;
    for (let above = covered(placed, place); above; above = covered(placed, place)) {
      place.y = above.y - place.height;
    }
  }
  caption.lift(place.y - y, place.x - x);
  return place;
}

function covered(placed: readonly Place[], { x, y, width, height }: Place): Place | undefined {
  return placed.find(
    (p) => Math.abs(p.x - x) < (p.width + width) / 2 && y < p.y + p.height - 1e-6 && p.y < y + height - 1e-6,
  );
}
