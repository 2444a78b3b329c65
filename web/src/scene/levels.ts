// Coarser shapes of one shape, for all crowds that have it: each is made of the one before when it is first needed,
// a little at each picture, as the page's thread has other things to do.

import type { BufferGeometry } from "three";
import { type Coarser, coarsening } from "./coarser";
import { drawnBySoftware } from "./effort";

/** Cells of coarser shapes, as shares of the radius of the whole. */
const CELLS = [0.06, 0.1, 0.16, 0.25, 0.5];
/** A coarser shape that has not so much fewer corners is none. */
const WORTH = 0.7;

const known = new WeakMap<BufferGeometry, Levels>();

export class Levels {
  /** From the true shape to the coarsest one that there is. */
  readonly made: Coarser[];
  /** How far off something must not look so that a shape would do that there is not yet [m]. */
  next = Number.POSITIVE_INFINITY;
  private readonly cells: number[];
  private making: Generator<undefined, Coarser> | null = null;

  private constructor(private readonly shape: BufferGeometry) {
    this.made = [{ shape, off: 0 }];
    if (!shape.boundingSphere) shape.computeBoundingSphere();
    const plain = Object.keys(shape.attributes).every((name) => name === "position" || name === "normal");
    const coarse = drawnBySoftware() && plain && shape.hasAttribute("normal");
    this.cells = coarse ? CELLS.map((share) => share * shape.boundingSphere!.radius) : [];
    this.look();
  }

  static of(shape: BufferGeometry): Levels {
    const there = known.get(shape) ?? new Levels(shape);
    known.set(shape, there);
    return there;
  }

  /** Forget the coarser shapes of one that is not drawn any more. */
  static drop(shape: BufferGeometry): void {
    const there = known.get(shape);
    known.delete(shape);
    for (const { shape: one } of there?.made.slice(1) ?? []) one.dispose();
  }

  /** Make the next one, as far as it comes until a time [ms]. */
  work(until: number): void {
    const [cell] = this.cells;
    if (cell === undefined) return;
    const last = this.made.at(-1)!;
    this.making ??= coarsening(this.shape, last, cell);
    while (performance.now() < until) {
      const step = this.making.next();
      if (!step.done) continue;
      this.making = null;
      this.cells.shift();
      if (cost(step.value.shape) <= WORTH * cost(last.shape)) this.made.push(step.value);
      this.look();
      return;
    }
  }

  // Kept: it is asked for with every picture.
  private look(): void {
    const [cell] = this.cells;
    this.next = cell === undefined ? Number.POSITIVE_INFINITY : this.made.at(-1)!.off + cell / 2;
  }
}

/** Corners that are looked up and those that are worked out. */
const cost = (shape: BufferGeometry): number =>
  triangles(shape) + (shape.index ? shape.getAttribute("position").count : 3 * triangles(shape));

export const triangles = (shape: BufferGeometry): number =>
  (shape.index?.count ?? shape.getAttribute("position").count) / 3;
