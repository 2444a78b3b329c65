// All markers of a frame: what is drawn is kept and changed in place, so that 30 frames a second cost
// no garbage to speak of.

import { Group } from "three";
import { UNSEEN } from "../form";
import type { Shown, ShownResult, ToldMarker, WrittenResult } from "../messages";
import { STATE_ORDER, stateOf } from "../verdicts";
import type { Marker, Verdict } from "../wire";
import { Caption } from "./caption";
import type { Drawn } from "./drawn";
import { makeDrawn } from "./index";
import { Leaders } from "./leaders";
import { placeCaptions } from "./placing";
import type { View } from "./view";

interface Slot {
  type: Marker["type"];
  drawn: Drawn<Marker>;
  caption: Caption | null;
}

/** Labels of one result, unless it is selected. */
const LABELS_OF_ONE = 2;
const NONE: readonly never[] = [];

/** What is to be written. */
export interface Written {
  /** Results as the panels show them: bodies and lines may be of a later instant, a text never is. */
  told: readonly WrittenResult[];
  /** Criterion whose labels are written beside those of the worst. */
  selected: string | null;
  /** Of how many results: more would hide what they are about. */
  most: number;
}

export class MarkerLayer {
  readonly root = new Group();
  /** Whose markers are drawn. */
  drawn: readonly ShownResult[] = [];
  /** Bodies that highlights paint. */
  readonly painted = new Map<string, Verdict | null>();
  private readonly slots = new Map<string, Slot[]>();
  private readonly leaders = new Leaders();

  constructor() {
    this.root.add(this.leaders.object);
  }

  /**
   * Draw the markers of these results.
   *
   * @param muted Criteria whose markers are not drawn.
   */
  update(results: readonly ShownResult[], muted: ReadonlySet<string>, written: Written): void {
    this.drawn = results;
    if (this.news(results, muted, written)) this.renew(results, muted, written);
    else this.move(results, muted);
  }

  /** Draw and write what is something else than before, which it is a few times a second. */
  private renew(results: readonly ShownResult[], muted: ReadonlySet<string>, written: Written): void {
    const { told, selected, most } = written;
    this.painted.clear();
    const captioned = worst(told, muted, most);
    if (most > 0 && selected) captioned.add(selected);
    for (const name of this.slots.keys()) {
      if (!results.some((r) => r.name === name)) this.drop(name, 0);
    }
    for (let k = 0; k < results.length; k += 1) {
      const { name, markers } = results[k]!;
      const labels = !captioned.has(name) ? 0 : name === selected ? Number.POSITIVE_INFINITY : LABELS_OF_ONE;
      const texts = told.find((one) => one.name === name)?.markers ?? NONE;
      this.draw(name, muted.has(name) ? NONE : markers, texts, labels);
    }
  }

  /** Write everything anew at the next update: what is written otherwise now, such as units. */
  rewrite(): void {
    this.toldBefore.length = this.drawnBefore.length = 0;
    this.mostBefore = -1;
  }

  private readonly drawnBefore: ShownResult[] = [];
  private readonly toldBefore: WrittenResult[] = [];
  private mutedBefore: ReadonlySet<string> | null = null;
  private selectedBefore: string | null = null;
  private mostBefore = -1;

  /** Whether it is not the same results with other numbers. */
  private news(
    results: readonly ShownResult[],
    muted: ReadonlySet<string>,
    { told, selected, most }: Written,
  ): boolean {
    const others = keep(results, this.drawnBefore);
    const texts = keep(told, this.toldBefore);
    const news =
      others ||
      texts ||
      muted !== this.mutedBefore ||
      selected !== this.selectedBefore ||
      most !== this.mostBefore;
    this.mutedBefore = muted;
    this.selectedBefore = selected;
    this.mostBefore = most;
    return news;
  }

  // Nothing is made for it: that is what happens in each picture.
  private move(results: readonly ShownResult[], muted: ReadonlySet<string>): void {
    for (let k = 0; k < results.length; k += 1) {
      const { name, markers } = results[k]!;
      const slots = this.slots.get(name);
      if (!slots || muted.has(name)) continue;
      let used = 0;
      for (let i = 0; i < markers.length && used < slots.length; i += 1) {
        const { type, drawn, caption } = slots[used]!;
        if (type !== markers[i]!.type) continue;
        drawn.update(markers[i]!);
        if (caption) caption.object.position.copy(drawn.anchor);
        used += 1;
      }
    }
  }

  /**
   * Called before each picture: what has a size in pixels keeps it.
   *
   * @param others Further captions in the room, which lie below where they would cover these.
   */
  face(view: View, others: readonly Caption[]): void {
    const { written } = this;
    this.count = 0;
    for (let k = 0; k < others.length; k += 1) if (others[k]!.object.visible) this.note(others[k]!);
    this.view = view;
    this.slots.forEach(this.faceAll);
    written.length = this.count;
    for (let k = 0; k < written.length; k += 1) written[k]!.face(view);
    placeCaptions(written, view);
    this.leaders.update(written, view);
  }

  /** What is written in the room. */
  get texts(): string[] {
    return this.written.map(({ text }) => text);
  }

  /** Captions of a picture; made once, as a picture allocates nothing of ours. */
  private readonly written: Caption[] = [];
  private count = 0;
  private view: View | null = null;
  private readonly faceAll = (slots: Slot[]): void => {
    for (let k = 0; k < slots.length; k += 1) {
      const { drawn, caption } = slots[k]!;
      drawn.face?.(this.view!);
      if (caption?.object.visible) this.note(caption);
      if (drawn.caption) this.note(drawn.caption);
    }
  };

  private note(caption: Caption): void {
    this.written[this.count] = caption;
    this.count += 1;
  }

  private draw(name: string, markers: readonly Marker[], texts: readonly ToldMarker[], labels: number): void {
    const slots = this.slots.get(name) ?? [];
    this.slots.set(name, slots);
    let used = 0;
    let left = labels;
    // Figures without the name of what they are of would be riddles.
    let owner = `${name}: `;
    for (let k = 0; k < markers.length; k += 1) {
      const marker = markers[k]!;
      const slot = this.slotFor(slots, used, marker);
      if (!slot) continue;
      slot.drawn.update(marker);
      const text = texts[k]?.type === marker.type ? texts[k]! : null;
      if (text?.text !== undefined) slot.drawn.caption?.say(text.text, text.verdict);
      const label = left > 0 ? (text?.label ?? "") : "";
      const verdict = text?.verdict ?? null;
      this.write(slot, label === "" || label.startsWith(name) ? label : owner + label, verdict);
      if (label !== "") {
        owner = "";
        left -= 1;
      }
      if (marker.type === "highlight") paintWorst(this.painted, marker.body, marker.verdict);
      used += 1;
    }
    this.drop(name, used);
  }

  private slotFor(slots: Slot[], index: number, marker: Marker): Slot | null {
    const there = slots[index];
    if (there?.type === marker.type) return there;
    const drawn = makeDrawn(marker);
    if (!drawn) return null;
    if (there) this.free(there);
    const slot: Slot = { type: marker.type, drawn, caption: null };
    slots[index] = slot;
    this.root.add(drawn.object);
    return slot;
  }

  private write(slot: Slot, text: string, verdict: Verdict | null): void {
    if (text === "") {
      if (slot.caption) slot.caption.object.visible = false;
      return;
    }
    if (!slot.caption) {
      slot.caption = new Caption();
      this.root.add(slot.caption.object);
    }
    slot.caption.object.visible = true;
    slot.caption.object.position.copy(slot.drawn.anchor);
    slot.caption.say(text, verdict);
  }

  private drop(name: string, from: number): void {
    const slots = this.slots.get(name);
    if (!slots || slots.length <= from) return;
    for (const slot of slots.splice(from)) this.free(slot);
  }

  private free(slot: Slot): void {
    slot.drawn.object.removeFromParent();
    slot.drawn.dispose();
    slot.caption?.object.removeFromParent();
    slot.caption?.dispose();
  }
}

/** Keep what is in a list; whether that is something else than before. */
function keep<T>(list: readonly T[], before: T[]): boolean {
  let other = list.length !== before.length;
  before.length = list.length;
  for (let k = 0; k < list.length; k += 1) {
    if (before[k] !== list[k]) other = true;
    before[k] = list[k]!;
  }
  return other;
}

function worst(results: readonly WrittenResult[], muted: ReadonlySet<string>, count: number): Set<string> {
  const rank = (r: WrittenResult): number => STATE_ORDER.indexOf(stateOf(r));
  const shown = results.filter((r) => !muted.has(r.name) && r.markers.length > 0);
  return new Set(
    shown
      .sort((a, b) => rank(a) - rank(b))
      .slice(0, count)
      .map((r) => r.name),
  );
}

const RANK: (Verdict | null)[] = [null, "within", "undecided", "exceeded"];

function paintWorst(painted: Map<string, Verdict | null>, body: string, verdict: Verdict | null): void {
  const before = painted.get(body);
  if (before === undefined || RANK.indexOf(verdict) > RANK.indexOf(before)) painted.set(body, verdict);
}

type Seen = Pick<Shown, "looks" | "doubts"> & { results: readonly WrittenResult[] };

/** Whether two frames look the same in the room, wherever their bodies are: a still room costs no picture. */
export function alike<T extends Seen>(a: T | null, b: T | null): boolean {
  if (a === b) return true;
  if (!a || !b || !sameLooks(a.looks, b.looks) || !sameLooks(a.doubts, b.doubts)) return false;
  if (a.results.length !== b.results.length) return false;
  for (let k = 0; k < a.results.length; k += 1) {
    const [one, other] = [a.results[k]!, b.results[k]!];
    if (one.name !== other.name || stateOf(one) !== stateOf(other)) return false;
    if (!sameLooks(one.markers, other.markers)) return false;
  }
  return true;
}

function sameLooks(a: unknown, b: unknown): boolean {
  if (a === b) return true;
  if (typeof a === "number" && typeof b === "number") return Math.abs(a - b) <= UNSEEN;
  if (typeof a !== "object" || typeof b !== "object" || a === null || b === null) return false;
  const keys = Object.keys(a);
  if (keys.length !== Object.keys(b).length) return false;
  for (const key of keys) if (!sameLooks(a[key as never], b[key as never])) return false;
  return true;
}
