// How far two things are from one another: what is picked, and what the engine says of it where it is shown.

import { computed, effect, signal } from "@preact/signals";
import { frame, hello, scene, selection } from "../page_state";
import type { Measure, Measured, Result } from "../wire";

/** A direction. */
export type Normal = readonly [number, number, number];

export interface Measuring {
  /** Of a face that was clicked, its outward normal in the body's frame. */
  picks: { name: string; face: Normal | null }[];
  result: Result | null;
  refusal: string;
  /** Between the two faces as drawn then, 0 where they are parallel [°]; null where one was not clicked. */
  angle: number | null;
}

/** Shortest time between two questions of what moves [ms]. */
const EVERY_MS = 150;

/** What is measured; null while nothing is. */
export const measuring = signal<Measuring | null>(null);
/** Whether this page may measure. */
export const mayMeasure = computed(() => hello.value?.may.includes("measure") ?? false);

let send: (asked: Measure) => void = () => {};
let turned: (name: string, face: Normal) => Normal | null = () => null;
let last = 0;
let answered = true;
let askedAt = Number.NEGATIVE_INFINITY;
let askedOf: number | null = null;
let timer = 0;
/** Of the face that was clicked last, while it is told to whoever selects. */
let clicked: Normal | null = null;

/** @param toWorld A direction of a body's frame in the world, as the body is drawn. */
export function connectMeasure(
  sender: (asked: Measure) => void,
  toWorld: (name: string, face: Normal) => Normal | null,
): void {
  send = sender;
  turned = toWorld;
}

/** Begin to measure, or end it. */
export function toggleMeasure(): void {
  measuring.value = measuring.peek() ? null : nothing([]);
  selection.value = null;
}

/** Select what was clicked, with the face that was hit. */
export function withFace(face: Normal | null, tell: () => void): void {
  clicked = face;
  tell();
  clicked = null;
}

export function heardMeasured(answer: Measured): void {
  if (answer.id !== last) return;
  answered = true;
  const now = measuring.peek();
  if (now?.picks.length !== 2) return;
  measuring.value = { ...now, result: answer.result, refusal: answer.refusal, angle: faceAngle(now) };
  follow();
}

const nothing = (picks: Measuring["picks"]): Measuring => ({ picks, result: null, refusal: "", angle: null });

function faceAngle({ picks }: Measuring): number | null {
  const [a, b] = picks.map(({ name, face }) => face && turned(name, face));
  if (!a || !b) return null;
  const cosine = Math.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
  return (Math.acos(Math.min(1, cosine)) * 180) / Math.PI;
}

function askEngine({ picks: [a, b] }: Measuring): void {
  if (!a || !b) return;
  last += 1;
  answered = false;
  askedAt = performance.now();
  askedOf = frame.peek()?.t ?? null;
  send({ type: "measure", id: last, between: [a.name, b.name], t: askedOf });
}

/** Ask again of the instant that is shown now, when it is another one and no question is open. */
function follow(): void {
  const now = measuring.peek();
  if (now?.picks.length !== 2 || !answered || (frame.peek()?.t ?? null) === askedOf) return;
  clearTimeout(timer);
  const wait = askedAt + EVERY_MS - performance.now();
  if (wait > 0) timer = window.setTimeout(follow, wait);
  else askEngine(now);
}

effect(() => {
  const chosen = selection.value;
  const now = measuring.peek();
  if (!now || !chosen || chosen.kind === "criterion") return;
  // A third one begins anew.
  const before = now.picks.length === 2 ? [] : now.picks;
  const next = nothing([...before, { name: chosen.name, face: clicked }]);
  measuring.value = next;
  askEngine(next);
});

effect(() => {
  // Where things are may be another than before.
  void scene.value;
  const now = measuring.peek();
  if (!now) return;
  measuring.value = nothing(now.picks);
  askEngine(now);
});

effect(() => {
  void frame.value;
  follow();
});
