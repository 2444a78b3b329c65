// CAD files that are brought to the workstation: read by the server, added to the draft, axes accepted.

import { signal } from "@preact/signals";
import type { Finding, Mistake, Result, Segment } from "../wire";
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

/** What a file that does not say it is told by the user. */
export interface Told {
  units?: string;
  up?: string;
}

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

/** Bring a file; what is found is in the draft when this is over, unless something is wrong. */
export function bring(file: File, told: Told = {}): Promise<void> {
  marked.value = new Set();
  return read(plain(file.name), file, { ...told });
}

/** Have the file that was brought last read again, with something told of it, or with axes accepted. */
export function readAgain(told: Told, accept: readonly number[] = []): Promise<void> {
  const now = bringing.peek();
  if (!now) return Promise.resolve();
  const axes: Record<string, string> = accept.length > 0 ? { accept: accept.join(",") } : {};
  return read(now.name, null, { ...told, ...axes, again: "" });
}

async function read(name: string, file: File | null, options: Record<string, string>): Promise<void> {
  if (!mayEdit.peek() || bringing.peek()?.saying) return;
  pointedAt.value = null;
  bringing.value = { name, saying: "sending …", mistakes: [], found: null, added: false };
  const say = (now: Partial<Bringing>): void => {
    bringing.value = { ...bringing.peek()!, ...now };
  };
  const fail = (what: string): void => say({ saying: "", mistakes: [{ key: name, what, remedy: "" }] });
  try {
    const query = new URLSearchParams(options);
    const answer = await fetch(`/cad/${encodeURIComponent(name)}?${query}`, {
      method: "POST",
      headers: { "Content-Type": "application/octet-stream" },
      body: file ?? "",
    });
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
  if (!axis) return null;
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
