// Numbers as text that is never kinder than the number: the page's twin of seerob/core/figures.py, which terminal
// and report write with. A value beside its limit keeps its side; where rounding must choose, it chooses
// against whoever hopes for *within*.

import { angleUnit, lengthUnit, shownIn } from "./units";
import { said } from "./words";

/** What figures are written in. */
export { angleUnit, lengthUnit };

const NO_BREAK = "\u00a0";

/** Places after the point per unit: what a twin can be asked for, 0.1 mm for a distance. */
const DECIMALS: Readonly<Record<string, number>> = {
  m: 4,
  "m/s": 3,
  "m/s²": 2,
  "m/rad": 4,
  mm: 1,
  "mm/s": 0,
  "mm/s²": 0,
  rad: 4,
  "rad/s": 3,
  s: 2,
  J: 3,
  kg: 3,
  N: 1,
  N·m: 2,
  W: 2,
};
/** Significant digits of other units. */
const DIGITS = 4;
/** Places after the point beyond which other units count as 0 too. */
const SMALLEST = 9;
/** Significant digits that a number is trusted for: 0.1 + 0.2 is 0.3. */
const EXACT = 12;
const MOST = 17;
const HUGE = 1e15;

type Rounding = "up" | "down" | "nearest";

/** A value and its limit, without units. */
export interface Pair {
  value: string;
  limit: string;
}

/** A number without a limit, rounded to the nearest; a dash for what is not there. Its unit is not written. */
export function figure(value: number | null, given: string): string {
  if (value === null || Number.isNaN(value)) return "–";
  const { unit, scale } = shownIn(given);
  return text(value * scale, placesOf(unit, [value * scale]), "nearest");
}

/** A value and its limit, on the same side of each other as the numbers are. */
export function against(inSi: number | null, limitInSi: number | null, given: string, atMost: boolean): Pair {
  if (inSi === null || limitInSi === null || !Number.isFinite(inSi) || !Number.isFinite(limitInSi)) {
    return { value: figure(inSi, given), limit: figure(limitInSi, given) };
  }
  const { unit, scale } = shownIn(given);
  const [value, limit] = [inSi * scale, limitInSi * scale];
  const [worse, better]: [Rounding, Rounding] = atMost ? ["up", "down"] : ["down", "up"];
  const places = placesOf(unit, [value, limit]);
  for (let more = 0; more < MOST; more += 1) {
    const shown = { value: text(value, places + more, worse), limit: text(limit, places + more, better) };
    if (beyond(back(shown.value), back(shown.limit), atMost) === beyond(value, limit, atMost)) return shown;
  }
  return { value: signed(String(value)), limit: signed(String(limit)) };
}

/** How far a value is inside (rounded down) or beyond (rounded up, with a minus) its limit. */
export function gap(inSi: number, limitInSi: number, given: string, atMost: boolean): string {
  const { unit, scale } = shownIn(given);
  const [value, limit] = [inSi * scale, limitInSi * scale];
  const left = atMost ? limit - value : value - limit;
  const places = placesOf(unit, [value, limit]);
  if (left >= 0) return text(left, places, "down");
  for (let more = 0; more < MOST; more += 1) {
    const shown = text(left, places + more, "down");
    // An excess below the column's precision is still one.
    if (back(shown) < 0) return shown;
  }
  return signed(String(left));
}

/** What is allowed or kept at least: rounded down. */
export function atLeast(value: number | null, given: string): string {
  if (value === null || Number.isNaN(value)) return "–";
  const { unit, scale } = shownIn(given);
  return text(value * scale, placesOf(unit, [value * scale]), "down");
}

/** Where a value lies, with its unit: rounded outward. */
export function between([low, high]: readonly [number, number], given: string): string {
  const { unit, scale } = shownIn(given);
  const places = placesOf(unit, [low * scale, high * scale]);
  return said("{low} and {high}", {
    low: withUnit(text(low * scale, places, "down"), given),
    high: withUnit(text(high * scale, places, "up"), given),
  });
}

/** The same number with as many places as its unit has, so that a changing one does not jump. */
export function steady(shown: string, unit: string): string {
  const places = DECIMALS[shownIn(unit).unit];
  if (places === undefined || !/^−?\d/.test(shown)) return shown;
  const [whole, fraction = ""] = shown.split(".");
  if (places === 0) return shown;
  return `${whole}.${fraction.padEnd(places, "0")}`;
}

/** A number as text with its unit. */
export function withUnit(number: string, unit: string): string {
  return unit === "" || number === "–" ? number : `${number}${NO_BREAK}${shownIn(unit).unit}`;
}

/**
 * A share in percent with its sign, rounded down, or up where much is bad; tenths where whole ones would
 * hide on which side of zero it is.
 */
export function percent(share: number | null, rounding: "up" | "down" = "down"): string {
  if (share === null || Number.isNaN(share)) return "–";
  const hundredths = share * 100;
  if (Math.abs(hundredths) > 999) return hundredths > 0 ? `>999${NO_BREAK}%` : `<−999${NO_BREAK}%`;
  const places = Math.abs(hundredths) < 2 && hundredths !== 0 ? 1 : 0;
  return `${text(hundredths, places, rounding)}${NO_BREAK}%`;
}

function placesOf(unit: string, values: readonly number[]): number {
  const known = DECIMALS[unit];
  if (known !== undefined) return known;
  const largest = Math.max(0, ...values.filter(Number.isFinite).map(Math.abs));
  if (largest === 0) return 0;
  return Math.min(Math.max(DIGITS - 1 - exponentOf(largest), 0), SMALLEST);
}

function exponentOf(value: number): number {
  return Number(value.toExponential().split("e")[1]);
}

function text(value: number, places: number, rounding: Rounding): string {
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (Math.abs(value) >= HUGE) return signed(String(value));
  if (Math.abs(value) < 10 ** -places / 1000) return "0";
  const units = unitsOf(Math.abs(value), places, value < 0 ? opposite(rounding) : rounding);
  if (units === 0n) return "0";
  const digits = units.toString().padStart(places + 1, "0");
  const cut = digits.length - places;
  const fraction = digits.slice(cut).replace(/0+$/, "");
  return `${value < 0 ? "−" : ""}${digits.slice(0, cut)}${fraction === "" ? "" : `.${fraction}`}`;
}

/** A number above zero in units of the last place, by the decimal digits that it is trusted for. */
function unitsOf(value: number, places: number, rounding: Rounding): bigint {
  const [mantissa, exponent] = value.toExponential(EXACT - 1).split("e") as [string, string];
  const digits = BigInt(mantissa.replace(".", ""));
  const shift = Number(exponent) - (EXACT - 1) + places;
  if (shift >= 0) return digits * 10n ** BigInt(shift);
  const unit = 10n ** BigInt(-shift);
  const [whole, rest] = [digits / unit, digits % unit];
  if (rounding === "nearest") {
    const twice = 2n * rest;
    const up = twice > unit || (twice === unit && whole % 2n === 1n);
    return up ? whole + 1n : whole;
  }
  return rounding === "up" && rest > 0n ? whole + 1n : whole;
}

function opposite(rounding: Rounding): Rounding {
  return rounding === "up" ? "down" : rounding === "down" ? "up" : rounding;
}

function signed(shown: string): string {
  return shown.replaceAll("-", "−");
}

function back(shown: string): number {
  return Number(shown.replaceAll("−", "-"));
}

function beyond(value: number, limit: number, atMost: boolean): boolean {
  return atMost ? value > limit : value < limit;
}
