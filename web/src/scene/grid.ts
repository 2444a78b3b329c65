// The floor: a line per half metre, stronger per metre, and the two horizontal axes of the world.

import { BufferGeometry, Float32BufferAttribute, Group, LineBasicMaterial, LineSegments } from "three";

const HALF = 6;

export function makeGrid(): Group {
  const grid = new Group();
  grid.name = "grid";
  grid.add(lines(0.5, 0x1b232e), lines(1, 0x2a3646), axis([1, 0, 0], 0xa8475c), axis([0, 0, -1], 0x4c8f6a));
  return grid;
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
