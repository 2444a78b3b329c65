// A surface with fewer corners, for where the difference is smaller than a pixel of the screen.

import { BufferAttribute, BufferGeometry } from "three";

/** A surface, and how it stands for the true one. */
export interface Coarser {
  shape: BufferGeometry;
  /** How far a corner of the true one may be from where it is now [m]. */
  off: number;
  /** The corner here that stands for each of the true one; left out where they are the same. */
  standIn?: Uint32Array;
}

/** Corners between two looks at the clock. */
const AT_ONCE = 2048;

/**
 * Corners that lie in one cell of a grid, and of which the triangles face alike, made one, some at each step.
 *
 * @param truth The surface that it is to stand for: triangles with normals.
 * @param before What it is made of: that, or a coarser one of it.
 * @param cell Edge of a cell [m]; 0 makes one of corners that are equal, and changes nothing that is drawn.
 * @returns Triangles with an index; no corner of `before` is off by more than the diagonal of a cell.
 */
export function* coarsening(
  truth: BufferGeometry,
  before: Coarser,
  cell: number,
): Generator<undefined, Coarser> {
  const { shape } = before;
  const at = shape.getAttribute("position");
  const normal = shape.getAttribute("normal");
  const numbers = new Numbers(at.count);
  const exact = new Float32Array(6);
  const bits = new Int32Array(exact.buffer);
  const coarse = new Int32Array(4);
  const kept: number[] = [];
  const sums: number[] = [];
  const made = new Uint32Array(at.count);
  for (let i = 0; i < at.count; i += 1) {
    if (i % AT_ONCE === AT_ONCE - 1) yield;
    const x = at.getX(i);
    const y = at.getY(i);
    const z = at.getZ(i);
    const a = normal.getX(i);
    const b = normal.getY(i);
    const c = normal.getZ(i);
    const key = cell > 0 ? coarse : bits;
    if (cell > 0) {
      coarse[0] = Math.floor(x / cell);
      coarse[1] = Math.floor(y / cell);
      coarse[2] = Math.floor(z / cell);
      coarse[3] = facing(a, b, c);
    } else {
      // Of two zeros there is one.
      exact[0] = x + 0;
      exact[1] = y + 0;
      exact[2] = z + 0;
      exact[3] = a + 0;
      exact[4] = b + 0;
      exact[5] = c + 0;
    }
    const number = numbers.of(key);
    if (3 * number === kept.length) {
      kept.push(x, y, z);
      sums.push(0, 0, 0);
    }
    sums[3 * number]! += a;
    sums[3 * number + 1]! += b;
    sums[3 * number + 2]! += c;
    made[i] = number;
  }
  const index = shape.getIndex();
  const corners = index ? index.count : at.count;
  const triangles: number[] = [];
  for (let k = 0; k + 2 < corners; k += 3) {
    if (k % (3 * AT_ONCE) === 0) yield;
    const [p, q, r] = index
      ? [made[index.getX(k)]!, made[index.getX(k + 1)]!, made[index.getX(k + 2)]!]
      : [made[k]!, made[k + 1]!, made[k + 2]!];
    if (p !== q && q !== r && r !== p) triangles.push(p, q, r);
  }
  const own = truth.getAttribute("position");
  const standIn = before.standIn ? new Uint32Array(own.count) : made;
  let off = 0;
  for (let i = 0; i < own.count; i += 1) {
    if (i % (4 * AT_ONCE) === 0) yield;
    const first = 3 * (before.standIn ? made[before.standIn[i]!]! : made[i]!);
    standIn[i] = first / 3;
    off = Math.max(
      off,
      Math.hypot(own.getX(i) - kept[first]!, own.getY(i) - kept[first + 1]!, own.getZ(i) - kept[first + 2]!),
    );
  }
  for (let k = 0; k < sums.length; k += 3) {
    const size = Math.hypot(sums[k]!, sums[k + 1]!, sums[k + 2]!) || 1;
    for (let j = k; j < k + 3; j += 1) sums[j]! /= size;
  }
  const fewer = new BufferGeometry();
  fewer.setAttribute("position", new BufferAttribute(new Float32Array(kept), 3));
  fewer.setAttribute("normal", new BufferAttribute(new Float32Array(sums), 3));
  fewer.setIndex(new BufferAttribute(new Uint32Array(triangles), 1));
  return { shape: fewer, off, standIn };
}

/** Numbers of keys of whole numbers, in the order in which they are asked for first. */
class Numbers {
  private readonly slots: Int32Array;
  private keys = new Int32Array(0);
  private count = 0;

  constructor(most: number) {
    this.slots = new Int32Array(2 ** Math.ceil(Math.log2(2 * most + 2))).fill(-1);
  }

  of(key: Int32Array): number {
    const { slots } = this;
    const { length } = key;
    let hash = 0;
    for (let k = 0; k < length; k += 1) {
      hash = Math.imul(hash ^ key[k]!, 0x9e3779b1);
      hash ^= hash >>> 15;
    }
    for (let at = hash & (slots.length - 1); ; at = (at + 1) & (slots.length - 1)) {
      const number = slots[at]!;
      if (number < 0) {
        slots[at] = this.count;
        this.keep(key);
        return this.count++;
      }
      let k = 0;
      while (k < length && this.keys[number * length + k] === key[k]) k += 1;
      if (k === length) return number;
    }
  }

  private keep(key: Int32Array): void {
    const from = this.count * key.length;
    if (from + key.length > this.keys.length) {
      const more = new Int32Array(Math.max(1024, 2 * this.keys.length + key.length));
      more.set(this.keys);
      this.keys = more;
    }
    this.keys.set(key, from);
  }
}

/** Which of the six directions of the axes a normal is nearest to. */
function facing(a: number, b: number, c: number): number {
  const x = Math.abs(a);
  const y = Math.abs(b);
  const z = Math.abs(c);
  if (x >= y && x >= z) return a < 0 ? 1 : 0;
  if (y >= z) return b < 0 ? 3 : 2;
  return c < 0 ? 5 : 4;
}
