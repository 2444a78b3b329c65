// The colours of the room, dark or light as the page is: in both, verdicts stand out from the ground and from each
// other, and the legend has the same.

import { signal } from "@preact/signals";
import { DOUBT_COLOR, NEUTRAL_COLOR, VERDICT_COLORS } from "../verdicts";
import type { Verdict } from "../wire";

/** `mark` is what points, measures or shows what is selected: it has no verdict, and stands out from the ground. */
export type Tone = Verdict | "none" | "doubt" | "mark";

/** Colours, sRGB. */
export interface RoomLook {
  ground: number;
  /** Lines per half metre and per metre, and the two horizontal axes of the world. */
  grid: readonly [half: number, whole: number, x: number, y: number];
  tones: Readonly<Record<Tone, number>>;
}

const DARK: RoomLook = {
  ground: 0x10151c,
  grid: [0x1b232e, 0x2a3646, 0xa8475c, 0x4c8f6a],
  tones: { ...VERDICT_COLORS, none: NEUTRAL_COLOR, doubt: DOUBT_COLOR, mark: 0xffffff },
};

const LIGHT: RoomLook = {
  ground: 0xe3e8ee,
  grid: [0xd3dae2, 0xbac4cf, 0xb0506a, 0x3f8560],
  tones: {
    within: 0x0f8b97,
    exceeded: 0xc11540,
    undecided: 0x8f7300,
    none: 0x4e5c6d,
    doubt: 0x6f7a88,
    mark: 0x141b25,
  },
};

export const LOOKS = { dark: DARK, light: LIGHT };

/** How the room looks now: dark, until the page says that it is light itself. */
export const roomLook = signal<RoomLook>(DARK);
