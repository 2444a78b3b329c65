// What one takes along: a picture of the room, a clip of it, and the figures of the instant that is shown.

import { frame, scene, stale } from "../page_state";
import type { Result } from "../wire";

const PICTURES_PER_S = 25;

export function save(content: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** `cell 12.34 s` as a file's name. */
export function fileName(ending: string): string {
  const title = (scene.peek()?.title ?? "seerob").replace(/[^\p{L}\p{N} ._-]+/gu, "_");
  return `${title} ${(frame.peek()?.t ?? 0).toFixed(2)} s.${ending}`;
}

/** Figures of the instant that is shown, in SI units as the engine has them. */
export function figures(): object {
  const now = frame.peek();
  const run = scene.peek();
  return {
    workstation: run?.title,
    workstation_hash: run?.workstation_hash,
    seerob: run?.version,
    t: now?.t,
    // A picture of what is no present any more is none of it either.
    stale: stale.peek(),
    results: (now?.results ?? []).map(figuresOf),
  };
}

const COLUMNS = ["name", "value", "unit", "limit", "at_most", "verdict", "low", "high", "reason"] as const;

function figuresOf({ name, value, unit, limit, at_most, verdict, interval, reason }: Result) {
  const [low, high] = interval ?? [null, null];
  return { name, value, unit, limit, at_most, verdict, low, high, reason };
}

/** The same as a table: a row per criterion, the instant [s] before it. */
export function figuresTable(): string {
  const now = frame.peek();
  const rows = (now?.results ?? []).map((result) => {
    const of = figuresOf(result);
    return [now?.t, ...COLUMNS.map((column) => of[column])].map(cell).join(",");
  });
  return `${["t [s]", ...COLUMNS].join(",")}\r\n${rows.map((row) => `${row}\r\n`).join("")}`;
}

// A text that a spreadsheet could take for a formula is none.
function cell(value: unknown): string {
  if (value === null || value === undefined) return "";
  if (typeof value !== "string") return String(value);
  const text = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}

/** Film the room until the answer is called, which gives the clip; null where this browser cannot. */
export function film(canvas: HTMLCanvasElement): (() => Promise<Blob>) | null {
  if (typeof MediaRecorder === "undefined" || !canvas.captureStream) return null;
  const kind = ["video/mp4;codecs=avc1", "video/webm;codecs=vp9", "video/webm"].find((one) =>
    MediaRecorder.isTypeSupported(one),
  );
  if (!kind) return null;
  const stream = canvas.captureStream(PICTURES_PER_S);
  const recorder = new MediaRecorder(stream, { mimeType: kind });
  const parts: Blob[] = [];
  recorder.ondataavailable = ({ data }) => parts.push(data);
  recorder.start(1000);
  return () =>
    new Promise((resolve) => {
      recorder.onstop = () => {
        for (const track of stream.getTracks()) track.stop();
        resolve(new Blob(parts, { type: kind.split(";")[0]! }));
      };
      recorder.stop();
    });
}
