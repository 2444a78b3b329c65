// Where who is selected can reach: the outline that the engine found, where it is shown.

import { effect, signal } from "@preact/signals";
import { frame, scene, selection } from "../page_state";
import type { Measured, Reach, Result } from "../wire";

export interface Reaching {
  /** Robot, person or body; empty until one was selected. */
  of: string;
  result: Result | null;
  refusal: string;
}

/** Whose reach is shown; null while none is. */
export const reaching = signal<Reaching | null>(null);

/** Shortest time between two questions of what moves [ms]. */
const EVERY_MS = 400;
/** Numbers of questions, which those of measurements never are. */
let last = 0;
let answered = true;
let askedAt = Number.NEGATIVE_INFINITY;
let askedOf: number | null = null;
let timer = 0;
let send: (asked: Reach) => void = () => {};

export function connectReach(sender: (asked: Reach) => void): void {
  send = sender;
}

export function toggleReach(): void {
  reaching.value = reaching.peek() ? null : { of: "", result: null, refusal: "" };
  take();
}

/** Whether it was an answer to a question of reach. */
export function heardReach(answer: Measured): boolean {
  if (answer.id >= 0) return false;
  const now = reaching.peek();
  if (answer.id !== last || !now) return true;
  answered = true;
  reaching.value = { ...now, result: answer.result, refusal: answer.refusal };
  follow();
  return true;
}

/** A body of a robot stands for the robot; one of a person for itself. */
function subject(): string {
  const chosen = selection.peek();
  if (!chosen || chosen.kind === "criterion") return "";
  if (chosen.kind === "owner") return chosen.name;
  const node = scene.peek()?.nodes.find(({ name }) => name === chosen.name);
  return node?.role === "robot" ? node.owner : chosen.name;
}

function take(): void {
  const now = reaching.peek();
  const of = subject();
  if (!now || of === "" || of === now.of) return;
  reaching.value = { of, result: null, refusal: "" };
  ask(of);
}

function ask(of: string): void {
  last -= 1;
  answered = false;
  askedAt = performance.now();
  askedOf = frame.peek()?.t ?? null;
  send({ type: "reach", id: last, of, t: askedOf });
}

function follow(): void {
  const now = reaching.peek();
  if (!now || now.of === "" || !answered || (frame.peek()?.t ?? null) === askedOf) return;
  clearTimeout(timer);
  const wait = askedAt + EVERY_MS - performance.now();
  if (wait > 0) timer = window.setTimeout(follow, wait);
  else ask(now.of);
}

effect(() => {
  void selection.value;
  take();
});

effect(() => {
  // Another workstation, or another draft of this one.
  void scene.value;
  const now = reaching.peek();
  if (!now || now.of === "") return;
  reaching.value = { ...now, result: null, refusal: "" };
  ask(now.of);
});

effect(() => {
  void frame.value;
  follow();
});
