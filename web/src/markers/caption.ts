// Text in the room: a plate with an icon of the verdict, always upright, always readable, never in the way
// of a click. It is painted on a canvas, so whatever the text says stays text.

import {
  CanvasTexture,
  LinearFilter,
  type PerspectiveCamera,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  Vector3,
} from "three";
import { shortened } from "../format";
import { paintedBy } from "../scene/effort";
import { spoken } from "../units";
import { NEUTRAL_TEXT, STATE_ICONS, VERDICT_TEXT } from "../verdicts";
import type { Verdict } from "../wire";
import type { View } from "./view";

const PAD_PX = 6;
const SHARPNESS = 2;
/** Characters of a line; about as many as fit across the room of a telephone. */
const LONGEST = 50;
/** Lower edge of the plate above its point [px]. */
const RAISED_PX = 8;
const FAMILY = 'system-ui, "Segoe UI", "Noto Sans", sans-serif';

/** A figure, or only the name of a place. */
export type Size = "figure" | "name";

const SIZES: Record<Size, { font: string; height: number; line: number }> = {
  figure: { font: `600 ${12 * SHARPNESS}px ${FAMILY}`, height: 21, line: 15 },
  name: { font: `500 ${11 * SHARPNESS}px ${FAMILY}`, height: 17, line: 13 },
};

const at = new Vector3();

/** How far an object is before the eye, along the line of sight [m]: what it is drawn smaller by. */
export function depthOf(object: Sprite, camera: PerspectiveCamera): number {
  return Math.max(-object.getWorldPosition(at).applyMatrix4(camera.matrixWorldInverse).z, 0.05);
}

export class Caption {
  readonly object: Sprite;
  private readonly canvas = document.createElement("canvas");
  private readonly material: SpriteMaterial;
  private texture: CanvasTexture | null = null;
  /** What it says. */
  text = "";
  private verdict: Verdict | null = null;
  private lines: string[] = [];
  /** How much higher than where it belongs it is, negative for lower; and how much further right [px]: then `lift`. */
  liftedPx = 0;
  rightPx = 0;
  /** Side of the room where it is; 0 before it was at any. */
  side: -1 | 0 | 1 = 0;

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
    this.lift();
  }

  say(said: string, verdict: Verdict | null): void {
    // A name stays one, whatever it looks like.
    const text = this.aside ? spoken(said) : said;
    if (this.texture && text === this.text && verdict === this.verdict) return;
    this.text = text;
    this.verdict = verdict;
    // Whose figure it is, and below it the figure: a narrow plate covers less.
    const [, owner, figure] = (this.aside && /^(.+?): (.+)$/s.exec(text)) || ["", text, ""];
    const head = shortened(owner!, LONGEST);
    this.lines = [verdict ? `${STATE_ICONS[verdict]}  ${head}` : head];
    if (figure) this.lines.push(shortened(figure, LONGEST));
    this.paint(verdict);
  }

  /** Whether it belongs at a side of the room: a name only says what stands there. */
  get aside(): boolean {
    return this.size === "figure";
  }

  face({ camera, pixel }: View): void {
    const size = pixel * depthOf(this.object, camera);
    const { scale } = this.object;
    scale.x = (this.canvas.width / SHARPNESS) * size;
    scale.y = (this.canvas.height / SHARPNESS) * size;
  }

  get widthPx(): number {
    return this.canvas.width / SHARPNESS;
  }

  get heightPx(): number {
    const { height, line } = SIZES[this.size];
    return height + (this.lines.length > 1 ? line : 0);
  }

  /** Its lower edge above where it belongs [px]. */
  get bottomPx(): number {
    return RAISED_PX + this.liftedPx;
  }

  /** Draw it so much higher on the screen than where it belongs, and so much further right, as is noted. */
  lift(): void {
    const { center } = this.object;
    center.x = 0.5 - this.rightPx / Math.max(this.widthPx, 1);
    center.y = -this.bottomPx / this.heightPx;
  }

  dispose(): void {
    this.texture?.dispose();
    this.material.dispose();
  }

  private paint(verdict: Verdict | null): void {
    const brush = this.canvas.getContext("2d", paintedBy())!;
    const { font, line } = SIZES[this.size];
    brush.font = font;
    const widest = Math.max(...this.lines.map((text) => brush.measureText(text).width));
    const width = Math.ceil(widest) + 2 * PAD_PX * SHARPNESS;
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
      // Another program only where there was no texture.
      if (!this.material.map) this.material.needsUpdate = true;
      this.material.map = this.texture;
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
    const first = height / 2 + 1 - ((this.lines.length - 1) * line * SHARPNESS) / 2;
    for (const [k, text] of this.lines.entries())
      brush.fillText(text, PAD_PX * SHARPNESS, first + k * line * SHARPNESS);
    this.texture.needsUpdate = true;
  }
}
