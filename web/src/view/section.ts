// A plane that cuts the room open: what lies beyond it is not drawn, and not clicked.

import { signal } from "@preact/signals";
import { Plane, Vector3 } from "three";
import { word } from "../words";

export const SECTIONS = [word("no section"), "x", "y", "z"] as const;
export type SectionAxis = (typeof SECTIONS)[number];

export const sectionAxis = signal<SectionAxis>("no section");
/** Where it cuts the axis of the world [m]; what is beyond is not drawn. */
export const sectionAt = signal(1);

// The world's z is three.js's y, its y three.js's −z.
const NORMALS = { x: new Vector3(-1, 0, 0), y: new Vector3(0, 0, 1), z: new Vector3(0, -1, 0) };

/** Planes of three.js's own world that keep what is before the section. */
export function sectionPlanes(): Plane[] {
  const axis = sectionAxis.value;
  return axis === "no section" ? [] : [new Plane(NORMALS[axis].clone(), sectionAt.value)];
}
