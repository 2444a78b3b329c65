// How far two things are from one another: what is picked, and what the engine says of it.

import { effect, signal } from "@preact/signals";
import { scene, selection } from "../page_state";
import type { Measure, Measured, Result } from "../wire";

/** A direction in the world. */
type Normal = readonly [number, number, number];

export interface Measuring {
  picks: { name: string; normal: Normal | null }[];
  result: Result | null;
  refusal: string;
}

/** What is measured; null while nothing is. */
export const measuring = signal<Measuring | null>(null);

let send: (asked: Measure) => void = () => {};
let last = 0;
/** Outward normal of the face that was clicked last, while it is told to whoever selects. */
let clicked: Normal | null = null;

export function connectMeasure(sender: (asked: Measure) => void): void {
  send = sender;
}

/** Begin to measure, or end it. */
export function toggleMeasure(): void {
  measuring.value = measuring.peek() ? null : { picks: [], result: null, refusal: "" };
  selection.value = null;
}

/** Select what was clicked, with the face that was hit. */
export function withFace(normal: Normal | null, tell: () => void): void {
  clicked = normal;
  tell();
  clicked = null;
}

export function heardMeasured(answer: Measured): void {
  const now = measuring.peek();
  if (answer.id !== last || now?.picks.length !== 2) return;
  measuring.value = { ...now, result: answer.result, refusal: answer.refusal };
}

/** Angle between the two faces that were clicked, 0 where they are parallel [°]; null where one was not clicked. */
export function faceAngle({ picks }: Measuring): number | null {
  const [a, b] = picks.map((pick) => pick.normal);
  if (!a || !b) return null;
  const cosine = Math.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
  return (Math.acos(Math.min(1, cosine)) * 180) / Math.PI;
}

function askEngine(now: Measuring): void {
  const [a, b] = now.picks;
  if (!a || !b) return;
  last += 1;
  send({ type: "measure", id: last, between: [a.name, b.name] });
}

effect(() => {
  const chosen = selection.value;
  const now = measuring.peek();
  if (!now || !chosen || chosen.kind === "criterion") return;
  // A third one begins anew.
  const before = now.picks.length === 2 ? [] : now.picks;
  const next = { picks: [...before, { name: chosen.name, normal: clicked }], result: null, refusal: "" };
  measuring.value = next;
  askEngine(next);
});

effect(() => {
  // Where things are may be another than before.
  void scene.value;
  const now = measuring.peek();
  if (!now) return;
  measuring.value = { ...now, result: null };
  askEngine(now);
});
