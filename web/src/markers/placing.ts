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
  caption: Caption | null;
  x: number;
  y: number;
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
  const top = half - toolsPx;
  placedCount = 0;
  let asideCount = 0;
  for (let k = 0; k < captions.length; k += 1) {
    const caption = captions[k]!;
    caption.object.getWorldPosition(at).project(camera);
    const x = at.x * edge;
    const y = at.y * half;
    // Beside the picture or behind the eye: nobody sees it, and there is no room to look for.
    const far = !(Math.abs(at.x) < 2 && Math.abs(at.y) < 2);
    const seen = Math.abs(at.x) < 1 && Math.abs(at.y) < 1 && at.z < 1;
    if (far) caption.lift(0);
    else if (margins && seen && caption.aside) {
      keep(asideCount, caption, x, y);
      asideCount += 1;
    } else stack(caption, x, y, top, edge, seen);
  }
  // From above, so that lines to what they are about seldom cross.
  for (let k = 0; k < asideCount; k += 1) {
    const { caption, x, y } = aside[k]!;
    putAside(caption!, x, y, half, top, edge);
  }
}

/** Keep one that goes aside, before those below it. */
function keep(count: number, caption: Caption, x: number, y: number): void {
  if (aside.length === count) aside.push({ caption: null, x: 0, y: 0 });
  const one = aside[count]!;
  one.caption = caption;
  one.x = x;
  one.y = y;
  let k = count;
  for (; k > 0 && aside[k - 1]!.y < y; k -= 1) aside[k] = aside[k - 1]!;
  aside[k] = one;
}

/** A place that counts as covered from now on. */
function nextPlace(x: number, y: number, width: number, height: number): Place {
  if (placed.length === placedCount) placed.push({ x: 0, y: 0, width: 0, height: 0 });
  const place = placed[placedCount]!;
  place.x = x;
  place.y = y;
  place.width = width;
  place.height = height;
  return place;
}

function putAside(caption: Caption, x: number, y: number, half: number, top: number, edge: number): void {
  const { widthPx: width, heightPx } = caption;
  const height = heightPx + GAP_PX;
  if (caption.side === 0 || Math.abs(x) > KEEPS_SIDE * edge) caption.side = x < 0 ? -1 : 1;
  const lowest = -half + LEGEND_PX;
  const highest = top - height;
  const level = 2 * edge < NARROW_PX ? highest : Math.max(Math.min(y - height / 2, highest), lowest);
  const place = nextPlace(caption.side * Math.max(edge - SIDE_PX - width / 2, 0), level, width, height);
  for (let other = covered(place); other; other = covered(place)) place.y = other.y - height;
  if (place.y < lowest) {
    place.y = level;
    for (let other = covered(place); other; other = covered(place)) place.y = other.y + other.height;
  }
  placedCount += 1;
  caption.lift(place.y - y, place.x - x);
}

// Above those before it that it would cover, or below them when the room ends above; beside its point when the
// room ends at a side.
function stack(caption: Caption, x: number, y: number, top: number, edge: number, seen: boolean): void {
  // Of a point that is out of sight, or where the room is too narrow, it stays over its point.
  const room = seen ? Math.max(edge - caption.widthPx / 2, 0) : Number.POSITIVE_INFINITY;
  const beside = room > 0 ? Math.min(Math.max(x, -room), room) : x;
  const place = nextPlace(beside, y, caption.widthPx, caption.heightPx + GAP_PX);
  for (let below = covered(place); below; below = covered(place)) place.y = below.y + below.height;
  if (place.y > y && place.y + place.height > top) {
    place.y = y - place.height;
    for (let above = covered(place); above; above = covered(place)) place.y = above.y - place.height;
  }
  placedCount += 1;
  caption.lift(place.y - y, place.x - x);
}

function covered({ x, y, width, height }: Place): Place | undefined {
  for (let k = 0; k < placedCount; k += 1) {
    const p = placed[k]!;
    if (Math.abs(p.x - x) < (p.width + width) / 2 && y < p.y + p.height - 1e-6 && p.y < y + height - 1e-6)
      return p;
  }
  return undefined;
}
