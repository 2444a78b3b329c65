// The floor: a line per half metre, stronger per metre, and the two horizontal axes of the world.

import { BufferGeometry, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments } from "three";
import { roomLook } from "./room_look";

const HALF = 6;

export function makeGrid(): Group {
  const grid = new Group();
  grid.name = "grid";
  const [half, whole, x, y] = roomLook.peek().grid;
  grid.add(lines(0.5, half), lines(1, whole), axis([1, 0, 0], x), axis([0, 0, -1], y));
  return grid;
}

/** Give it the colours of the room as it looks now. */
export function recolorGrid(grid: Group): void {
  const colors = roomLook.peek().grid;
  for (const [k, part] of grid.children.entries())
    ((part as LineSegments).material as LineBasicMaterial).color.setHex(colors[k]!);
}

function lines(pitch: number, color: number): LineSegments {
  const points: number[] = [];
  for (let at = -HALF; at <= HALF + 1e-9; at += pitch) {
    if (Math.abs(at) < 1e-9) continue;
    points.push(at, 0, -HALF, at, 0, HALF, -HALF, 0, at, HALF, 0, at);
  }
  return segments(points, color);
}

// From the origin along +x or +y of the world, which is z-up; here it is already turned.
function axis(direction: [number, number, number], color: number): LineSegments {
  const [x, y, z] = direction;
  return segments([0, 0, 0, x * HALF, y * HALF, z * HALF], color);
}

function segments(points: number[], color: number): LineSegments {
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
  return new LineSegments(geometry, new LineBasicMaterial({ color, transparent: true, depthWrite: false }));
}
