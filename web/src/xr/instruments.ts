// What a visitor holds up to the twin: a ruler between two surfaces, a section plane, a ghost of another time.

import {
  BufferGeometry,
  CanvasTexture,
  Color,
  Group,
  Line,
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
import { select } from "../page_state";
import { distance } from "../panels/MeasureNote";
import type { Bodies } from "../scene/bodies";
import { colorOf, markLine, markMaterial, uncut } from "../scene/materials";
import { hitAlong, nodeOf } from "../scene/picking";
import type { Stage } from "../scene/stage";
import type { Viewer } from "../scene/viewer";
import { type Measuring, measuring, withFace } from "../view/measure";
import { sectionPlanes } from "../view/section";
import { said, told } from "../words";

/** Letters of the ruler are 16 mm high. */
const TEXT = { width: 0.22, height: 0.05, pixels: 512 };

/**
 * How far two things are from one another: the least distance of their surfaces as the engine has it, by what
 * measures on the desk; where this page may not measure, of two points on meshes as they are drawn.
 */
export class Ruler {
  readonly root = new Group();
  private readonly line = new Line(
    new BufferGeometry().setFromPoints([new Vector3(), new Vector3()]),
    markLine(true),
  );
  private readonly texture: CanvasTexture;
  private readonly words: Sprite;
  private readonly brush: CanvasRenderingContext2D;
  private points: Vector3[] = [];
  private told: Measuring | null = null;
  /** What stands beside it now. */
  text = "";

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
    const hit = hitAlong(ray, bodies);
    if (!hit) return false;
    if (this.points.length === 2) this.points = [];
    this.points.push(hit.point.clone());
    const [a, b] = [this.points[0]!, this.points.at(-1)!];
    this.line.geometry.setFromPoints([a, b]);
    this.line.visible = true;
    this.words.position.copy(a).lerp(b, 0.5);
    const far =
      this.points.length === 2
        ? said("{far} mm as drawn", { far: (1000 * a.distanceTo(b)).toFixed(0) })
        : said("to …");
    this.write(far);
    return true;
  }

  /** Pick the body that a beam meets, for the engine to measure; whether it met one. */
  ask(ray: Raycaster, viewer: Viewer): boolean {
    const hit = hitAlong(ray, viewer.bodies);
    const name = hit && nodeOf(hit.object);
    if (!hit || !name) return false;
    this.words.position.copy(hit.point);
    this.line.visible = false; // the engine says between which points
    const face = hit.face?.normal.clone().transformDirection(hit.object.matrixWorld);
    withFace(face ? viewer.inBody(name, [face.x, face.y, face.z]) : null, () =>
      select({ kind: "node", name }),
    );
    this.tell();
    return true;
  }

  /** Write what the engine said, where that is news. */
  tell(): void {
    const now = measuring.peek();
    if (now === this.told) return;
    this.told = now;
    const [a, b] = now?.picks ?? [];
    if (!now || !a) return;
    const value = now.result?.value;
    if (!b) this.write(said("to …"));
    else if (now.refusal !== "" || (now.result && value == null))
      this.write(told(now.refusal || now.result!.reason));
    else this.write(value == null ? said("measuring …") : distance(value));
  }

  private write(text: string): void {
    this.text = text;
    const { canvas } = this.brush;
    this.brush.clearRect(0, 0, canvas.width, canvas.height);
    this.brush.font = "bold 72px sans-serif";
    this.brush.textAlign = "center";
    this.brush.fillStyle = new Color(colorOf("mark")).getStyle();
    this.brush.fillText(text, canvas.width / 2, 92, canvas.width);
    this.texture.needsUpdate = true;
    this.root.visible = true;
  }

  clear(): void {
    this.points = [];
    this.told = null;
    this.text = "";
    this.root.visible = false;
  }

  dispose(): void {
    this.texture.dispose();
    this.words.material.dispose();
    this.line.geometry.dispose();
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
    this.stage.renderer.clippingPlanes = this.on ? [...sectionPlanes(), this.plane] : sectionPlanes();
  }

  clear(): void {
    this.on = false;
    this.stage.renderer.clippingPlanes = sectionPlanes();
  }
}

/** Everybody as they are shown now, to stay while time goes elsewhere: the past beside the present. */
export class Ghost {
  private shown: Object3D | null = null;
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
        const copy = new Mesh(part.geometry, markMaterial("ghost"));
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
}

/** Narrows sight while one turns or goes. */
export class Vignette {
  readonly mesh = new Mesh(
    new RingGeometry(0.09, 0.6, 48),
    uncut(
      new MeshBasicMaterial({ color: 0x05070a, transparent: true, opacity: 0, depthTest: false, fog: false }),
    ),
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
