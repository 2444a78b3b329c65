// A clip of the room: every picture that is drawn, at the time at which it was, as WebM with VP9 or VP8.

import type { Stage } from "../scene/stage";
import { type FilmFrame, webm } from "./webm";

/** Codecs by preference, and what WebM calls them. */
const CODECS = [
  ["vp09.00.51.08", "V_VP9"],
  ["vp8", "V_VP8"],
] as const;
/** Bits of a second of pictures per pixel: edges of lines and letters stay sharp. */
const BITS_PER_PIXEL = 8;
/** From one picture that is whole in itself to the next, at most [ms]: where players can go to. */
const WHOLE_EVERY_MS = 2000;
/** Pictures that wait for the encoder, at most. */
const WAITING = 8;
/** Of a recorder of the browser's own. */
const PICTURES_PER_S = 25;

/** Ends a clip and gives it. */
export type EndFilm = () => Promise<Blob>;

/** Film the room until the answer is called; null where this browser cannot. */
export async function film(stage: Stage): Promise<EndFilm | null> {
  const canvas = stage.renderer.domElement;
  const even = (size: number): number => Math.max(size & ~1, 2);
  const [width, height] = [even(canvas.width), even(canvas.height)];
  for (const [codec, name] of CODECS) {
    const config = { codec, width, height, bitrate: width * height * BITS_PER_PIXEL };
    // Only where the page came by a safe way; else the browser's own recorder does it.
    if ("VideoEncoder" in globalThis && (await VideoEncoder.isConfigSupported(config)).supported)
      return encoded(stage, config, name);
  }
  return recorded(canvas);
}

function encoded(stage: Stage, config: VideoEncoderConfig, codec: "V_VP8" | "V_VP9"): EndFilm {
  const { width, height } = config;
  const frames: FilmFrame[] = [];
  let failure: Error | null = null;
  const encoder = new VideoEncoder({
    output: (chunk) => {
      const data = new Uint8Array(chunk.byteLength);
      chunk.copyTo(data);
      frames.push({ ms: Math.round(chunk.timestamp / 1000), whole: chunk.type === "key", data });
    },
    error: (error) => {
      failure = error;
    },
  });
  encoder.configure(config);
  // The room's own canvas gets coarser where pictures come slowly: the clip keeps its size.
  const sheet = new OffscreenCanvas(width, height);
  const brush = sheet.getContext("2d")!;
  const begun = performance.now();
  let last = -1;
  let whole = Number.NEGATIVE_INFINITY;
  const take = (): void => {
    if (encoder.state !== "configured") return;
    if (encoder.encodeQueueSize > WAITING) {
      stage.invalidate(); // this one is left out: the next is not
      return;
    }
    const ms = Math.max(Math.round(performance.now() - begun), last + 1);
    last = ms;
    brush.drawImage(stage.renderer.domElement, 0, 0, width, height);
    const picture = new VideoFrame(sheet, { timestamp: ms * 1000 });
    const keyFrame = ms - whole >= WHOLE_EVERY_MS;
    if (keyFrame) whole = ms;
    encoder.encode(picture, { keyFrame });
    picture.close();
  };
  stage.drawn = take;
  stage.redraw();
  return async () => {
    stage.drawn = null;
    if (encoder.state === "configured") {
      await encoder.flush();
      // What stands at the end is there until then.
      stage.drawn = take;
      stage.redraw();
      stage.drawn = null;
      await encoder.flush();
      encoder.close();
    }
    if (failure) throw failure;
    return webm({ codec, width, height, frames, durationMs: last + 1 });
  };
}

function recorded(canvas: HTMLCanvasElement): EndFilm | null {
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
