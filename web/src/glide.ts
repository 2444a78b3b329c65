// Bodies glide from one received frame to the next, so that a display that is faster than the run, or a
// network that stutters, does not show jerks. What is shown is at most one frame behind what was heard,
// lies between two heard poses, and never beyond the newest.

import { FLOATS_PER_NODE } from "./poses";

/** A frame later than this after the one before it is not waited for: it is a new beginning [ms]. */
const LONGEST_MS = 150;
/** A step in run time larger than this, or backwards, is a jump and is shown as one [s]. */
const JUMP_S = 0.5;
/** A body that is faster than this from one frame to the next has leapt, and nothing was in between [m/s]. */
const FASTEST = 20;

export class Glide {
  private from: Float32Array | null = null;
  private to: Float32Array | null = null;
  private shown: Float32Array = new Float32Array();
  private t = Number.NaN;
  private arrived = Number.NEGATIVE_INFINITY;
  private lasts = 0;
  private fromT = Number.NaN;
  /** Of the way to the newest frame, so far. */
  share = 0;
  /** How far a body that has not leapt can have come from one frame to the next [m]. */
  farthest = 0;
  /** Run time of what `at` returned last [s]. */
  shownT = Number.NaN;
  /** Time between two pictures [ms]: where frames come as often as pictures are drawn, gliding would only add delay. */
  drawnEvery = Number.NaN;

  /** Whether the newest frame is not reached yet. */
  get moving(): boolean {
    return this.lasts > 0;
  }

  /** Forget everything: another scene. */
  clear(): void {
    this.from = null;
    this.to = null;
    this.lasts = 0;
    this.shownT = Number.NaN;
  }

  /**
   * Take a received block; it is copied.
   *
   * @param block x, y, z [m], w, x, y, z per body.
   * @param of Who has its run time [s].
   * @param now When it arrived [ms].
   */
  take(block: Float32Array, of: { readonly t: number }, now: number): void {
    const { t } = of;
    const since = now - this.arrived;
    const step = t - this.t;
    this.farthest = FASTEST * step;
    // Looked at each time: what is asked now and then is never compiled, and makes an object of each number.
    const near = this.to?.length === block.length && !leaps(this.to, block, this);
    const glides = near && since < LONGEST_MS && since > 1.5 * this.drawnEvery && step > 0 && step < JUMP_S;
    if (!this.to || this.to.length !== block.length) {
      this.from = block.slice();
      this.to = block.slice();
      this.shown = block.slice();
    } else {
      // From where the eye is, not from where the last frame would have ended.
      this.from!.set(glides ? this.shown : block);
      this.to.set(block);
    }
    this.lasts = glides ? Math.min(since, LONGEST_MS) : 0;
    if (!glides) this.shown.set(block);
    this.fromT = this.shownT;
    this.arrived = now;
    this.t = t;
  }

  /** Where the bodies are on the screen at `now` [ms]; null before anything was heard. */
  at(now: number): Float32Array | null {
    if (!this.from || !this.to) return null;
    this.shownT = this.t;
    if (this.lasts === 0) return this.shown;
    this.share = Math.max((now - this.arrived) / this.lasts, 0);
    if (this.share >= 1) {
      this.lasts = 0;
      this.shown.set(this.to); // exactly what was heard
    } else {
      this.shownT = this.fromT + this.share * (this.t - this.fromT);
      blend(this.from, this.to, this, this.shown);
    }
    return this.shown;
  }
}

function leaps(from: Float32Array, to: Float32Array, of: { readonly farthest: number }): boolean {
  const most = of.farthest;
  for (let k = 0; k < to.length; k += FLOATS_PER_NODE) {
    const x = to[k]! - from[k]!;
    const y = to[k + 1]! - from[k + 1]!;
    const z = to[k + 2]! - from[k + 2]!;
    if (x * x + y * y + z * z > most * most) return true;
  }
  return false;
}

/**
 * Positions along the line, orientations along the shorter arc (normalised chord: frames are close).
 *
 * @param of Who has the share of the way: as a number that is handed over it would be an object each time.
 */
export function blend(
  from: Float32Array,
  to: Float32Array,
  of: { readonly share: number },
  out: Float32Array,
): void {
  const { share } = of;
  for (let k = 0; k < to.length; k += FLOATS_PER_NODE) {
    let cosine = 0;
    for (let i = 0; i < 3; i += 1) out[k + i] = from[k + i]! + share * (to[k + i]! - from[k + i]!);
    for (let i = 3; i < 7; i += 1) cosine += from[k + i]! * to[k + i]!;
    const near = cosine < 0 ? -share : share;
    let square = 0;
    for (let i = 3; i < 7; i += 1) {
      const x = (1 - share) * from[k + i]! + near * to[k + i]!;
      out[k + i] = x;
      square += x * x;
    }
    const size = Math.sqrt(square) || 1;
    for (let i = 3; i < 7; i += 1) out[k + i] = out[k + i]! / size;
  }
}
