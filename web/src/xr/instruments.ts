// What a visitor holds up to the twin: a ruler between two surfaces, a section plane, a ghost of another time.

import {
  BufferGeometry,
  CanvasTexture,
  Group,
  Line,
  LineBasicMaterial,
  type Material,
  Mesh,
  MeshBasicMaterial,
  type Object3D,
  Plane,
  type Raycaster,
  RingGeometry,
  Sprite,
  SpriteMaterial,
  Vector3,
} from "three";
import type { Bodies } from "../scene/bodies";
import type { Stage } from "../scene/stage";

/** Letters of the ruler are 16 mm high. */
const TEXT = { width: 0.22, height: 0.05, pixels: 512 };
const GHOST = 0x8fb7ff;

/** A line between two points that a beam met on surfaces as they are drawn, with its length. */
export class Ruler {
  readonly root = new Group();
  private readonly line = new Line(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3()]),
    new LineBasicMaterial({ color: 0xfbe36a, depthTest: false }),
  );
  private readonly texture: CanvasTexture;
  private readonly words: Sprite;
  private readonly brush: CanvasRenderingContext2D;
  private points: Vector3[] = [];
  /** Length [m]; null before there are two points. */
  length: number | null = null;

  constructor() {
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: TEXT.pixels, height: (TEXT.pixels * TEXT.height) / TEXT.width });
    this.brush = canvas.getContext("2d")!;
    this.texture = new CanvasTexture(canvas);
    this.words = new Sprite(new SpriteMaterial({ map: this.texture, depthTest: false }));
    this.words.scale.set(TEXT.width, TEXT.height, 1);
    this.line.frustumCulled = false;
    this.root.add(this.line, this.words);
    this.root.visible = false;
  }

  /** Take the point where a beam meets a surface; the third begins anew. Whether it met one. */
  take(ray: Raycaster, bodies: Bodies): boolean {
    const hit = ray.intersectObject(bodies.root, true).find(({ object }) => object instanceof Mesh);
    if (!hit) return false;
    if (this.points.length === 2) this.points = [];
    this.points.push(hit.point.clone());
    const [a, b] = [this.points[0]!, this.points.at(-1)!];
    this.length = this.points.length === 2 ? a.distanceTo(b) : null;
    this.line.geometry.setFromPoints([a, b]);
    this.words.position.copy(a).lerp(b, 0.5);
    this.words.position.y += 0.04;
    const { canvas } = this.brush;
    this.brush.clearRect(0, 0, canvas.width, canvas.height);
    this.brush.font = "bold 84px sans-serif";
    this.brush.textAlign = "center";
    this.brush.fillStyle = "#fbe36a";
    const said = this.length === null ? "to …" : `${(1000 * this.length).toFixed(0)} mm`;
    this.brush.fillText(said, canvas.width / 2, 92);
    this.texture.needsUpdate = true;
    this.root.visible = true;
    return true;
  }

  clear(): void {
    this.points = [];
    this.length = null;
    this.root.visible = false;
  }

  dispose(): void {
    this.texture.dispose();
    this.words.material.dispose();
    this.line.geometry.dispose();
    this.line.material.dispose();
  }
}

/** Leaves out what is on this side of a plane that a hand was held in. */
export class Section {
  private readonly plane = new Plane();
  on = false;

  constructor(private readonly stage: Stage) {}

  /** Cut at a point, leaving what lies ahead; or cut nothing any more. */
  turnOver(at: Vector3, along: Vector3): void {
    this.on = !this.on;
    this.plane.setFromNormalAndCoplanarPoint(along, at);
    this.stage.renderer.clippingPlanes = this.on ? [this.plane] : [];
  }

  clear(): void {
    this.on = false;
    this.stage.renderer.clippingPlanes = [];
  }
}

/** Everybody as they are shown now, to stay while time goes elsewhere: the past beside the present. */
export class Ghost {
  private shown: Object3D | null = null;
  private readonly material = new MeshBasicMaterial({
    color: GHOST,
    transparent: true,
    opacity: 0.28,
    depthWrite: false,
  });

  constructor(
    private readonly stage: Stage,
    private readonly bodies: Bodies,
  ) {}

  get on(): boolean {
    return this.shown !== null;
  }

  turnOver(): void {
    if (this.shown) {
      this.clear();
      return;
    }
    const moving = new Group();
    for (const body of this.bodies.byName.values()) {
      if (!body.node.moves || !body.group.visible) continue;
      body.group.updateWorldMatrix(true, true);
      body.group.traverseVisible((part) => {
        if (!(part instanceof Mesh)) return;
        const copy = new Mesh(part.geometry, this.material);
        copy.matrixAutoUpdate = false;
        copy.matrix.copy(part.matrixWorld);
        moving.add(copy);
      });
    }
    this.stage.scene.add(moving);
    this.shown = moving;
  }

  clear(): void {
    // Geometry is that of the bodies themselves.
    if (this.shown) this.stage.scene.remove(this.shown);
    this.shown = null;
  }

  dispose(): void {
    this.clear();
    this.material.dispose();
  }
}

/** Narrows sight while one turns or goes. */
export class Vignette {
  readonly mesh = new Mesh(
    new RingGeometry(0.09, 0.6, 48),
    new MeshBasicMaterial({ color: 0x05070a, transparent: true, opacity: 0, depthTest: false, fog: false }),
  );
  private strength = 0;

  constructor() {
    this.mesh.renderOrder = 1000;
    this.mesh.visible = false;
  }

  /** @param moves Whether one turns or goes now. */
  update(moves: boolean, seconds: number): void {
    this.strength = moves ? 1 : Math.max(0, this.strength - 3 * seconds);
    this.mesh.visible = this.strength > 0;
    this.mesh.material.opacity = 0.9 * this.strength;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    (this.mesh.material as Material).dispose();
  }
}
