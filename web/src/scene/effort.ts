// How much may be drawn: without a graphics card every pixel is paid for by the processor that also
// runs the page, so shadows, smooth edges and light per pixel are left out there, and pixels get larger while
// pictures come slowly. What is said stays the same.

const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|microsoft basic render/i;

let software: boolean | null = null;

/** Whether pictures are drawn by the processor; `?draw=full` and `?draw=light` overrule it. */
export function drawnBySoftware(): boolean {
  software ??= isSoftware();
  return software;
}

function isSoftware(): boolean {
  const asked = new URLSearchParams(location.search).get("draw");
  if (asked === "full" || asked === "light") return asked === "light";
  const probe = document.createElement("canvas").getContext("webgl2");
  if (!probe) return false;
  const told = probe.getExtension("WEBGL_debug_renderer_info");
  const name = String(probe.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : probe.RENDERER));
  probe.getExtension("WEBGL_lose_context")?.loseContext();
  return SOFTWARE.test(name);
}

/**
 * Plots and lanes are drawn anew at most this often [ms]: their canvases cost as much as the room there.
 *
 * @param elsewhere Whether one is in the room, where nobody sees the page.
 */
export function redrawEveryMs(elsewhere: boolean): number {
  if (elsewhere) return 1000;
  return drawnBySoftware() ? 400 : 60;
}

/** Numbers change at most this often [ms]: faster cannot be read, and a table of them costs as much as the room. */
export function numbersEveryMs(): number {
  return drawnBySoftware() ? 250 : 110;
}

/** Where a canvas of letters is painted: by the processor it is done at once, without a detour over the renderer. */
export function paintedBy(): CanvasRenderingContext2DSettings {
  return { willReadFrequently: drawnBySoftware() };
}

/** Pictures that are looked at before pixels are made larger or smaller. */
const LOOKED_AT = 8;
/** Larger or smaller by this factor at once. */
const STEP = 0.8;
/** Larger pixels that do not bring at least so much of the time back are no help: something else is slow. */
const HELPS = 0.93;
/** Time for which what did not help is not tried again [ms]. */
const GIVEN_UP_MS = 10_000;

/** Pixels of the picture per pixel of the screen, as many as leave time for `rate` pictures a second. */
export class Sharpness {
  /** Now. */
  ratio: number;
  private readonly times = new Float64Array(LOOKED_AT);
  private count = 0;
  /** How long a picture took before pixels were made larger [ms]; null when they were not just now. */
  private before: number | null = null;
  private idleUntil = 0;

  /**
   * @param most Ratio when there is time enough.
   * @param least Ratio below which a picture cannot be read.
   * @param rate Pictures per second that are aimed at.
   */
  constructor(
    private readonly most: number,
    private readonly least: number,
    private readonly rate: number,
  ) {
    this.ratio = most;
  }

  /** A picture came `took` after the one before it, at `time` [ms]: whether the ratio is another one now. */
  take(took: number, time: number): boolean {
    this.times[this.count] = took;
    this.count += 1;
    if (this.count < LOOKED_AT) return false;
    this.count = 0;
    const typical = this.times.sort()[LOOKED_AT >> 1]!;
    const before = this.before;
    this.before = null;
    if (before !== null && typical > HELPS * before) {
      this.idleUntil = time + GIVEN_UP_MS;
      return this.become(this.ratio / STEP);
    }
    if (typical > 1000 / this.rate && time >= this.idleUntil && this.ratio > this.least) {
      this.before = typical;
      return this.become(this.ratio * STEP);
    }
    // Smaller pixels take longer: only where that leaves time enough.
    if (typical < (1000 / this.rate) * STEP ** 3) return this.become(this.ratio / STEP);
    return false;
  }

  private become(ratio: number): boolean {
    const next = Math.min(Math.max(ratio, this.least), this.most);
    const changed = Math.abs(next - this.ratio) > 1e-9;
    this.ratio = next;
    return changed;
  }
}
