// The other visitors in the room: head, hands, joints, laser and name, each as large as they are.

import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  ConeGeometry,
  Group,
  Line,
  LineBasicMaterial,
  Mesh,
  MeshBasicMaterial,
  OctahedronGeometry,
  Points,
  PointsMaterial,
  Quaternion,
  SphereGeometry,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
  Vector3,
} from "three";
import type { Presences, VisitorInfo } from "../wire";

/** Of a visitor at scale 1 [m]. */
const HEAD = 0.11;
const HAND = 0.045;
const ABOVE = 0.24;
/** How fast what is drawn follows what was heard [ms]. */
const FOLLOWS_MS = 40;
/** A jump [m of the visitor] that is shown at once: nobody glides through walls. */
const JUMP = 1;
const MOST_POINTS = 160;
const SHAPES: Record<string, () => BufferGeometry> = {
  ball: () => new SphereGeometry(HEAD, 20, 14),
  box: () => new BoxGeometry(1.6 * HEAD, 1.6 * HEAD, 1.6 * HEAD),
  cone: () => new ConeGeometry(HEAD, 2 * HEAD, 20),
  drop: () => new OctahedronGeometry(1.2 * HEAD),
};

/** One limb: what was heard, and what is drawn. */
class Limb {
  readonly position = new Vector3();
  readonly turn = new Quaternion();
  heard = false;

  constructor(readonly object: Mesh) {
    object.visible = false;
  }

  take(block: Float32Array, row: number): void {
    const at = 7 * row;
    this.heard = !Number.isNaN(block[at]!);
    if (!this.heard) return;
    this.position.fromArray(block, at);
    this.turn.set(block[at + 4]!, block[at + 5]!, block[at + 6]!, block[at + 3]!);
  }

  follow(share: number, scale: number): boolean {
    const { object } = this;
    const came = this.heard && !object.visible;
    const left = this.position.distanceTo(object.position);
    const still = !came && left < 1e-6 * scale && object.visible === this.heard;
    object.visible = this.heard;
    if (!this.heard || (still && object.quaternion.angleTo(this.turn) < 1e-6)) return !still;
    const all = came || left > JUMP * scale || left < 1e-5 * scale ? 1 : share;
    object.position.lerp(this.position, all);
    object.quaternion.slerp(this.turn, all);
    object.scale.setScalar(scale);
    return true;
  }
}

class Companion {
  readonly root = new Group();
  readonly limbs: readonly Limb[];
  private readonly skin: MeshBasicMaterial;
  private readonly beam: Line;
  private readonly joints: Points;
  private readonly label = new Sprite(new SpriteMaterial({ transparent: true, depthTest: false }));
  private lettered = "";

  constructor(private info: VisitorInfo) {
    this.skin = new MeshBasicMaterial({ color: info.color });
    const face = new Mesh(
      new BoxGeometry(1.2 * HEAD, 0.35 * HEAD, 0.3 * HEAD),
      new MeshBasicMaterial({ color: 0x10151c }),
    );
    face.position.z = -0.95 * HEAD;
    const head = new Mesh((SHAPES[info.shape] ?? SHAPES.ball!)(), this.skin);
    head.add(face);
    const hand = () => new Mesh(new SphereGeometry(HAND, 14, 10), this.skin);
    this.limbs = [new Limb(head), new Limb(hand()), new Limb(hand())];
    this.beam = new Line(lines(2), new LineBasicMaterial({ color: info.color }));
    this.joints = new Points(lines(MOST_POINTS), new PointsMaterial({ color: info.color, size: 0.012 }));
    for (const each of [this.beam, this.joints]) {
      each.visible = false;
      each.frustumCulled = false;
    }
    this.root.add(...this.limbs.map(({ object }) => object), this.beam, this.joints, this.label);
    this.tell(info);
  }

  get id(): number {
    return this.info.id;
  }

  tell(info: VisitorInfo): void {
    this.info = info;
    this.skin.color.set(info.color);
    const words = info.scale === 1 ? info.name : `${info.name} ×${Number(info.scale.toPrecision(3))}`;
    if (words === this.lettered) return;
    this.lettered = words;
    this.label.material.map?.dispose();
    const { texture, aspect } = written(words, info.color);
    this.label.material.map = texture;
    this.label.material.needsUpdate = true;
    this.label.scale.set(0.09 * aspect, 0.09, 1);
    this.label.userData.aspect = aspect;
  }

  take(poses: Float32Array, points: Float32Array, laser: Float32Array): void {
    for (const [row, limb] of this.limbs.entries()) limb.take(poses, row);
    fill(this.beam, laser);
    fill(this.joints, points);
  }

  follow(share: number): boolean {
    const { scale } = this.info;
    let moved = false;
    for (const limb of this.limbs) moved = limb.follow(share, scale) || moved;
    const head = this.limbs[0]!.object;
    this.label.visible = head.visible;
    this.label.position.copy(head.position);
    this.label.position.z += ABOVE * scale;
    this.label.scale.set(0.09 * scale * this.label.userData.aspect, 0.09 * scale, 1);
    (this.joints.material as PointsMaterial).size = 0.012 * scale;
    return moved;
  }

  dispose(): void {
    this.root.removeFromParent();
    this.root.traverse((each) => {
      const { geometry, material } = each as Partial<Mesh>;
      geometry?.dispose();
      for (const one of [material ?? []].flat()) one.dispose();
    });
    this.label.material.map?.dispose();
  }
}

export class Companions {
  readonly root = new Group();
  private readonly of = new Map<number, Companion>();
  /** The same, in a list: what a map is gone through with would be made anew for each picture. */
  private all: readonly Companion[] = [];
  private at = Number.NaN;

  /** Show these and no others. */
  list(infos: readonly VisitorInfo[]): void {
    const there = new Set(infos.map(({ id }) => id));
    for (const [id, companion] of this.of) {
      if (there.has(id)) continue;
      companion.dispose();
      this.of.delete(id);
    }
    for (const info of infos) {
      const known = this.of.get(info.id);
      if (known) known.tell(info);
      else {
        const companion = new Companion(info);
        this.of.set(info.id, companion);
        this.root.add(companion.root);
      }
    }
    this.all = [...this.of.values()];
  }

  take({ visitors }: Presences): void {
    for (const { id, poses, points, laser } of visitors)
      this.of.get(id)?.take(floats(poses), floats(points), floats(laser));
  }

  /** Once per picture; whether anybody has moved. */
  tick(time: number): boolean {
    const since = time - this.at;
    this.at = time;
    let moved = false;
    const share = Number.isNaN(since) ? 1 : 1 - Math.exp(-since / FOLLOWS_MS);
    for (let k = 0; k < this.all.length; k += 1) moved = this.all[k]!.follow(share) || moved;
    return moved;
  }

  /** Head and hands of a visitor as they are drawn, in the world (z up); null for one who is not. */
  limbsOf(id: number): readonly Mesh[] | null {
    return this.of.get(id)?.limbs.map(({ object }) => object) ?? null;
  }
}

// MessagePack begins where it likes; floats begin at a fourth byte.
function floats(bytes: Uint8Array): Float32Array {
  return new Float32Array(bytes.slice().buffer);
}

function lines(n: number): BufferGeometry {
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(3 * n), 3));
}

function fill(drawn: Line | Points, numbers: Float32Array): void {
  const attribute = drawn.geometry.getAttribute("position") as BufferAttribute;
  drawn.visible = numbers.length > 0;
  attribute.array.set(numbers.subarray(0, attribute.array.length));
  attribute.needsUpdate = true;
  drawn.geometry.setDrawRange(0, numbers.length / 3);
}

function written(words: string, color: string): { texture: CanvasTexture; aspect: number } {
  const canvas = document.createElement("canvas");
  const brush = canvas.getContext("2d")!;
  brush.font = "bold 44px sans-serif";
  canvas.width = Math.ceil(brush.measureText(words).width) + 32;
  canvas.height = 64;
  brush.font = "bold 44px sans-serif";
  brush.fillStyle = "rgba(13, 19, 28, 0.85)";
  brush.fillRect(0, 0, canvas.width, canvas.height);
  brush.fillStyle = color;
  brush.fillText(words, 16, 47);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return { texture, aspect: canvas.width / canvas.height };
}
