// Where something is, in the form in which the file says it.

import { Euler, MathUtils, Quaternion, Vector3 } from "three";
import type { Change } from "../wire";
import { type Entry, isPlaced, type Path, PLACED, set, type Table } from "./draft";

const LENGTHS: Record<string, number> = {
  position: 1,
  position_mm: 1e-3,
  position_cm: 1e-2,
  position_inch: 0.0254,
};
// Roll, pitch, yaw about the fixed x, y, z are yaw, pitch, roll about the turned axes.
export const ORDER = "ZYX";

export interface Placing {
  /** [m] */
  position: Vector3;
  rotation: Quaternion;
  /** Roll, pitch, yaw [°]. */
  rpy: [number, number, number];
}

/** Key of the table that says where an entry is; null for what has no place. */
export function poseKey(entry: Entry): string | null {
  // A waypoint may be one of joints, which has no place of its own.
  if (entry.group === "waypoints" && entry.table.at === undefined) return null;
  return isPlaced(entry.group) ? PLACED[entry.group] : null;
}

function poseTable(entry: Entry): Table {
  const key = poseKey(entry);
  const table = key === null ? null : entry.table[key];
  return typeof table === "object" && table !== null ? (table as Table) : {};
}

const positionKey = (table: Table): string => Object.keys(LENGTHS).find((key) => key in table) ?? "position";

export function placing(entry: Entry): Placing {
  const table = poseTable(entry);
  const key = positionKey(table);
  const position = new Vector3().fromArray(numbers(table[key], 3)).multiplyScalar(LENGTHS[key]!);
  let rpy = numbers(table.rpy_deg, 3) as [number, number, number];
  if (table.rpy) rpy = numbers(table.rpy, 3).map(MathUtils.radToDeg) as [number, number, number];
  const rotation = new Quaternion().setFromEuler(
    new Euler(...(rpy.map(MathUtils.degToRad) as [number, number, number]), ORDER),
  );
  if (table.wxyz) {
    const [w, x, y, z] = numbers(table.wxyz, 4) as [number, number, number, number];
    rotation.set(x, y, z, w).normalize();
    const euler = new Euler().setFromQuaternion(rotation, ORDER);
    rpy = [euler.x, euler.y, euler.z].map((angle) => tidy(MathUtils.radToDeg(angle), 4)) as typeof rpy;
  }
  return { position, rotation, rpy };
}

function numbers(value: unknown, count: number): number[] {
  const found = Array.isArray(value) ? value.map(Number) : [];
  while (found.length < count) found.push(0);
  return found;
}

export const tidy = (value: number, digits: number): number => Number(value.toFixed(digits)) + 0;

/** Changes that put an entry somewhere else; of a length and an angle the file's own units stay. */
export function moveTo(entry: Entry, position: Vector3 | null, rotation: Quaternion | null): Change[] {
  const at = poseKey(entry);
  if (at === null) return [];
  const start: Path = [...entry.path, at];
  const table = poseTable(entry);
  const made: Table = {};
  if (position) {
    const key = positionKey(table);
    made[key] = position.toArray().map((x) => tidy(x / LENGTHS[key]!, key === "position" ? 4 : 2));
  }
  if (rotation) {
    const euler = new Euler().setFromQuaternion(rotation, ORDER);
    const angles = [euler.x, euler.y, euler.z];
    if (table.wxyz) made.wxyz = [rotation.w, rotation.x, rotation.y, rotation.z].map((x) => tidy(x, 8));
    else if (table.rpy) made.rpy = angles.map((x) => tidy(x, 6));
    else made.rpy_deg = angles.map((x) => tidy(MathUtils.radToDeg(x), 3));
  }
  if (entry.table[at] === undefined) return [set(start, made)];
  return Object.entries(made).map(([key, value]) => set([...start, key], value));
}

/** Changes that set one coordinate [m] or angle [°] as it was written. */
export function setNumber(entry: Entry, what: "position" | "rpy", axis: number, value: number): Change[] {
  const at = poseKey(entry);
  if (at === null) return [];
  const table = poseTable(entry);
  const now = placing(entry);
  if (what === "position") {
    const key = positionKey(table);
    const own = tidy(value / LENGTHS[key]!, 9);
    if (key in table) return [set([...entry.path, at, key, axis], own)];
    return moveTo(entry, now.position.setComponent(axis, value), null);
  }
  const rpy = now.rpy;
  rpy[axis] = value;
  if (Array.isArray(table.rpy_deg)) return [set([...entry.path, at, "rpy_deg", axis], value)];
  const turned = new Euler(...(rpy.map(MathUtils.degToRad) as [number, number, number]), ORDER);
  return moveTo(entry, null, new Quaternion().setFromEuler(turned));
}
