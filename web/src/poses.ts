// The newest pose block between two threads without waiting: a triple buffer in shared memory.
//
// Header, int32: [0] published slot, [1] slot being read, [2] generation (counts writes), [3] sequence
// number of the published snapshot. Then one float64 run time per slot, one int32 that says of which form what is
// drawn beside is, and three slots of float32, or of float64 for what is drawn beside.
// The writer takes the slot that is neither published nor being read. The reader announces the slot it
// is about to read and looks again: if another was published meanwhile it moves on, so the writer can
// never be inside the slot that is read.

const PUBLISHED = 0;
const READING = 1;
const GENERATION = 2;
const SEQUENCE = 3;
const TIMES_AT = 32;
const FORMS_AT = 64;
const SLOTS_AT = 128;
const SLOT_COUNT = 3;

/** Floats per node: x, y, z [m], w, x, y, z. */
export const FLOATS_PER_NODE = 7;

/** Bytes that a triple buffer of so many floats takes. */
export function poseBufferBytes(floats: number): number {
  return SLOTS_AT + SLOT_COUNT * floats * 4;
}

type Shared = SharedArrayBuffer | ArrayBuffer;

class Slots<A extends Float32Array | Float64Array> {
  private readonly header: Int32Array;
  protected readonly times: Float64Array;
  protected readonly slots: A[];
  private readonly forms: Int32Array;
  private seen = 0;
  /** Of which form what is read has to be: the page knows it, or what is newer waits for it. */
  form = 0;

  constructor(buffer: Shared, kind: new (buffer: Shared, at: number, length: number) => A, bytes: number) {
    const numbers = (buffer.byteLength - SLOTS_AT) / (SLOT_COUNT * bytes);
    this.header = new Int32Array(buffer, 0, 8);
    this.times = new Float64Array(buffer, TIMES_AT, SLOT_COUNT);
    this.forms = new Int32Array(buffer, FORMS_AT, SLOT_COUNT);
    this.slots = [0, 1, 2].map((k) => new kind(buffer, SLOTS_AT + k * numbers * bytes, numbers));
  }

  /** One that is neither published nor being read. */
  protected free(): number {
    const published = Atomics.load(this.header, PUBLISHED);
    const reading = Atomics.load(this.header, READING);
    let slot = 0;
    while (slot === published || slot === reading) slot += 1;
    return slot;
  }

  protected publish(slot: number, seq: number, form: number): void {
    this.forms[slot] = form;
    Atomics.store(this.header, SEQUENCE, seq | 0);
    Atomics.store(this.header, PUBLISHED, slot);
    Atomics.add(this.header, GENERATION, 1);
  }

  /** The newest, which is not written before the next call; −1 when there is nothing newer. */
  protected newest(): number {
    const generation = Atomics.load(this.header, GENERATION);
    if (generation === this.seen) return -1;
    let slot: number;
    do {
      slot = Atomics.load(this.header, PUBLISHED);
      Atomics.store(this.header, READING, slot);
    } while (Atomics.load(this.header, PUBLISHED) !== slot);
    if (this.forms[slot] !== this.form) return -1;
    this.seen = generation;
    return slot;
  }
}

class PoseSlots extends Slots<Float32Array> {
  constructor(buffer: Shared) {
    super(buffer, Float32Array, 4);
  }
}

/** The worker's end. */
export class PoseWriter extends PoseSlots {
  private readonly bytes = this.slots.map((s) => new Uint8Array(s.buffer, s.byteOffset, s.byteLength));

  /** Publish a block; replaces one that nobody read. A block of the wrong length is refused. */
  write(block: Uint8Array, t: number, seq: number, form = 0): boolean {
    if (block.byteLength !== this.bytes[0]!.byteLength) return false;
    const slot = this.free();
    this.bytes[slot]!.set(block); // msgpack's bytes are not aligned to four: copied as bytes
    this.times[slot] = t;
    this.publish(slot, seq, form);
    return true;
  }
}

/** The page's end. */
export class PoseReader extends PoseSlots {
  /** Run time of the block that `read` returned last [s]. */
  t = Number.NaN;

  /** The newest block, valid until the next call; null when there is nothing newer. */
  read(): Float32Array | null {
    const slot = this.newest();
    if (slot < 0) return null;
    this.t = this.times[slot]!;
    return this.slots[slot]!;
  }
}

/** Bytes that a triple buffer of so many numbers of a form takes. */
export function numberBufferBytes(numbers: number): number {
  return SLOTS_AT + SLOT_COUNT * numbers * 8;
}

/** Numbers of a form from the worker to the page, as poses go. */
export class FormNumbers extends Slots<Float64Array> {
  constructor(buffer: Shared) {
    super(buffer, Float64Array, 8);
  }

  get room(): number {
    return this.slots[0]!.length;
  }

  /** The worker's end: publish numbers, no more than there is room for. */
  write(numbers: Float64Array, form: number): void {
    const slot = this.free();
    this.slots[slot]!.set(numbers);
    this.publish(slot, 0, form);
  }

  /** The page's end: the newest numbers, valid until the next call; null when there is nothing newer. */
  read(): Float64Array | null {
    const slot = this.newest();
    return slot < 0 ? null : this.slots[slot]!;
  }
}
