// A menu beside the wrist: large buttons that the other hand's beam presses, for time and for comfort.

import {
  CanvasTexture,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  type Ray,
  type Raycaster,
  SRGBColorSpace,
  Vector3,
} from "three";
import { uncut } from "../scene/materials";
import { OVER_CAPTIONS } from "./panel";

/** Size of a button in the room [m]: no smaller than a finger hits. */
const BUTTON = { width: 0.066, height: 0.046 };
const COLUMNS = 4;
/** Least time between two looks at what stands on buttons [ms]. */
const EVERY_MS = 100;
/** Pixels per metre: letters are 9 mm high, to be read at arm's length. */
const SHARP = 2600;

export interface Item {
  /** What stands on it now. */
  label(): string;
  /** Whether it is on. */
  on?(): boolean;
  press(): void;
}

export class Menu {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly brush: CanvasRenderingContext2D;
  private readonly texture: CanvasTexture;
  private readonly rowCount: number;
  /** What is drawn of each button: its words, whether it is on, whether it is pointed at. */
  private readonly labels: string[] = [];
  private readonly lit: boolean[] = [];
  private lookedAt = Number.NEGATIVE_INFINITY;
  private drawn = -1;
  private pointed = -1;

  constructor(readonly items: readonly Item[]) {
    this.rowCount = Math.ceil(items.length / COLUMNS);
    const [width, height] = [BUTTON.width * COLUMNS, BUTTON.height * this.rowCount];
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: width * SHARP, height: height * SHARP });
    this.brush = canvas.getContext("2d")!;
    this.texture = new CanvasTexture(canvas);
    this.texture.colorSpace = SRGBColorSpace;
    const material = uncut(new MeshBasicMaterial({ map: this.texture, transparent: true, fog: false }));
    this.mesh = new Mesh(new PlaneGeometry(width, height), material);
    this.mesh.renderOrder = OVER_CAPTIONS;
  }

  /** Whether a ray of the world meets it; notes which button. */
  point(ray: Raycaster): boolean {
    this.pointed = this.met(ray.ray);
    return this.pointed >= 0;
  }

  /** Press the button that a ray of the world meets; whether there is one. */
  press(ray: Raycaster): boolean {
    if (!this.mesh.visible || !this.point(ray)) return false;
    this.items[this.pointed]?.press();
    return true;
  }

  /** Where the middle of a button is in the mesh's own frame [m]. */
  middle(label: string): [number, number, number] | null {
    const k = this.items.findIndex((item) => item.label() === label);
    if (k < 0) return null;
    const x = ((k % COLUMNS) + 0.5 - COLUMNS / 2) * BUTTON.width;
    return [x, (this.rowCount / 2 - Math.floor(k / COLUMNS) - 0.5) * BUTTON.height, 0];
  }

  /** Draw what has changed. */
  update(time: number): void {
    // What stands on buttons changes seldom; where one points, at any time.
    if (this.pointed === this.drawn && Math.abs(time - this.lookedAt) < EVERY_MS) return;
    this.lookedAt = time;
    if (this.news()) this.paint();
  }

  // Apart, as what a function closes over is made whenever that is called.
  private paint(): void {
    const { brush } = this;
    const [w, h] = [BUTTON.width * SHARP, BUTTON.height * SHARP];
    brush.clearRect(0, 0, brush.canvas.width, brush.canvas.height);
    brush.textAlign = "center";
    brush.textBaseline = "middle";
    brush.font = `${0.0105 * SHARP}px sans-serif`;
    this.items.forEach((item, k) => {
      const [x, y] = [(k % COLUMNS) * w, Math.floor(k / COLUMNS) * h];
      brush.fillStyle = item.on?.() ? "#14656e" : "rgba(13, 19, 28, 0.94)";
      brush.fillRect(x + 3, y + 3, w - 6, h - 6);
      brush.strokeStyle = k === this.pointed ? "#7ee7f1" : "#46566b";
      brush.lineWidth = k === this.pointed ? 6 : 2;
      brush.strokeRect(x + 4, y + 4, w - 8, h - 8);
      brush.fillStyle = "#eef3fa";
      brush.fillText(item.label(), x + w / 2, y + h / 2, w - 12);
    });
    this.texture.needsUpdate = true;
  }

  /** Whether anything is to be drawn anew. */
  private news(): boolean {
    let news = this.drawn !== this.pointed;
    this.drawn = this.pointed;
    for (let k = 0; k < this.items.length; k += 1) {
      const label = this.items[k]!.label();
      const on = this.items[k]!.on?.() ?? false;
      if (label !== this.labels[k] || on !== this.lit[k]) news = true;
      this.labels[k] = label;
      this.lit[k] = on;
    }
    return news;
  }

  dispose(): void {
    this.texture.dispose();
    this.mesh.material.dispose();
    this.mesh.geometry.dispose();
  }

  private readonly from = new Vector3();
  private readonly along = new Vector3();
  private readonly toOwn = new Matrix4();

  /** The button that a ray of the world meets from before it; −1 for none. Lists of what is met would be made anew. */
  private met({ origin, direction }: Ray): number {
    const { mesh, from, along, toOwn } = this;
    toOwn.copy(mesh.matrixWorld).invert();
    from.copy(origin).applyMatrix4(toOwn);
    along.copy(direction).transformDirection(toOwn);
    if (!(from.z >= 0 && along.z < 0)) return -1;
    const way = -from.z / along.z;
    const column = Math.floor((from.x + way * along.x) / BUTTON.width + COLUMNS / 2);
    const row = Math.floor(this.rowCount / 2 - (from.y + way * along.y) / BUTTON.height);
    if (column < 0 || column >= COLUMNS || row < 0 || row >= this.rowCount) return -1;
    const k = row * COLUMNS + column;
    return k < this.items.length ? k : -1;
  }
}
