// Who may be elsewhere than the room shows, and why. Nobody's place is known by the look of it.

import { computed } from "@preact/signals";
import type { Shown } from "./messages";
import { frame } from "./page_state";
import type { Node } from "./wire";

export type Doubts = ReadonlyMap<string, string>;

/** Of a frame, by name: robots, humans and machines, with all that they move, and single nodes. */
export function doubtsIn(shown: Pick<Shown, "doubts"> | null): Doubts {
  return new Map(Object.entries(shown?.doubts ?? {}));
}

/** Those of what the panels show. */
export const doubts = computed<Doubts>(() => doubtsIn(frame.value));

/** Why a node may be elsewhere; undefined when it is where it is shown. */
export function doubtOf(node: Node, known: Doubts): string | undefined {
  return known.get(node.name) ?? (node.mover === "" ? undefined : known.get(node.mover));
}

/** The one reason why some of several nodes may be elsewhere. */
export function doubtAmong(nodes: readonly Node[], known: Doubts): string | undefined {
  if (known.size === 0) return undefined;
  for (const node of nodes) {
    const reason = doubtOf(node, known);
    if (reason !== undefined) return reason;
  }
  return undefined;
}
