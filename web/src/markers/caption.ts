// Text in the room: a plate with an icon of the verdict, always upright, always readable, never in the way
// of a click. It is painted on a canvas, so whatever the text says stays text.

import { CanvasTexture, LinearFilter, Sprite, SpriteMaterial, SRGBColorSpace, Vector3 } from "three";
import { shortened } from "../format";
import { NEUTRAL_TEXT, STATE_ICONS, VERDICT_TEXT } from "../verdicts";
import type { Verdict } from "../wire";
import type { View } from "./view";

const PAD_PX = 6;
const SHARPNESS = 2;
/** Characters; about as many as fit across the room of a telephone. */
const LONGEST = 46;
/** Lower edge of the plate above its point [px]. */
const RAISED_PX = 8;
const FAMILY = 'system-ui, "Segoe UI", "Noto Sans", sans-serif';

/** A figure, or only the name of a place. */
export type Size = "figure" | "name";

const SIZES: Record<Size, { font: string; height: number }> = {
  figure: { font: `600 ${12 * SHARPNESS}px ${FAMILY}`, height: 21 },
  name: { font: `500 ${11 * SHARPNESS}px ${FAMILY}`, height: 17 },
};

const at = new Vector3();

export class Caption {
  readonly object: Sprite;
  private readonly canvas = document.createElement("canvas");
  private readonly material: SpriteMaterial;
  private texture: CanvasTexture | null = null;
  private shown = "";
  /** How much higher than where it belongs it is, negative for lower [px]. */
  liftedPx = 0;

  constructor(private readonly size: Size = "figure") {
    this.material = new SpriteMaterial({
      depthTest: false,
      transparent: true,
      toneMapped: false,
      fog: false,
    });
    this.object = new Sprite(this.material);
    this.object.renderOrder = 10;
    this.object.raycast = () => {};
    this.lift(0);
  }

  update(text: string, verdict: Verdict | null): void {
    const short = shortened(text, LONGEST);
    const key = `${verdict} ${short}`;
    if (key === this.shown) return;
    this.shown = key;
    this.paint(verdict ? `${STATE_ICONS[verdict]}  ${short}` : short, verdict);
  }

  face(view: View): void {
    const { camera, pixel } = view;
    const size = pixel * Math.max(this.object.getWorldPosition(at).distanceTo(camera.position), 0.05);
    this.object.scale.set((this.canvas.width / SHARPNESS) * size, (this.canvas.height / SHARPNESS) * size, 1);
  }

  get widthPx(): number {
    return this.canvas.width / SHARPNESS;
  }

  get heightPx(): number {
    return SIZES[this.size].height;
  }

  /** Its lower edge above where it belongs [px]. */
  get bottomPx(): number {
    return RAISED_PX + this.liftedPx;
  }

  /** Draw it so much higher on the screen than where it belongs, and so much further right [px]. */
  lift(px: number, rightPx = 0): void {
    this.liftedPx = px;
    this.object.center.set(0.5 - rightPx / Math.max(this.widthPx, 1), -this.bottomPx / this.heightPx);
  }

  dispose(): void {
    this.texture?.dispose();
    this.material.dispose();
  }

  private paint(text: string, verdict: Verdict | null): void {
    const brush = this.canvas.getContext("2d")!;
    const { font } = SIZES[this.size];
    brush.font = font;
    const width = Math.ceil(brush.measureText(text).width) + 2 * PAD_PX * SHARPNESS;
    const height = this.heightPx * SHARPNESS;
    // A texture cannot change its size once it is on the graphics card.
    if (width !== this.canvas.width || height !== this.canvas.height || !this.texture) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.texture?.dispose();
      this.texture = new CanvasTexture(this.canvas);
      this.texture.colorSpace = SRGBColorSpace;
      this.texture.minFilter = LinearFilter;
      this.texture.generateMipmaps = false;
      this.material.map = this.texture;
      this.material.needsUpdate = true;
    }
    const color = verdict ? VERDICT_TEXT[verdict] : NEUTRAL_TEXT;
    brush.clearRect(0, 0, width, height);
    brush.beginPath();
    brush.roundRect(2, 2, width - 4, height - 4, 10);
    brush.fillStyle = "rgba(10, 14, 20, 0.78)";
    brush.fill();
    brush.lineWidth = 2.5;
    brush.strokeStyle = color;
    if (verdict === "undecided") brush.setLineDash([10, 7]);
    brush.stroke();
    brush.setLineDash([]);
    brush.font = font;
    brush.fillStyle = color;
    brush.textBaseline = "middle";
    brush.fillText(text, PAD_PX * SHARPNESS, height / 2 + 1);
    this.texture.needsUpdate = true;
  }
}
