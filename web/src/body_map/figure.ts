// The person of the body map, drawn here: outlines of the twelve body regions from in front and from behind,
// and where each of the 29 specific areas of ISO/TS 15066:2016 Table A.2 is on it. Not to scale: hands are
// drawn large because nine areas lie on them.
//
// Numbers and from which side an area is seen follow the table of limits; seen_from is recollection in every
// row of it. The person's right is on the left of the front view, as if facing the reader.

export type View = "front" | "back";
/** Side of the person. */
export type Side = "left" | "right";

/** Size of one figure [units of the drawing]. */
export const WIDTH = 190;
export const HEIGHT = 424;
const MIDDLE = WIDTH / 2;

export interface Outline {
  region: string;
  /** Empty in the middle. */
  side: Side | "";
  path: string;
}

export interface Spot {
  area: number;
  side: Side | "";
  view: View;
  x: number;
  y: number;
  r: number;
}

type Circle = readonly [x: number, y: number, r: number];

/** The outline of two circles and what lies between them. */
function taper([x1, y1, r1]: Circle, [x2, y2, r2]: Circle): string {
  const d = Math.hypot(x2 - x1, y2 - y1);
  const along = Math.atan2(y2 - y1, x2 - x1);
  const open = Math.acos(Math.max(-1, Math.min(1, (r1 - r2) / d)));
  const at = (x: number, y: number, r: number, angle: number): string =>
    `${(x + r * Math.cos(angle)).toFixed(1)} ${(y + r * Math.sin(angle)).toFixed(1)}`;
  const [large1, large2] = open < Math.PI / 2 ? [1, 0] : [0, 1];
  return (
    `M${at(x1, y1, r1, along + open)}A${r1} ${r1} 0 ${large1} 1 ${at(x1, y1, r1, along - open)}` +
    `L${at(x2, y2, r2, along - open)}A${r2} ${r2} 0 ${large2} 1 ${at(x2, y2, r2, along + open)}Z`
  );
}

// Limbs of the side at the right of the drawing: region, from, to.
const LIMBS: readonly (readonly [string, Circle, Circle])[] = [
  ["Feet", [112, 400, 9], [118, 410, 8]],
  ["Lower legs", [112, 312, 15], [111, 388, 9]],
  ["Thighs and knees", [110, 226, 21], [112, 296, 15]],
  ["Hands and fingers", [165, 224, 13], [169, 246, 11]],
  ["Lower arms and wrist joints", [150, 158, 11], [161, 202, 8]],
  ["Upper arms and elbow joints", [137, 96, 14], [148, 146, 11]],
];

const TRUNK: Record<View, readonly (readonly [string, string])[]> = {
  front: [
    ["Pelvis", "M66 178Q95 186 124 178L131 208Q114 216 95 222Q76 216 59 208Z"],
    ["Abdomen", "M64 136Q95 144 126 136L124 176Q95 184 66 176Z"],
    ["Chest", "M62 84Q95 76 128 84L127 134Q95 142 63 134Z"],
    ["Neck", "M84 60L106 60L110 77Q95 73 80 77Z"],
    ["Face", "M73.5 34L116.5 34Q116 66 95 67Q74 66 73.5 34Z"],
    ["Skull and forehead", "M73.5 32Q74 6 95 6Q116 6 116.5 32Z"],
  ],
  back: [
    ["Pelvis", "M66 178Q95 186 124 178L131 208Q114 218 95 220Q76 218 59 208Z"],
    ["Back and shoulders", "M62 84Q95 74 128 84L127 134L124 176Q95 184 66 176L63 134Z"],
    ["Neck", "M83 58L107 58L110 76Q95 71 80 76Z"],
    ["Skull and forehead", "M73.5 36Q73 6 95 6Q117 6 116.5 36Q115 62 95 63Q75 62 73.5 36Z"],
  ],
};

// Of the shoulders one sees a cap from in front; the joint is an area of the back's region.
const SHOULDER: readonly [Circle, Circle] = [
  [129, 88, 11],
  [121, 85, 8],
];

const mirrored = ([x, y, r]: Circle): Circle => [WIDTH - x, y, r];

/** Which side of the person is at the right of the drawing. */
export function sideAtRight(view: View): Side {
  return view === "front" ? "left" : "right";
}

const opposite = (side: Side): Side => (side === "left" ? "right" : "left");

/** Outlines of a view, the ones behind first. */
export function outlines(view: View): Outline[] {
  const right = sideAtRight(view);
  const found: Outline[] = [];
  for (const [region, from, to] of LIMBS) {
    found.push({ region, side: right, path: taper(from, to) });
    found.push({ region, side: opposite(right), path: taper(mirrored(from), mirrored(to)) });
  }
  for (const [region, path] of TRUNK[view]) found.push({ region, side: "", path });
  if (view === "front") {
    const [from, to] = SHOULDER;
    found.push({ region: "Back and shoulders", side: right, path: taper(from, to) });
    found.push({
      region: "Back and shoulders",
      side: opposite(right),
      path: taper(mirrored(from), mirrored(to)),
    });
  }
  return found;
}

// area, view, x to the right of the middle, y, radius; in the middle when x is 0, else on both sides.
const SPOTS: readonly (readonly [number, View, number, number, number])[] = [
  [1, "front", 0, 20, 6],
  [2, "front", 17, 30, 4.5],
  [3, "front", 15, 52, 4.5],
  [4, "back", 8, 60, 4.5],
  [5, "back", 0, 74, 5],
  [6, "front", 34, 86, 6],
  [7, "back", 0, 164, 6],
  [8, "front", 0, 100, 6],
  [9, "front", 18, 108, 6],
  [10, "front", 0, 156, 7],
  [11, "front", 26, 190, 6],
  [12, "back", 43, 98, 6],
  [13, "back", 49, 126, 6],
  [14, "back", 64, 192, 5],
  [15, "back", 57, 166, 6],
  [16, "front", 57, 164, 6],
  [21, "front", 64, 222, 4.5],
  [26, "front", 16, 246, 7],
  [27, "front", 17, 296, 6.5],
  [28, "front", 16, 344, 6.5],
  [29, "back", 17, 330, 7],
];

// Areas of one hand each: dominant, other, view, x, y, radius.
const HAND_SPOTS: readonly (readonly [number, number, View, number, number, number])[] = [
  [17, 18, "front", 77, 250, 4.5],
  [19, 20, "back", 77, 248, 4.5],
  [22, 23, "front", 74, 234, 5],
  [24, 25, "back", 71, 228, 6],
];

/** Where the areas are, given the dominant hand. */
export function spots(dominant: Side): Spot[] {
  const found: Spot[] = [];
  for (const [area, view, dx, y, r] of SPOTS) {
    if (dx === 0) found.push({ area, side: "", view, x: MIDDLE, y, r });
    else for (const side of ["left", "right"] as const) found.push(placed(area, side, view, dx, y, r));
  }
  for (const [own, other, view, dx, y, r] of HAND_SPOTS) {
    found.push(placed(own, dominant, view, dx, y, r));
    found.push(placed(other, opposite(dominant), view, dx, y, r));
  }
  return found;
}

function placed(area: number, side: Side, view: View, dx: number, y: number, r: number): Spot {
  return { area, side, view, x: side === sideAtRight(view) ? MIDDLE + dx : MIDDLE - dx, y, r };
}
