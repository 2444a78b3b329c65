// A panel that hangs in the room: a canvas that is drawn on when there is news, at most so often.

import { CanvasTexture, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace } from "three";
import { uncut } from "../scene/materials";

/** Width in the room [m]. */
const WIDTH = 0.54;
/** Least time between two drawings [ms]: nobody reads faster. */
const EVERY_MS = 200;
/** What is written in the room is drawn over everything, but for panels: those are nearer. */
export const OVER_CAPTIONS = 11;
export const INK = "#dbe3ee";

export abstract class Panel {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  protected readonly brush: CanvasRenderingContext2D;
  private readonly texture: CanvasTexture;
  private drawnAt = Number.NEGATIVE_INFINITY;
  /** What was written on it when it was drawn last. */
  readonly written: string[] = [];

  /** @param pixels Of the canvas, which is 0.54 m wide in the room. */
  constructor(protected readonly pixels: { readonly width: number; readonly height: number }) {
    const canvas = document.createElement("canvas");
    Object.assign(canvas, pixels);
    this.brush = canvas.getContext("2d")!;
    this.texture = new CanvasTexture(canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = uncut(new MeshBasicMaterial({ map: this.texture, transparent: true, fog: false }));
    this.mesh = new Mesh(new PlaneGeometry(WIDTH, (WIDTH * pixels.height) / pixels.width), material);
    this.mesh.renderOrder = OVER_CAPTIONS;
  }

  /** Height in the room [m]. */
  get height(): number {
    return this.mesh.geometry.parameters.height;
  }

  /** Draw, where there is news and the last drawing is long enough ago. */
  update(time: number): void {
    if (!this.mesh.visible || time - this.drawnAt < EVERY_MS || !this.news()) return;
    this.drawnAt = time;
    this.written.length = 0;
    const { width, height } = this.pixels;
    this.brush.clearRect(0, 0, width, height);
    this.brush.fillStyle = "rgba(13, 19, 28, 0.92)";
    this.brush.fillRect(0, 0, width, height);
    this.paint();
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.texture.dispose();
    this.mesh.material.dispose();
    this.mesh.geometry.dispose();
  }

  /** Whether anything is to be drawn anew; asked once per drawing. */
  protected abstract news(): boolean;

  protected abstract paint(): void;

  protected write(text: string, x: number, y: number, color: string, font: string, most?: number): void {
    if (text === "") return;
    this.written.push(text);
    this.brush.font = font;
    this.brush.fillStyle = color;
    this.brush.fillText(text, x, y, most);
  }
}
