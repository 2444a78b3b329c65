// A board in the room: the run's verdict and its criteria, drawn from what feeds the panels of the page.

import { effect } from "@preact/signals";
import { CanvasTexture, Mesh, MeshBasicMaterial, PlaneGeometry, SRGBColorSpace } from "three";
import { against, withUnit } from "../figures";
import { runState, stale } from "../page_state";
import { orderedRows } from "../row_order";
import { STATE_ICONS, STATE_WORDS, type State } from "../verdicts";

/** Size in the room [m]: letters of a criterion are 11 mm high, to be read at arm's length. */
const WIDTH = 0.54;
const PIXELS = { width: 1080, height: 720 };
const ROW_PX = 54;
const MARGIN_PX = 28;
/** Least time between two drawings [ms]: nobody reads faster. */
const EVERY_MS = 200;
const INK: Record<State, string> = {
  exceeded: "#ff8fa6",
  undecided: "#fbe36a",
  missing: "#fbe36a",
  close: "#7ee7f1",
  within: "#7ee7f1",
  none: "#dbe3ee",
};

export class Board {
  readonly mesh: Mesh;
  private readonly brush: CanvasRenderingContext2D;
  private readonly texture: CanvasTexture;
  private readonly forget: () => void;
  private changed = true;
  private drawnAt = Number.NEGATIVE_INFINITY;

  constructor() {
    const canvas = document.createElement("canvas");
    Object.assign(canvas, PIXELS);
    this.brush = canvas.getContext("2d")!;
    this.texture = new CanvasTexture(canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = new MeshBasicMaterial({ map: this.texture, transparent: true, fog: false });
    this.mesh = new Mesh(new PlaneGeometry(WIDTH, (WIDTH * PIXELS.height) / PIXELS.width), material);
    this.forget = effect(() => {
      void [orderedRows.value, runState.value, stale.value];
      this.changed = true;
    });
  }

  /** Lines as they stand on it, worst first. */
  static lines(): { state: State; text: string; figure: string }[] {
    return orderedRows.peek().map(({ info, result, state }) => {
      const shown =
        result && result.value !== null
          ? against(result.value, result.limit, result.unit, result.at_most)
          : null;
      const limit = shown && result?.limit !== null ? ` / ${shown.limit}` : "";
      return { state, text: info.name, figure: shown ? withUnit(`${shown.value}${limit}`, info.unit) : "" };
    });
  }

  /** Draw what has changed, at most so often. */
  update(time: number): void {
    if (!this.changed || time - this.drawnAt < EVERY_MS) return;
    this.changed = false;
    this.drawnAt = time;
    const { brush } = this;
    const { width, height } = PIXELS;
    brush.clearRect(0, 0, width, height);
    brush.fillStyle = "rgba(13, 19, 28, 0.92)";
    brush.fillRect(0, 0, width, height);
    const whole: State = stale.peek() ? "missing" : runState.peek();
    const headline = stale.peek() ? "NO CURRENT DATA" : `${STATE_ICONS[whole]} run: ${STATE_WORDS[whole]}`;
    this.write(headline, MARGIN_PX, 62, INK[whole], "bold 46px sans-serif");
    const room = Math.floor((height - 110) / ROW_PX);
    const lines = stale.peek() ? [] : Board.lines();
    lines.slice(0, room).forEach(({ state, text, figure }, i) => {
      const y = 130 + i * ROW_PX;
      this.write(STATE_ICONS[state], MARGIN_PX, y, INK[state], "bold 38px sans-serif");
      brush.textAlign = "right";
      this.write(figure, width - MARGIN_PX, y, INK[state], "36px sans-serif");
      const left = width - 3 * MARGIN_PX - 60 - brush.measureText(figure).width;
      brush.textAlign = "left";
      this.write(text, MARGIN_PX + 52, y, "#dbe3ee", "36px sans-serif", left);
    });
    if (lines.length > room)
      this.write(`and ${lines.length - room} more`, MARGIN_PX, height - 14, "#aab6c6", "28px sans-serif");
    this.texture.needsUpdate = true;
  }

  dispose(): void {
    this.forget();
    this.texture.dispose();
    (this.mesh.material as MeshBasicMaterial).dispose();
    this.mesh.geometry.dispose();
  }

  private write(text: string, x: number, y: number, color: string, font: string, most?: number): void {
    this.brush.font = font;
    this.brush.fillStyle = color;
    this.brush.fillText(text, x, y, most);
  }
}
