// Numbers for people: enough digits to compare with the limit, a true minus, units beside.

import { angleUnit, shownIn } from "./units";

const NO_BREAK = "\u00a0";

/** Decimals that give three significant digits at this magnitude. */
function decimalsFor(magnitude: number): number {
  if (!(magnitude > 0)) return 2;
  return Math.min(4, Math.max(0, 2 - Math.floor(Math.log10(magnitude))));
}

/** A number; `like` fixes the decimals so that a changing value does not jump. */
export function formatNumber(value: number | null, like: number | null = null): string {
  if (value === null || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (size !== 0 && (size < 5e-4 || size >= 1e6)) return value.toExponential(2).replaceAll("-", "−");
  return formatFixed(value, decimalsFor(Math.abs(like ?? value)));
}

export function formatQuantity(value: number | null, given: string, like: number | null = null): string {
  const { unit, scale } = shownIn(given);
  const text = formatNumber(value === null ? null : value * scale, like === null ? null : like * scale);
  return value === null || unit === "" ? text : `${text}${NO_BREAK}${unit}`;
}

/** Run time as minutes and seconds. */
export function formatTime(t: number): string {
  if (!Number.isFinite(t)) return "–";
  const sign = t < 0 ? "−" : "";
  const centis = Math.round(Math.abs(t) * 100);
  const minutes = Math.floor(centis / 6000);
  const seconds = ((centis % 6000) / 100).toFixed(2).padStart(5, "0");
  return `${sign}${minutes}:${seconds}`;
}

/** A joint position: angles in degrees, as robots' own panels show them. */
export function formatJoint(value: number, unit: string): string {
  return unit === "rad" && angleUnit.value !== "rad"
    ? `${formatFixed((value * 180) / Math.PI, 1)}°`
    : `${formatFixed(value * shownIn(unit).scale, shownIn(unit).unit === "mm" ? 1 : 4)}${NO_BREAK}${shownIn(unit).unit}`;
}

/** A number with so many decimals and a true minus. */
export function formatFixed(value: number, decimals: number): string {
  const text = value.toFixed(decimals);
  return (Number(text) === 0 ? text.replace("-", "") : text).replace("-", "−");
}

/** A text of at most `most` characters: what is left out is in its middle, as its end is often the figure. */
export function shortened(text: string, most: number): string {
  const characters = [...text];
  if (characters.length <= most) return text;
  const end = Math.floor((most - 1) / 2);
  return `${characters.slice(0, most - 1 - end).join("")}…${characters.slice(characters.length - end).join("")}`;
}

/** The part of a full name below its owner: `ur10/forearm_link` → `forearm_link`. */
export function shortName(name: string, owner: string): string {
  return name.startsWith(`${owner}/`) ? name.slice(owner.length + 1) : name;
}
