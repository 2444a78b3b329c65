// From a result's rows to what the body map shows of each place: which row, and how near it is to its limit.

import type { ToldResult } from "../messages";
import type { Input, Row, RowState, Scene } from "../wire";
import { word } from "../words";
import type { Side, Spot } from "./figure";

/** Which of the limits of a contact is looked at. */
export type Aspect = "worst" | "force" | "pressure" | "energy";

/** How a place looks; `clear` is out of reach of anything that moves. */
export type Look = "clear" | "low" | "middle" | "high" | "exceeded" | "undecided" | "forbidden" | "none";

/** A row and the criterion that it is from. */
export interface Told {
  criterion: string;
  row: Row;
}

/** Shares of the limit at which the colour changes. */
export const BANDS = [0.5, 0.8, 1] as const;

export const LOOK_WORDS: Record<Look, string> = {
  clear: word("nothing within reach moves"),
  low: word("under half of the limit"),
  middle: word("half to 80 %"),
  high: word("80 to 100 %"),
  exceeded: word("over the limit"),
  undecided: word("undecided"),
  forbidden: word("contact not permitted"),
  none: word("no limit available"),
};

const WITHOUT_LIMIT: ReadonlySet<RowState> = new Set(["forbidden", "no_limit", "excluded"]);

/** Worst first. */
const ORDER: readonly Look[] = [
  "exceeded",
  "forbidden",
  "undecided",
  "high",
  "middle",
  "low",
  "none",
  "clear",
];

/** Rows that speak of the body map: those with areas, and those that have no limit anywhere. */
export function contactRows(results: readonly ToldResult[], only: string | null): Told[] {
  return results
    .filter((result) => only === null || result.name === only)
    .flatMap((result) => result.rows.filter(isContact).map((row) => ({ criterion: result.name, row })));
}

/** Whether a row is of a contact, not of a score. */
export function isContact(row: Row): boolean {
  return row.scale == null && (row.areas.length > 0 || WITHOUT_LIMIT.has(row.state));
}

/** Present speed as a share of what a limit allows; null when that is not known, infinite when it allows none. */
export function shareOf(row: Row, aspect: Aspect): number | null {
  const allowed =
    aspect === "worst" ? row.limit : row.aspects.find((a) => a.name === `allowed by ${aspect}`)?.value;
  if (allowed == null || row.value == null) return null;
  return allowed > 0 ? row.value / allowed : Number.POSITIVE_INFINITY;
}

/** How a row looks on the map. */
export function lookOf(row: Row | undefined, aspect: Aspect): Look {
  if (!row) return "clear";
  if (row.state === "forbidden") return "forbidden";
  if (row.state === "no_limit" || row.state === "excluded") return "none";
  const share = shareOf(row, aspect);
  // Over one of the limits is over, whatever is not known of another.
  if (share !== null && share > 1) return "exceeded";
  if (aspect === "worst" && row.verdict === "undecided") return "undecided";
  if (aspect === "worst" && row.verdict === "exceeded") return "exceeded";
  if (share === null) return "undecided";
  return share < BANDS[0] ? "low" : share < BANDS[1] ? "middle" : "high";
}

/**
 * How a place looks, of which `told` is the worst row that speaks of it.
 *
 * @param open Whether a criterion leaves open what can be hit: then no place is known to be harmless.
 */
export function lookAt(told: Told | undefined, aspect: Aspect, open: boolean): Look {
  const look = lookOf(told?.row, aspect);
  return open && look !== "exceeded" && look !== "forbidden" ? "undecided" : look;
}

/**
 * Whether a criterion leaves open what of the body can be hit, beside the places that its rows speak of.
 *
 * One that is undecided as a whole has no rows, or none that is within; of one that is undecided because of a place
 * others are within.
 */
export function leavesOpen({ verdict, muted, rows }: ToldResult): boolean {
  const limited = rows.filter((row) => isContact(row) && !WITHOUT_LIMIT.has(row.state));
  if (limited.some((row) => row.verdict === "within")) return false;
  return muted || verdict === "undecided" || limited.some((row) => row.verdict === "undecided");
}

/** The worst row of a spot; undefined where nothing can be hit. */
export function toldOf(
  spot: Pick<Spot, "area" | "side">,
  all: readonly Told[],
  aspect: Aspect,
): Told | undefined {
  return worst(
    all.filter(({ row }) => row.areas.includes(spot.area) && onSide(row, spot.side)),
    aspect,
  );
}

/** The worst row of a whole region on one side; the middle has every side's. */
export function toldOfRegion(
  region: string,
  side: Side | "",
  all: readonly Told[],
  aspect: Aspect,
): Told | undefined {
  return worst(
    all.filter(({ row }) => (row.group || row.name) === region && onSide(row, side)),
    aspect,
  );
}

/** The worst of several rows. */
export function worst(all: readonly Told[], aspect: Aspect): Told | undefined {
  const key = ({ row }: Told): [number, number] => [
    ORDER.indexOf(lookOf(row, aspect)),
    -(shareOf(row, aspect) ?? 0),
  ];
  return [...all].sort((a, b) => {
    const [la, sa] = key(a);
    const [lb, sb] = key(b);
    return la - lb || sa - sb || 0;
  })[0];
}

/** Inputs of the basis that a row's limit is from, in its order. */
export function inputsOf({ criterion, row }: Told, scene: Scene): Input[] {
  const inputs = scene.criteria.find((c) => c.name === criterion)?.basis?.inputs ?? [];
  return row.inputs.flatMap((name) => inputs.find((input) => input.name === name) ?? []);
}

/** The dominant hand, from rows that say on which side a dominant area is; right where nobody says. */
export function dominantHand(all: readonly Told[]): Side {
  for (const { row } of all) {
    if (!row.side || !row.name.includes("dominant")) continue;
    const side = row.side as Side;
    if (!row.name.includes("non-dominant")) return side;
    return side === "left" ? "right" : "left";
  }
  return "right";
}

function onSide(row: Row, side: Side | ""): boolean {
  return !row.side || side === "" || row.side === side;
}
