// What a visitor does in the room: hands that take workpieces, controls that are pulled, in a headset or by mouse.

import { computed, signal } from "@preact/signals";
import { hello, isLive, mayTrack, scene } from "./page_state";
import type { ControlInfo, Grab, Node, Pull, Refused } from "./wire";

/** A control that is held is said to be so this often [ms]; the server lets go after half a second. */
const AGAIN_MS = 150;

let send: (doing: Grab | Pull) => void = () => {};
/** Where this page last put each control; where the file starts it before. */
export const pulled = signal<ReadonlyMap<string, number>>(new Map());
/** Why something was not taken. */
export const refused = signal<Refused | null>(null);
const held = new Map<string, ReturnType<typeof setInterval>>();

/** From now on, who is told. */
export function connectDoing(to: (doing: Grab | Pull) => void): void {
  send = to;
}

/** Whether this page may pull controls now. */
export const mayPull = computed(
  () => isLive.value && (mayTrack.value || (hello.value?.may.includes("control") ?? false)),
);

export const controls = computed<readonly ControlInfo[]>(() => scene.value?.controls ?? []);

export function standsAt(control: ControlInfo): number {
  return pulled.value.get(control.name) ?? control.start;
}

/** Whether a node is a workpiece that hands take. */
export function isLoose(node: Node): boolean {
  return node.role === "workpiece" && node.mover !== "" && node.mover === node.owner;
}

/** The control that a node belongs to; undefined for none. */
export function controlOf(node: Node): ControlInfo | undefined {
  return controls.peek().find(({ of }) => of === node.owner || of === node.name);
}

/** What a hand holds from now on; empty for nothing. */
export function grab(hand: string, piece: string): void {
  refused.value = null;
  send({ type: "grab", hand, piece });
}

/** Pull a control to a value. */
export function pull(control: ControlInfo, value: number): void {
  refused.value = null;
  const to = Math.min(Math.max(value, control.lower), control.upper);
  pulled.value = new Map(pulled.peek()).set(control.name, to);
  send({ type: "pull", control: control.name, value: to });
}

/** Press a control that is held, or turn a switch over. */
export function press(control: ControlInfo): void {
  if (control.kind === "switch") {
    pull(control, standsAt(control) ? 0 : 1);
    return;
  }
  pull(control, 1);
  clearInterval(held.get(control.name));
  held.set(
    control.name,
    setInterval(() => send({ type: "pull", control: control.name, value: 1 }), AGAIN_MS),
  );
}

/** Let go of a control that is held. */
export function release(control: ControlInfo): void {
  if (!held.has(control.name)) return;
  clearInterval(held.get(control.name));
  held.delete(control.name);
  pull(control, 0);
}
