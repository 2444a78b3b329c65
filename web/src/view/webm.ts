// A WebM file of pictures that are encoded already: RFC 8794 (EBML) and RFC 9559 (Matroska), of which this is the
// least that players and editors want: how long it is, and where one can go to.

/** An encoded picture. */
export interface FilmFrame {
  /** When it is shown [ms]; each later than the one before it. */
  ms: number;
  /** Whether it needs none before it. */
  whole: boolean;
  data: Uint8Array;
}

export interface Film {
  codec: "V_VP8" | "V_VP9";
  width: number;
  height: number;
  /** The first one is whole. */
  frames: readonly FilmFrame[];
  durationMs: number;
}

type Bytes = Uint8Array<ArrayBuffer>;

/** Bytes of each length, as an integer of EBML. */
const LENGTH = 8;
const TRACK = 1;
const WHOLE = 0x80;

export function webm({ codec, width, height, frames, durationMs }: Film): Blob {
  const head = element(
    0x1a45dfa3,
    element(0x4286, number(1)),
    element(0x42f7, number(1)),
    element(0x42f2, number(4)),
    element(0x42f3, number(8)),
    element(0x4282, text("webm")),
    element(0x4287, number(4)),
    element(0x4285, number(2)),
  );
  const info = element(
    0x1549a966,
    element(0x2ad7b1, number(1_000_000)), // [ns] of a tick: milliseconds
    element(0x4489, real(durationMs)),
    element(0x4d80, text("seerob")),
    element(0x5741, text("seerob")),
  );
  const tracks = element(
    0x1654ae6b,
    element(
      0xae,
      element(0xd7, number(TRACK)),
      element(0x73c5, number(TRACK)),
      element(0x83, number(1)), // video
      element(0x9c, number(0)), // no lacing
      element(0x86, text(codec)),
      element(0xe0, element(0xb0, number(width)), element(0xba, number(height))),
    ),
  );
  const clusters: { ms: number; bytes: Bytes }[] = [];
  for (let k = 0; k < frames.length; ) {
    const begin = k;
    do k += 1;
    while (k < frames.length && !frames[k]!.whole);
    const { ms } = frames[begin]!;
    const blocks = frames.slice(begin, k).map((frame) => element(0xa3, block(frame, ms)));
    clusters.push({ ms, bytes: element(0x1f43b675, element(0xe7, number(ms)), ...blocks) });
  }
  const where = (tracksAt: number, cuesAt: number): Bytes =>
    element(0x114d9b74, ...[seek(0x1549a966, begins), seek(0x1654ae6b, tracksAt), seek(0x1c53bb6b, cuesAt)]);
  let begins = 0;
  // As long whatever it says.
  begins = where(0, 0).length;
  let at = begins + info.length + tracks.length;
  const points = clusters.map(({ ms, bytes }) => {
    const cue = element(
      0xbb,
      element(0xb3, number(ms)),
      element(0xb7, element(0xf7, number(TRACK)), element(0xf1, number(at))),
    );
    at += bytes.length;
    return cue;
  });
  const cues = element(0x1c53bb6b, ...points);
  const seekHead = where(begins + info.length, at);
  const content = [seekHead, info, tracks, ...clusters.map(({ bytes }) => bytes), cues];
  const size = content.reduce((sum, part) => sum + part.length, 0);
  return new Blob([head, identity(0x18538067), length(size), ...content], { type: "video/webm" });
}

function seek(id: number, position: number): Bytes {
  const place = new Uint8Array(8);
  new DataView(place.buffer).setBigUint64(0, BigInt(position));
  return element(0x4dbb, element(0x53ab, identity(id)), element(0x53ac, place));
}

function block({ ms, whole, data }: FilmFrame, from: number): Bytes {
  const bytes = new Uint8Array(4 + data.length);
  bytes[0] = 0x80 | TRACK;
  new DataView(bytes.buffer).setInt16(1, ms - from);
  bytes[3] = whole ? WHOLE : 0;
  bytes.set(data, 4);
  return bytes;
}

function element(id: number, ...content: Bytes[]): Bytes {
  const size = content.reduce((sum, part) => sum + part.length, 0);
  return joined([identity(id), length(size), ...content]);
}

function joined(parts: readonly Bytes[]): Bytes {
  const bytes = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** An identity of EBML says its length itself. */
const identity = (id: number): Bytes => number(id);

function length(size: number): Bytes {
  const bytes = new Uint8Array(LENGTH);
  new DataView(bytes.buffer).setBigUint64(0, BigInt(size) | (1n << BigInt(7 * LENGTH)));
  return bytes;
}

function number(value: number): Bytes {
  const bytes: number[] = [];
  for (let rest = value; rest > 0 || bytes.length === 0; rest = Math.floor(rest / 256))
    bytes.unshift(rest % 256);
  return new Uint8Array(bytes);
}

function real(value: number): Bytes {
  const bytes = new Uint8Array(8);
  new DataView(bytes.buffer).setFloat64(0, value);
  return bytes;
}

const text = (letters: string): Bytes => new TextEncoder().encode(letters);
