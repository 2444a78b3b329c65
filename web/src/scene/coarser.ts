// A surface with fewer corners, for where the difference is smaller than a pixel of the screen.

import { BufferAttribute, BufferGeometry } from "three";

/** A surface, and how far a point of the one that it was made of may be from where it is now [m]. */
export interface Coarser {
  shape: BufferGeometry;
  off: number;
}

/**
 * Corners that lie in one cell of a grid, and of which the triangles face alike, made one.
 *
 * @param surface Triangles with normals.
 * @param cell Edge of a cell [m]; 0 makes one of corners that are equal, and changes nothing that is drawn.
 * @returns Triangles with an index; no point is off by more than the diagonal of a cell.
 */
export function coarser(surface: BufferGeometry, cell: number): Coarser {
  const at = surface.getAttribute("position");
  const normal = surface.getAttribute("normal");
  const index = surface.getIndex();
  const corners = index ? index.count : at.count;
  const numbers = new Map<string, number>();
  const kept: number[] = [];
  const sums: number[] = [];
  const made = new Uint32Array(corners);
  let off = 0;
  for (let k = 0; k < corners; k += 1) {
    const i = index ? index.getX(k) : k;
    const [x, y, z] = [at.getX(i), at.getY(i), at.getZ(i)];
    const [a, b, c] = [normal.getX(i), normal.getY(i), normal.getZ(i)];
    const key =
      cell > 0
        ? `${Math.floor(x / cell)} ${Math.floor(y / cell)} ${Math.floor(z / cell)} ${facing(a, b, c)}`
        : `${x} ${y} ${z} ${a} ${b} ${c}`;
    let number = numbers.get(key);
    if (number === undefined) {
      number = numbers.size;
      numbers.set(key, number);
      kept.push(x, y, z);
      sums.push(0, 0, 0);
    }
    const first = 3 * number;
    off = Math.max(off, Math.hypot(x - kept[first]!, y - kept[first + 1]!, z - kept[first + 2]!));
    for (const [j, n] of [a, b, c].entries()) sums[3 * number + j]! += n;
    made[k] = number;
  }
  const triangles: number[] = [];
  for (let k = 0; k + 2 < corners; k += 3) {
    const [p, q, r] = [made[k]!, made[k + 1]!, made[k + 2]!];
    if (p !== q && q !== r && r !== p) triangles.push(p, q, r);
  }
  for (let k = 0; k < sums.length; k += 3) {
    const size = Math.hypot(sums[k]!, sums[k + 1]!, sums[k + 2]!) || 1;
    for (let j = k; j < k + 3; j += 1) sums[j]! /= size;
  }
  const fewer = new BufferGeometry();
  fewer.setAttribute("position", new BufferAttribute(new Float32Array(kept), 3));
  fewer.setAttribute("normal", new BufferAttribute(new Float32Array(sums), 3));
  fewer.setIndex(new BufferAttribute(new Uint32Array(triangles), 1));
  return { shape: fewer, off };
}

/** Which of the six directions of the axes a normal is nearest to. */
function facing(a: number, b: number, c: number): number {
  const sizes = [Math.abs(a), Math.abs(b), Math.abs(c)];
  const axis = sizes.indexOf(Math.max(...sizes));
  return 2 * axis + ([a, b, c][axis]! < 0 ? 1 : 0);
}
