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
/** Of a caption in turn: where its point is, first as a share of the half room, then in pixels from its middle. */
const at = new Vector3();
/** Half height of the room, its right edge, and what is below tools [px]: a number handed over would be an object. */
const room = { half: 0.5, edge: 0.5, top: 0.5 };

// Classes, as V8 lets literals with the same names share what it knows of them: where one of those has something else
// than a number, numbers of all of them are objects.
class Place {
  x = 0.5;
  /** Lower edge. */
  y = 0.5;
  width = 0.5;
  height = 0.5;
}

class Belonging {
  caption: Caption | null = null;
  x = 0.5;
  y = 0.5;
}

// Made once, as a picture allocates nothing of ours: so many of each are in use.
const placed: Place[] = [];
const aside: Belonging[] = [];
let placedCount = 0;

/** Give each caption a place that no other one covers. */
export function placeCaptions(
  captions: readonly Caption[],
  { camera, pixel, margins, toolsPx = TOOLS_PX }: View,
): void {
  const half = Math.tan((camera.fov * Math.PI) / 360) / pixel;
  const edge = half * camera.aspect;
  room.half = half;
  room.edge = edge;
  room.top = half - toolsPx;
  placedCount = 0;
  let asideCount = 0;
  for (let k = 0; k < captions.length; k += 1) {
    const caption = captions[k]!;
    caption.object.getWorldPosition(at).project(camera);
    // Beside the picture or behind the eye: nobody sees it, and there is no room to look for.
    const far = !(Math.abs(at.x) < 2 && Math.abs(at.y) < 2);
    const seen = Math.abs(at.x) < 1 && Math.abs(at.y) < 1 && at.z < 1;
    at.x *= edge;
    at.y *= half;
    if (far) {
      caption.liftedPx = caption.rightPx = 0;
      caption.lift();
    } else if (margins && seen && caption.aside) {
      keep(asideCount, caption);
      asideCount += 1;
    } else stack(caption, seen);
  }
  // From above, so that lines to what they are about seldom cross.
  for (let k = 0; k < asideCount; k += 1) putAside(aside[k]!);
}

/** Keep one that goes aside, before those below it. */
function keep(count: number, caption: Caption): void {
  if (aside.length === count) aside.push(new Belonging());
  const one = aside[count]!;
  one.caption = caption;
  one.x = at.x;
  one.y = at.y;
  let k = count;
  for (; k > 0 && aside[k - 1]!.y < one.y; k -= 1) aside[k] = aside[k - 1]!;
  aside[k] = one;
}

/** A place for a caption, which counts as covered from now on; where in the room is said by whoever asks. */
function nextPlace(caption: Caption): Place {
  if (placed.length === placedCount) placed.push(new Place());
  const place = placed[placedCount]!;
  place.width = caption.widthPx;
  place.height = caption.heightPx + GAP_PX;
  return place;
}

function putAside({ caption, x, y }: Belonging): void {
  const { half, edge, top } = room;
  const place = nextPlace(caption!);
  const { width, height } = place;
  if (caption!.side === 0 || Math.abs(x) > KEEPS_SIDE * edge) caption!.side = x < 0 ? -1 : 1;
  const lowest = -half + LEGEND_PX;
  const highest = top - height;
  const level = 2 * edge < NARROW_PX ? highest : Math.max(Math.min(y - height / 2, highest), lowest);
  place.x = caption!.side * Math.max(edge - SIDE_PX - width / 2, 0);
  place.y = level;
  for (let other = covered(place); other; other = covered(place)) place.y = other.y - height;
  if (place.y < lowest) {
    place.y = level;
    for (let other = covered(place); other; other = covered(place)) place.y = other.y + other.height;
  }
  placedCount += 1;
  caption!.liftedPx = place.y - y;
  caption!.rightPx = place.x - x;
  caption!.lift();
}

// Above those before it that it would cover, or below them when the room ends above; beside its point when the
// room ends at a side.
function stack(caption: Caption, seen: boolean): void {
  const { x, y } = at;
  const { top, edge } = room;
  const place = nextPlace(caption);
  // Of a point that is out of sight, or where the room is too narrow, it stays over its point.
  const free = seen ? Math.max(edge - place.width / 2, 0) : Number.POSITIVE_INFINITY;
  place.x = free > 0 ? Math.min(Math.max(x, -free), free) : x;
  place.y = y;
  for (let below = covered(place); below; below = covered(place)) place.y = below.y + below.height;
  if (place.y > y && place.y + place.height > top) {
    place.y = y - place.height;
    for (let above = covered(place); above; above = covered(place)) place.y = above.y - place.height;
  }
  placedCount += 1;
  caption.liftedPx = place.y - y;
  caption.rightPx = place.x - x;
  caption.lift();
}

function covered({ x, y, width, height }: Place): Place | undefined {
  for (let k = 0; k < placedCount; k += 1) {
    const p = placed[k]!;
    if (Math.abs(p.x - x) < (p.width + width) / 2 && y < p.y + p.height - 1e-6 && p.y < y + height - 1e-6)
      return p;
  }
  return undefined;
}
