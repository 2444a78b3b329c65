// Scores of a posture as the panel and the manikin show them: components by side, shares of the scale, colours.

import type { ToldResult } from "../messages";
import type { Row } from "../wire";
import { word } from "../words";

export type Palette = "green to red" | "blue to orange";
export const PALETTES: readonly Palette[] = [word("green to red"), word("blue to orange")];

/** Name of a row that is the total of a side, or of the whole. */
export const TOTAL = "score";

/** One component with what each side says. */
export interface Component {
  name: string;
  left: Row | null;
  right: Row | null;
  /** Of the middle of the body, or where sides are not told apart. */
  middle: Row | null;
}

/** Results that have scores by body part. */
export function scored(results: readonly ToldResult[]): ToldResult[] {
  return results.filter((result) => result.rows.some(isScore));
}

export function isScore(row: Row): boolean {
  return row.scale != null || row.state === "not_assessed";
}

/** The components of a result in its own order, the total first. */
export function components(rows: readonly Row[]): Component[] {
  const byName = new Map<string, Component>();
  for (const row of rows.filter(isScore)) {
    const one = byName.get(row.name) ?? { name: row.name, left: null, right: null, middle: null };
    byName.set(row.name, one);
    if (row.side === "left") one.left = row;
    else if (row.side === "right") one.right = row;
    else one.middle = row;
  }
  return [...byName.values()].sort((a, b) => Number(b.name === TOTAL) - Number(a.name === TOTAL));
}

/** Where on its scale a score is: 0 at the best that there can be, 1 at the worst; null when not assessed. */
export function shareOfScale(row: Row): number | null {
  if (row.value == null || row.scale == null) return null;
  const [best, worst] = row.scale;
  if (worst === best) return 0;
  return Math.min(1, Math.max(0, (row.value - best) / (worst - best)));
}

type Rgb = readonly [number, number, number];

// Each is read by its lightness too: the ends differ from the middle and from each other for every eye.
const STOPS: Record<Palette, readonly [Rgb, Rgb, Rgb]> = {
  "green to red": [
    [46, 160, 92],
    [240, 200, 60],
    [206, 40, 68],
  ],
  "blue to orange": [
    [58, 118, 196],
    [224, 218, 200],
    [226, 104, 20],
  ],
};

/** Colour of a share, sRGB as 0xrrggbb. */
export function scaleColor(share: number, palette: Palette): number {
  const [low, middle, high] = STOPS[palette];
  const [from, to, part] = share < 0.5 ? [low, middle, share * 2] : [middle, high, share * 2 - 1];
  const mix = (i: 0 | 1 | 2): number => Math.round(from[i] + part * (to[i] - from[i]));
  return (mix(0) << 16) | (mix(1) << 8) | mix(2);
}

export function cssColor(color: number): string {
  return `#${color.toString(16).padStart(6, "0")}`;
}

/** What the manikin is coloured by. */
export type Coloring = "parts" | "overall" | "verdict";
export const COLORINGS: readonly Coloring[] = ["parts", "overall", "verdict"];

/** Colour per node: each bone by the worst of its components, or all of them by the total. */
export function tints(result: ToldResult | undefined, by: Coloring, palette: Palette): Map<string, number> {
  const found = new Map<string, number>();
  if (!result || by === "verdict") return found;
  const rows = result.rows.filter(isScore);
  const total = Math.max(...rows.filter((r) => r.name === TOTAL).map((r) => shareOfScale(r) ?? -1), -1);
  const shares = new Map<string, number>();
  for (const row of rows) {
    const share = by === "overall" ? total : (shareOfScale(row) ?? -1);
    if (share < 0 || (by === "parts" && row.name === TOTAL)) continue;
    for (const bone of row.bones) shares.set(bone, Math.max(shares.get(bone) ?? 0, share));
  }
  for (const [bone, share] of shares) found.set(bone, scaleColor(share, palette));
  return found;
}
