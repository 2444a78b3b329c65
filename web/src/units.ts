// Units in which the page writes what the engine says in metres and radians.

import { lengthUnit } from "./editing/handles";
import { remembered } from "./remembered";
import { word } from "./words";

export { lengthUnit };

/** Angles: joints in degrees and figures as their criteria have them, or all of them in one. */
export const ANGLES = [word("as given"), "°", "rad"] as const;
export const angleUnit = remembered("seerob.angle", ANGLES, "as given");

const DEGREES = 180 / Math.PI;

/** What a unit is written as, and how many of that are in it. */
export function shownIn(unit: string): { unit: string; scale: number } {
  if (lengthUnit.value === "mm" && /^m(\/s²?)?$/.test(unit)) return { unit: `m${unit}`, scale: 1000 };
  if (angleUnit.value === "°" && /^rad(\/s²?)?$/.test(unit))
    return { unit: unit.replace("rad", "°"), scale: DEGREES };
  return { unit, scale: 1 };
}
