// Where one looks from: orbit by mouse, and the places one goes to with a button.

import { Box3, type Object3D, Quaternion, Vector3 } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { SavedView } from "../view/kept";
import type { Bodies } from "./bodies";
import type { Stage } from "./stage";

export type Preset = "corner" | "front" | "side" | "top" | "operator";

// Directions from the scene's middle to the eye, y up.
const DIRECTIONS: Record<Exclude<Preset, "operator">, Vector3> = {
  corner: new Vector3(0.95, 0.62, 0.95).normalize(),
  front: new Vector3(1, 0.12, 0).normalize(),
  side: new Vector3(0, 0.12, 1).normalize(),
  top: new Vector3(0.0001, 1, 0).normalize(),
};

export class Viewpoint {
  readonly controls: OrbitControls;
  private readonly box = new Box3();
  private readonly center = new Vector3();
  private readonly size = new Vector3();
  private readonly turn = new Quaternion();

  constructor(
    private readonly stage: Stage,
    private readonly bodies: Bodies,
  ) {
    this.controls = new OrbitControls(stage.camera, stage.renderer.domElement);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.dampingFactor = 0.15;
    this.controls.maxDistance = 40;
    this.controls.minDistance = 0.1;
    this.controls.addEventListener("change", () => stage.invalidate());
    stage.camera.position.set(2.8, 2.2, 2.8);
    this.controls.target.set(0, 0.8, 0);
  }

  update(): void {
    this.controls.update();
  }

  /** Name of the node that the operator's eyes are in, if there is a person with a head. */
  get eyes(): string | null {
    for (const { node } of this.bodies.byName.values()) {
      if (node.role === "human" && /(^|[/_])head$/i.test(node.name)) return node.name;
    }
    return null;
  }

  /** Where one looks from and at, to `stand` there again. */
  where(): Omit<SavedView, "name"> {
    return { position: this.stage.camera.position.toArray(), target: this.controls.target.toArray() };
  }

  stand({ position, target }: Omit<SavedView, "name">): void {
    this.stage.camera.position.fromArray(position);
    this.controls.target.fromArray(target);
    this.controls.update();
    this.stage.invalidate();
  }

  go(preset: Preset): void {
    if (preset === "operator") {
      this.lookFromEyes();
      return;
    }
    this.frame(null, DIRECTIONS[preset]);
  }

  /** Fill the view with these nodes (all that is shown when null), from where one looks now or from `direction`. */
  frame(names: ReadonlySet<string> | null, direction: Vector3 | null = null): void {
    this.box.makeEmpty();
    for (const { group, node } of this.bodies.byName.values()) {
      if (names ? names.has(node.name) : group.visible) this.box.union(worldBox(group));
    }
    if (this.box.isEmpty()) return;
    this.box.getCenter(this.center);
    const radius = Math.max(this.box.getSize(this.size).length() / 2, 0.12);
    const { camera } = this.stage;
    const away = direction?.clone() ?? camera.position.clone().sub(this.controls.target).normalize();
    const half = (camera.fov * Math.PI) / 360;
    const distance = radius / Math.sin(Math.min(half, Math.atan(Math.tan(half) * camera.aspect)));
    this.controls.target.copy(this.center);
    camera.position.copy(this.center).addScaledVector(away, distance);
    this.controls.update();
    this.stage.invalidate();
  }

  /** Look from where somebody's head is, ahead (its -z); what they see beside themselves is theirs. */
  lookWith(head: Object3D): void {
    const { camera } = this.stage;
    head.updateWorldMatrix(true, false);
    head.getWorldPosition(camera.position);
    this.size.set(0, 0, -1).applyQuaternion(head.getWorldQuaternion(this.turn));
    // From before the head, which would be in the picture.
    camera.position.addScaledVector(this.size, 0.2 * head.scale.x);
    this.controls.target.copy(camera.position).addScaledVector(this.size, 1);
  }

  private lookFromEyes(): void {
    const head = this.eyes && this.bodies.byName.get(this.eyes)?.group;
    if (!head) return;
    head.updateWorldMatrix(true, false);
    const eye = head.getWorldPosition(this.center).clone();
    eye.y += 0.08;
    // Toward what the person works at: the middle of everything that is not a person.
    this.box.makeEmpty();
    for (const { group, node } of this.bodies.byName.values()) {
      if (node.role !== "human") this.box.union(worldBox(group));
    }
    const target = this.box.isEmpty()
      ? eye.clone().add(new Vector3(0, 0, -1))
      : this.box.getCenter(this.size);
    const reach = target.clone().sub(eye).setLength(0.12);
    this.stage.camera.position.copy(eye).add(reach);
    this.controls.target.copy(target);
    this.controls.update();
    this.stage.invalidate();
  }
}

const scratch = new Box3();

function worldBox(object: Object3D): Box3 {
  object.updateWorldMatrix(true, true);
  return scratch.setFromObject(object);
}
