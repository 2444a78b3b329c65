// Where pictures of a camera come from: the server, which fetches a network camera's, or a camera of this device.

import { device, devices } from "../view/camera";
import type { CameraInfo } from "../wire";

/** A picture that stands still for so long is not of the present [ms]. */
const STANDS_MS = 1500;
/** Least time between two requests [ms]: the server takes 60 a second, meshes among them. */
const EVERY_MS = 50;
const AGAIN_MS = 1500;

export interface Pictures {
  /** The newest picture, when it is another than at the last call. */
  take(): ImageBitmap | HTMLVideoElement | null;
  /** Why there is none, or none of the present; empty when there is. */
  readonly mistake: string;
  close(): void;
}

export function picturesOf(info: CameraInfo, number: number, came: () => void): Pictures {
  return info.fetched ? new Fetched(number, came) : new OfDevice(info, came);
}

const STANDS = "its picture stands still";
const WAITS = "waiting for its picture";

class Fetched implements Pictures {
  private newest: ImageBitmap | null = null;
  private at = Number.NEGATIVE_INFINITY;
  private said = WAITS;
  private readonly over = new AbortController();

  constructor(
    private readonly number: number,
    private readonly came: () => void,
  ) {
    void this.listen();
  }

  get mistake(): string {
    return this.said || (performance.now() - this.at > STANDS_MS ? STANDS : "");
  }

  take(): ImageBitmap | null {
    const picture = this.newest;
    this.newest = null;
    return picture;
  }

  close(): void {
    this.over.abort();
    this.newest?.close();
  }

  private async listen(): Promise<void> {
    const { signal } = this.over;
    let known = "0";
    while (!signal.aborted) {
      const asked = performance.now();
      try {
        const answer = await fetch(`/camera/${this.number}?after=${known}`, { signal });
        if (answer.status === 200) {
          const age = 1000 * Number(answer.headers.get("X-Age"));
          const picture = await createImageBitmap(await answer.blob(), { imageOrientation: "flipY" });
          known = answer.headers.get("X-Picture") ?? "0";
          this.newest?.close();
          this.newest = picture;
          this.at = performance.now() - age;
          this.said = "";
        } else if (answer.status !== 204) {
          this.said = (await answer.text()).trim();
          known = "0";
          await pause(AGAIN_MS);
        }
      } catch (error) {
        if (signal.aborted) return;
        this.said = String(error instanceof Error ? error.message : error);
        await pause(AGAIN_MS);
      }
      this.came();
      await pause(EVERY_MS - (performance.now() - asked));
    }
  }
}

class OfDevice implements Pictures {
  private readonly video = document.createElement("video");
  private stream: MediaStream | null = null;
  private at = Number.NEGATIVE_INFINITY;
  private said = WAITS;
  private fresh = false;
  private closed = false;

  constructor(
    private readonly info: CameraInfo,
    private readonly came: () => void,
  ) {
    this.video.muted = true;
    this.video.playsInline = true;
    void this.begin();
  }

  get mistake(): string {
    return this.said || (performance.now() - this.at > STANDS_MS ? STANDS : "");
  }

  take(): HTMLVideoElement | null {
    if (!this.fresh) return null;
    this.fresh = false;
    return this.video;
  }

  close(): void {
    this.closed = true;
    for (const track of this.stream?.getTracks() ?? []) track.stop();
    this.video.srcObject = null;
  }

  private async begin(): Promise<void> {
    const [width, height] = this.info.size;
    try {
      if (!navigator.mediaDevices) throw new Error("cameras need https, or localhost");
      const id = device.peek();
      // Neither cropped nor made larger: the lens is of the picture as the camera takes it.
      const video = { width: { ideal: width }, height: { ideal: height }, resizeMode: "none" };
      this.stream = await navigator.mediaDevices.getUserMedia({
        audio: false,
        video: { ...video, ...(id ? { deviceId: { exact: id } } : {}) } as MediaTrackConstraints,
      });
      if (this.closed) return this.close();
      const every = await navigator.mediaDevices.enumerateDevices();
      devices.value = every
        .filter(({ kind }) => kind === "videoinput")
        .map(({ deviceId, label }) => ({ id: deviceId, label }));
      this.video.srcObject = this.stream;
      await this.video.play();
      this.video.requestVideoFrameCallback(this.heard);
    } catch (error) {
      this.said = String(error instanceof Error ? error.message : error);
      this.came();
    }
  }

  private readonly heard = (): void => {
    if (this.closed) return;
    const { videoWidth: w, videoHeight: h } = this.video;
    const [width, height] = this.info.size;
    // Of another shape it is cut somewhere, and nobody knows where.
    const fits = Math.abs(w * height - h * width) <= Math.max(width, height);
    this.said = fits ? "" : `its pictures are ${w} × ${h}, its lens is known for ${width} × ${height}`;
    // three.js asks the element how large its picture is.
    [this.video.width, this.video.height] = [w, h];
    this.at = performance.now();
    this.fresh = true;
    this.came();
    this.video.requestVideoFrameCallback(this.heard);
  };
}

const pause = (ms: number) => new Promise((done) => setTimeout(done, Math.max(ms, 0)));
