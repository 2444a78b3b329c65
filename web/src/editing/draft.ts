// The workstation file as it is edited: what the server says of it, and what this page asks of it, one by one.

import { computed, signal } from "@preact/signals";
import { hello, scene, selection } from "../page_state";
import type { Change, Draft, Edit, Edited, Mistake } from "../wire";

export type Table = Record<string, unknown>;
export type Path = (string | number)[];

/** Lists of things that have a place, in the order in which they are offered, and the key of that place. */
export const PLACED = {
  robots: "base",
  parts: "at",
  areas: "at",
  sensors: "at",
  humans: "at",
  machines: "at",
  tools: "at",
  workpieces: "at",
  waypoints: "at",
} as const;

export type Placed = keyof typeof PLACED;

export const isPlaced = (group: string): group is Placed => group in PLACED;

/** An entry of a list of tables. */
export interface Entry {
  group: string;
  /** Its number in the group: of waypoints, those of all sources are counted through. */
  index: number;
  /** Where it is in the file. */
  path: Path;
  table: Table;
  /** What it is called; made up where the file gives no name. */
  name: string;
}

export const draft = signal<Draft | null>(null);
/** What was refused last, and what was asked for; null once something is accepted. */
export const refused = signal<{ changes: readonly Change[]; mistakes: readonly Mistake[] } | null>(null);
/** Whether the server is being asked, or will be once it has answered. */
export const asking = signal(false);

/** Whether this page may edit the file. */
export const mayEdit = computed(() => hello.value?.may.includes("edit") ?? false);
/** Whether there is no run, only a file that is edited. */
export const notRun = computed(() => hello.value?.mode === "edit");
/** Whether a draft is run: what it comes to is of no file, and nothing of it is kept. */
export const onTrial = computed(() => mayEdit.value && !notRun.value);

export const entries = computed<Entry[]>(() => {
  const found: Entry[] = [];
  for (const [group, list] of Object.entries(draft.value?.tables ?? {})) {
    if (!Array.isArray(list)) continue;
    list.forEach((table: Table, index) => {
      if (typeof table !== "object" || table === null) return;
      const name = typeof table.name === "string" ? table.name : criterionName(group, index);
      found.push({ group, index, path: [group, index], table, name });
    });
  }
  return [...found, ...waypoints()];
});

/** Goals of robots that the file itself lists, those of one source after those of another. */
function waypoints(): Entry[] {
  const sources = draft.value?.tables.sources;
  const found: Entry[] = [];
  for (const [source, { robot, points }] of (Array.isArray(sources) ? sources : []).entries()) {
    if (!Array.isArray(points)) continue;
    for (const [k, table] of (points as Table[]).entries()) {
      const name = `${robot}: ${table.name || k + 1}`;
      found.push({
        group: "waypoints",
        index: found.length,
        path: ["sources", source, "points", k],
        table,
        name,
      });
    }
  }
  return found;
}

/** The entry that is selected, if the file has it. */
export const chosenEntry = computed<Entry | null>(() => {
  const chosen = selection.value;
  if (!chosen) return null;
  if (chosen.kind === "criterion") {
    return entries.value.find((e) => e.name === chosen.name && isCriteria(e.group)) ?? null;
  }
  const node = scene.value?.nodes.find((n) => n.name === chosen.name);
  const name = node?.owner ?? chosen.name;
  return entries.value.find((e) => e.name === name && isPlaced(e.group)) ?? null;
});

export const isCriteria = (group: string): boolean => group === "safety" || group === "ergonomics";

// A criterion without a name has one that the server made; they come in the order of the file.
function criterionName(group: string, index: number): string {
  const same = scene.value?.criteria.filter((c) => c.group === group) ?? [];
  return same[index]?.name ?? `${group} ${index + 1}`;
}

/** A place as the server's messages name it. */
export function named(path: Path): string {
  let text = "";
  for (const part of path) text += typeof part === "number" ? `[${part}]` : text === "" ? part : `.${part}`;
  return text;
}

/** Mistakes of the last refusal that are about a place, or about what is in it. */
export function mistakesAt(path: Path): Mistake[] {
  const start = named(path);
  return (refused.value?.mistakes ?? []).filter(
    ({ key }) => key === start || [".", "[", " "].some((sign) => key.startsWith(start + sign)),
  );
}

// -- asking -------------------------------------------------------------------------------------

let send: (edit: Edit) => void = () => {};
let last = 0;
let queue: Promise<unknown> = Promise.resolve();
const waiting = new Map<number, (answer: Edited) => void>();

export function connectDraft(sender: (edit: Edit) => void): void {
  send = sender;
}

export function heardEdited(answer: Edited): void {
  waiting.get(answer.id)?.(answer);
}

/** The connection is gone: whoever waits is told that nothing is known. */
export function lostDraft(): void {
  const what = "the connection was lost: whether it was done shows when it is back";
  for (const [id, answer] of waiting)
    answer({ type: "edited", id, accepted: false, revision: 0, mistakes: [{ key: "", what, remedy: "" }] });
}

/**
 * Ask for an edit once those before it are answered; whether it was accepted.
 *
 * What is made of what the file has is made only then: those before may have changed that.
 */
export function ask(action: string, changes: Change[] | (() => Change[]) = []): Promise<boolean> {
  return inTurn(async () => {
    const asked = typeof changes === "function" ? changes() : changes;
    return (action === "change" && asked.length === 0) || askNow(action, asked);
  });
}

let inQueue = 0;

function inTurn<Answer>(deed: () => Promise<Answer>): Promise<Answer> {
  inQueue += 1;
  asking.value = true;
  const next = queue.then(deed).finally(() => {
    inQueue -= 1;
    asking.value = inQueue > 0;
  });
  queue = next;
  return next;
}

async function askNow(action: string, changes: Change[]): Promise<boolean> {
  const answer = await answered({ action, changes });
  refused.value = answer.accepted ? null : { changes, mistakes: answer.mistakes };
  return answer.accepted;
}

/** Ask for the changes that a CAD file makes, which the server keeps under a number. */
export function askBrought(brought: number): Promise<Edited> {
  return inTurn(() => answered({ action: "change", changes: [], brought }));
}

async function answered(asked: Pick<Edit, "action" | "changes" | "brought">): Promise<Edited> {
  last += 1;
  const id = last;
  const answer = await new Promise<Edited>((resolve) => {
    waiting.set(id, resolve);
    send({ type: "edit", id, revision: draft.value?.revision ?? 0, ...asked });
  });
  waiting.delete(id);
  return answer;
}

export const change = (...changes: Change[]): Promise<boolean> => ask("change", changes);

/** The place behind the last table of a list. */
export const BEHIND = -1;

/** What makes a value of the file another one, `undefined` none; nothing where it is that already. */
export function changeTo(path: Path, value: unknown): Change[] {
  if (path.at(-1) === BEHIND) return [{ kind: "add", path: path.slice(0, -1), value }];
  let now: unknown = draft.value?.tables;
  for (const key of path) now = (now as Record<string | number, unknown> | undefined)?.[key];
  if (JSON.stringify(now) === JSON.stringify(value)) return [];
  return [value === undefined ? { kind: "remove", path, value: null } : set(path, value)];
}

export const set = (path: Path, value: unknown): Change => ({ kind: "set", path, value });

/** The same word with a number behind it that nothing has yet. */
export function freeName(word: string): string {
  const taken = new Set(entries.value.map((entry) => entry.name));
  const base = word.replace(/_\d+$/, "");
  let n = 2;
  if (!taken.has(word)) return word;
  while (taken.has(`${base}_${n}`)) n += 1;
  return `${base}_${n}`;
}

/** Every name that a criterion may speak of. */
export const names = computed<string[]>(() => {
  const found = entries.value.filter((e) => isPlaced(e.group) && e.group !== "waypoints").map((e) => e.name);
  return [...new Set([...found, ...(scene.value?.nodes.map((node) => node.name) ?? [])])];
});
