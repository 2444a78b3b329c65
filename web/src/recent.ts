// The last minutes of a live run, as they came over the wire, so that one can look back while it runs.

interface Kept {
  t: number;
  message: Uint8Array;
}

/** Encoded snapshots, newest last, bounded in bytes; the oldest go first. */
export class Recent {
  private kept: Kept[] = [];
  private bytes = 0;

  /**
   * @param budget Largest number of bytes kept.
   * @param spacing Smallest run time between two kept snapshots [s].
   */
  constructor(
    private readonly budget: number,
    private readonly spacing: number,
  ) {}

  /** Run time of the oldest kept snapshot [s]; NaN when empty. */
  get oldest(): number {
    return this.kept[0]?.t ?? Number.NaN;
  }

  clear(): void {
    this.kept = [];
    this.bytes = 0;
  }

  /** Keep a message unless it follows too closely; one that `matters` is kept however closely it follows. */
  keep(t: number, message: Uint8Array, matters = false): void {
    const last = this.kept[this.kept.length - 1];
    if (last && t <= last.t) return;
    if (last && !matters && t - last.t < this.spacing) return;
    this.kept.push({ t, message });
    this.bytes += message.byteLength;
    if (this.bytes > this.budget) this.forget();
  }

  /** First kept message at or after `t`; null when there is none. */
  at(t: number): Uint8Array | null {
    let low = 0;
    let high = this.kept.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.kept[middle]!.t < t - 1e-9) low = middle + 1;
      else high = middle;
    }
    return this.kept[low]?.message ?? null;
  }

  // A tenth at a time: shifting one by one would move the whole array at every snapshot.
  private forget(): void {
    let drop = 0;
    while (this.bytes > this.budget * 0.9 && drop < this.kept.length - 1) {
      this.bytes -= this.kept[drop]!.message.byteLength;
      drop += 1;
    }
    this.kept.splice(0, drop);
  }
}
