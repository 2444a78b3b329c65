// CAD files that are brought to the workstation: read by the server, added to the draft, axes accepted.

import { signal } from "@preact/signals";
import type { Finding, Mistake, Result, Segment } from "../wire";
import { said } from "../words";
import { askBrought, mayEdit } from "./draft";

/** An axis that shapes of a file speak for. */
export interface Axis {
  kind: "revolute" | "prismatic";
  /** Full names: which part carries it, and which moves. */
  between: [string, string];
  /** A point of it in the world, z up [m]. */
  point: [number, number, number];
  axis: [number, number, number];
  reason: string;
}

interface Found {
  brought: number;
  parts: number;
  robots: number;
  /** What becomes of the draft: a word, and what it is about. */
  told: [word: string, about: string][];
  findings: Pick<Finding, "level" | "subject" | "text">[];
  left_out: { name: string; why: string }[];
  axes: Axis[];
  accepted: string[];
  /** As `seerob import` has them, by name. */
  options: Record<string, string | number | string[] | null>;
}

export interface Bringing {
  /** Of the file, as the server is told. */
  name: string;
  /** How far it is; empty when it is over. */
  saying: string;
  mistakes: Mistake[];
  found: Found | null;
  /** Whether the draft has what was found. */
  added: boolean;
}

/** The file that was brought last; null where none was. */
export const bringing = signal<Bringing | null>(null);
/** Numbers of proposals that are marked, from 1. */
export const marked = signal<ReadonlySet<number>>(new Set());
/** The proposal that is pointed at, to be shown in the room. */
export const pointedAt = signal<Axis | null>(null);

/** What the user says of a file, as options of `seerob import`; what is left out is as it was before. */
export type Told = Record<string, string>;

/** Letters that a name has on its way: `line A.step` is `line_A.step`. */
export const plain = (name: string): string => {
  const dot = name.lastIndexOf(".");
  const [stem, ending] = dot > 0 ? [name.slice(0, dot), name.slice(dot)] : [name, ""];
  const letters = stem
    .normalize("NFKD")
    .replace(/[^A-Za-z0-9_-]+/g, "_")
    .replace(/^_+|_+$/g, "");
  return `${letters.slice(0, 60) || "part"}${ending.toLowerCase()}`;
};

/** How much of a file is looked through for names of others [byte]. */
const LOOKED_AT = 64 * 2 ** 20;

/**
 * Bring a file, or several of which one names the others; what is found is in the draft when this is over, unless
 * something is wrong.
 */
export async function bring(files: readonly File[]): Promise<void> {
  marked.value = new Set();
  if (files.length === 0) return;
  const mains = files.length === 1 ? [...files] : await unnamed(files);
  const [main] = mains;
  if (mains.length !== 1 || main === undefined) {
    const names = mains.map(({ name }) => name).join(", ");
    const mistakes = [
      {
        key: names,
        what: said("none of these names the others"),
        remedy: said("bring them one after another, each with the files that it names"),
      },
    ];
    bringing.value = { name: "", saying: "", mistakes, found: null, added: false };
    return;
  }
  await read(main.name, main, {}, files);
}

/** Files that no other one names; all of them where they name each other in a circle. */
async function unnamed(files: readonly File[]): Promise<File[]> {
  const named = new Set<string>();
  for (const file of files) {
    const text = new TextDecoder().decode(await file.slice(0, LOOKED_AT).arrayBuffer());
    for (const { name } of files) if (name !== file.name && text.includes(name)) named.add(name);
  }
  const found = files.filter(({ name }) => !named.has(name));
  return found.length > 0 ? found : [...files];
}

/** Have the file that was brought last read again, with something told of it, or with axes accepted. */
export function readAgain(told: Told, accept: readonly number[] = []): Promise<void> {
  const now = bringing.peek();
  if (!now) return Promise.resolve();
  const axes: Told = accept.length > 0 ? { accept: accept.join(",") } : {};
  return read(now.name, null, { ...told, ...axes, again: "" });
}

async function read(
  named: string,
  file: File | null,
  options: Told,
  files: readonly File[] = [],
): Promise<void> {
  const name = plain(named);
  if (!mayEdit.peek() || bringing.peek()?.saying) return;
  pointedAt.value = null;
  bringing.value = { name, saying: "sending …", mistakes: [], found: null, added: false };
  const say = (now: Partial<Bringing>): void => {
    bringing.value = { ...bringing.peek()!, ...now };
  };
  const fail = (what: string): void => say({ saying: "", mistakes: [{ key: name, what, remedy: "" }] });
  try {
    for (const beside of files) {
      if (beside === file) continue;
      say({ saying: `sending ${beside.name} …` });
      const answer = await sent(beside.name, { beside: name }, beside);
      if (!answer.ok) return fail(`${beside.name}: ${(await answer.text()).trim() || answer.status}`);
    }
    const answer = await sent(name, options, file ?? "");
    if (!answer.ok || !answer.body) return fail((await answer.text()).trim() || `status ${answer.status}`);
    for await (const told of lines(answer.body)) {
      if (typeof told.say === "string") say({ saying: told.say });
      else if (Array.isArray(told.problems)) say({ saying: "", mistakes: told.problems.map(mistake) });
      else await add(told as unknown as Found, say);
    }
    if (bringing.peek()!.saying) fail("the connection ended before it was read");
  } catch (error) {
    fail(`could not be sent: ${error instanceof Error ? error.message : String(error)}`);
  }
}

const sent = (name: string, query: Told, body: File | ""): Promise<Response> =>
  fetch(`/cad/${encodeURIComponent(name)}?${new URLSearchParams(query)}`, {
    method: "POST",
    headers: { "Content-Type": "application/octet-stream" },
    body,
  });

async function add(found: Found, say: (now: Partial<Bringing>) => void): Promise<void> {
  const { accepted, mistakes } = found.brought
    ? await askBrought(found.brought)
    : { accepted: true, mistakes: [] };
  say({ saying: "", found, added: accepted, mistakes: [...mistakes] });
}

const mistake = ([file = "", key = "", what = "", remedy = ""]: string[]): Mistake => ({
  key: [file.split("/").at(-1), key].filter((part) => part !== "").join(" "),
  what,
  remedy,
});

async function* lines(body: ReadableStream<Uint8Array>): AsyncGenerator<Record<string, unknown>> {
  const reader = body.getReader();
  const decoder = new TextDecoder();
  let rest = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return;
    const parts = (rest + decoder.decode(value, { stream: true })).split("\n");
    rest = parts.pop()!;
    for (const part of parts) yield JSON.parse(part) as Record<string, unknown>;
  }
}

/** Half of the length of an axis in the room [m]. */
const HALF = 0.5;

/** The axis that is pointed at, as a marker of the room. */
export function axisMarker(): Result | null {
  const axis = pointedAt.value;
  return axis && drawnAs(axis);
}

function drawnAs(axis: Axis): Result {
  const end = (sign: number): [number, number, number] => {
    const [x, y, z] = axis.point.map((at, k) => at + sign * HALF * axis.axis[k]!);
    return [x!, y!, z!];
  };
  const segment: Segment = { type: "segment", start: end(-1), end: end(1), label: "", verdict: null };
  return {
    name: " axis",
    value: null,
    unit: "",
    limit: null,
    at_most: true,
    verdict: null,
    reason: axis.reason,
    interval: null,
    parts: [],
    markers: [segment],
    rows: [],
    t: null,
    muted: false,
    nothing: false,
  };
}
