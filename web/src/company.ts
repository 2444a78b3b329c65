// Who else is there, and what this page says of itself: signals for panels and room, and what is sent.

import { computed, effect, signal } from "@preact/signals";
import { hello, link } from "./page_state";
import type { Hold, Introduction, Presences, VisitorInfo } from "./wire";

/** How large a visitor may choose to be: metres of the world in one of theirs. */
export const SCALES = [0.1, 1, 10] as const;
/** An introduction follows another after so long at least [ms]; the server takes five a second. */
const INTRODUCED_EVERY_MS = 250;
/** What is held is said again [ms]; the server lets go after twice that. */
const HELD_EVERY_MS = 1000;
const NAME_KEY = "seerob.name";

export type Place = Pick<Introduction, "position" | "turn">;

export const visitors = signal<readonly VisitorInfo[]>([]);
export const others = computed(() => visitors.value.filter(({ id }) => id !== hello.value?.visitor));
/** What others read; empty for what the server makes up. */
export const ownName = signal(readName());
export const ownScale = signal<number>(1);
export const ownDevice = signal<"desk" | "vr" | "ar">("desk");
/** The person of the twin whom this visitor is. */
export const ownHuman = signal("");
export const ownPlace = signal<Place>({ position: [0, 0, 0], turn: [1, 0, 0, 0] });
/** Whether the others are asked to follow. */
export const calling = signal(false);
/** Number of the visitor with whose eyes this page looks. */
export const following = signal<number | null>(null);
/** Entries of the workstation file that are in this visitor's hands. */
export const holding = signal<readonly string[]>([]);
/** Who has an entry in their hands, of the others. */
export const holders = computed(() => {
  const found = new Map<string, string>();
  for (const { name, holds } of others.value) for (const entry of holds) found.set(entry, name);
  return found;
});

let shown: (presences: Presences) => void = () => {};

/** Have every word of where visitors are given to `show`. */
export function showPresences(show: (presences: Presences) => void): void {
  shown = show;
}

export const heardPresences = (presences: Presences): void => shown(presences);

export function heardVisitors(list: readonly VisitorInfo[]): void {
  visitors.value = list;
  if (following.peek() !== null && !list.some(({ id }) => id === following.peek())) following.value = null;
}

export function connectCompany(send: (message: Introduction | Hold) => void): void {
  let due: ReturnType<typeof setTimeout> | undefined;
  let told = Number.NEGATIVE_INFINITY;
  effect(() => {
    if (link.value.state !== "open" || !hello.value) return;
    const said: Introduction = {
      type: "introduction",
      name: ownName.value.slice(0, 40),
      device: ownDevice.value,
      human: ownHuman.value,
      scale: ownScale.value,
      calls: calling.value,
      ...ownPlace.value,
    };
    clearTimeout(due);
    due = setTimeout(
      () => {
        told = performance.now();
        send(said);
      },
      Math.max(0, told + INTRODUCED_EVERY_MS - performance.now()),
    );
  });
  let again: ReturnType<typeof setInterval> | undefined;
  let before = 0;
  effect(() => {
    const names = [...holding.value];
    clearInterval(again);
    if (names.length > 0 || before > 0) send({ type: "hold", names });
    before = names.length;
    if (names.length > 0) again = setInterval(() => send({ type: "hold", names }), HELD_EVERY_MS);
  });
  effect(() => {
    try {
      localStorage.setItem(NAME_KEY, ownName.value);
    } catch {
      // Private windows may refuse: then it holds until the page is closed.
    }
  });
}

function readName(): string {
  try {
    return localStorage.getItem(NAME_KEY) ?? "";
  } catch {
    return "";
  }
}
