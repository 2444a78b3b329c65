// Units in which the page writes what the engine says in metres and radians.

import { computed } from "@preact/signals";
import { lengthUnit } from "./editing/handles";
import { remembered } from "./remembered";
import { language, told, word } from "./words";

export { lengthUnit };

/** Angles: joints in degrees and figures as their criteria have them, or all of them in one. */
export const ANGLES = [word("as given"), "°", "rad"] as const;
export const angleUnit = remembered("seerob.angle", ANGLES, "as given");
/** Another object whenever `spoken` says the same otherwise. */
export const manner = computed(() => [language.value, lengthUnit.value, angleUnit.value]);

const DEGREES = 180 / Math.PI;

/** What a unit is written as, and how many of that are in it. */
export function shownIn(unit: string): { unit: string; scale: number } {
  if (lengthUnit.value === "mm" && /^m(\/s²?)?$/.test(unit)) return { unit: `m${unit}`, scale: 1000 };
  if (angleUnit.value === "°" && /^rad(\/s²?)?$/.test(unit))
    return { unit: unit.replace("rad", "°"), scale: DEGREES };
  return { unit, scale: 1 };
}

const NUMBER = "[-−]?\\d+(?:\\.\\d+)?";
/** Figures that share the unit after the last of them: `0.3 to 0.5 m`, `0.1 × 0.2 m`. */
const FIGURES = `(?<![\\w.\\-−])${NUMBER}(?:(?:…|–|, ?| [×x] | (?:to|and|or|bis|und|oder|à|et|ou|a|y|o|e) )${NUMBER})*`;
const METRES = new RegExp(`(${FIGURES})([ \\u00a0])m(?=/s²?(?![\\w/])|(?![\\w/²³·]))`, "g");
const RADIANS = new RegExp(`(${FIGURES})[ \\u00a0]rad(?! (?:or|oder|ou|o) )(?![\\w·])`, "g");
const DEGREES_SIGN = new RegExp(`(${FIGURES})°(?![\\wC])`, "g");

/** What the engine says, in the chosen language and units. Metres become millimetres without rounding. */
export function spoken(text: string): string {
  let shown = told(text);
  if (lengthUnit.value === "mm")
    shown = shown.replace(METRES, (_, n, gap) => `${each(n, thousandfold)}${gap}mm`);
  if (angleUnit.value === "°")
    shown = shown.replace(RADIANS, (_, n) => `${each(n, (x) => times(x, DEGREES))}°`);
  if (angleUnit.value === "rad")
    shown = shown.replace(DEGREES_SIGN, (_, n) => `${each(n, (x) => times(x, 1 / DEGREES))} rad`);
  return shown;
}

function each(figures: string, turn: (figure: string) => string): string {
  return figures.replace(new RegExp(NUMBER, "g"), turn);
}

/** The decimal point three places to the right. */
function thousandfold(figure: string): string {
  const [, sign, whole, part = ""] = /^([-−]?)(\d+)(?:\.(\d+))?$/.exec(figure)!;
  const digits = part.padEnd(3, "0");
  const before = `${whole}${digits.slice(0, 3)}`.replace(/^0+(?=\d)/, "");
  return `${sign}${before}${digits.length > 3 ? `.${digits.slice(3)}` : ""}`;
}

/** A figure in another unit, with one digit more than it had, three at least. */
function times(figure: string, factor: number): string {
  const digits = figure.replace(/^[-−]?0*\.?0*|[.]/g, "").length;
  return String(Number((Number(figure.replace("−", "-")) * factor).toPrecision(Math.max(3, digits + 1))));
}
