// Handles on what is selected, to move and to turn it; the bodies go along until the server has said what it is.

import { effect } from "@preact/signals";
import { MathUtils, Matrix4, Object3D, Quaternion, Vector3 } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { holding } from "../company";
import { change, chosenEntry, draft, type Entry, mayEdit } from "../editing/draft";
import { gizmoMode, STEPS, steps } from "../editing/handles";
import { moveTo, placing } from "../editing/pose";
import { measuring } from "../view/measure";
import type { Bodies, Body } from "./bodies";
import type { Stage } from "./stage";

const ONE = new Vector3(1, 1, 1);

export class Gizmo {
  private readonly controls: TransformControls;
  /** Stands where the entry is, along the axes of the world (z up); turned only while it is turned. */
  private readonly handle = new Object3D();
  private entry: Entry | null = null;
  /** Frame that the file's place is given in, in the world. */
  private readonly frame = new Matrix4();
  private readonly start = new Matrix4();
  private carried: { body: Body; from: Matrix4 }[] = [];

  constructor(
    private readonly stage: Stage,
    private readonly bodies: Bodies,
    free: (yes: boolean) => void,
  ) {
    this.controls = new TransformControls(stage.camera, stage.renderer.domElement);
    // The handle has the world's axes: its own space is z up, that of three.js is y up.
    this.controls.setSpace("local");
    this.controls.setSize(0.8);
    stage.world.add(this.handle);
    stage.scene.add(this.controls.getHelper());
    this.controls.addEventListener("change", () => stage.invalidate());
    this.controls.addEventListener("objectChange", () => this.carry());
    this.controls.addEventListener("dragging-changed", ({ value }) => {
      free(value !== true);
      holding.value = value === true && this.entry ? [this.entry.name] : [];
      if (value === true) this.take();
      else void this.put();
    });
    effect(() => {
      this.controls.setMode(gizmoMode.value === "move" ? "translate" : "rotate");
      const [length, angle] = STEPS[steps.value];
      this.controls.setTranslationSnap(length || null);
      this.controls.setRotationSnap(angle ? MathUtils.degToRad(angle) : null);
      stage.invalidate();
    });
    effect(() => {
      // A new draft may have moved it.
      void draft.value;
      this.entry = mayEdit.value && !measuring.value ? chosenEntry.value : null;
      this.place();
    });
  }

  /** Whether the pointer is on a handle, or drags one. */
  get held(): boolean {
    return this.controls.dragging || this.controls.axis !== null;
  }

  /** Stand where the entry is; none that is on something whose place is not known here. */
  place(): void {
    if (this.controls.dragging) return;
    const { entry } = this;
    if (!entry || !this.frameOf(entry) || !isFixed(entry)) {
      this.controls.detach();
      this.stage.invalidate();
      return;
    }
    const { position } = placing(entry);
    this.handle.position.copy(position.applyMatrix4(this.frame));
    this.handle.quaternion.identity();
    this.handle.updateMatrixWorld();
    this.controls.attach(this.handle);
    this.stage.invalidate();
  }

  private frameOf({ table }: Entry): boolean {
    this.frame.identity();
    if (typeof table.on !== "string") return true;
    const carrier = this.bodies.byName.get(table.on);
    if (carrier) this.frame.copy(carrier.group.matrix);
    return carrier !== undefined;
  }

  private take(): void {
    this.handle.updateMatrix();
    this.start.copy(this.handle.matrix).invert();
    const name = this.entry?.name;
    this.carried = [...this.bodies.byName.values()]
      .filter(({ node }) => node.owner === name || node.mover === name)
      .map((body) => ({ body, from: body.group.matrix.clone() }));
  }

  private carry(): void {
    if (!this.controls.dragging) return;
    this.handle.updateMatrix();
    const by = this.handle.matrix.clone().multiply(this.start);
    for (const { body, from } of this.carried) {
      body.group.matrix.multiplyMatrices(by, from);
      body.group.matrixWorldNeedsUpdate = true;
    }
    this.stage.moved();
  }

  private async put(): Promise<void> {
    const { entry } = this;
    if (!entry) return;
    const before = placing(entry);
    const back = this.frame.clone().invert();
    const now = this.frame
      .clone()
      .multiply(new Matrix4().compose(before.position, before.rotation, ONE))
      .premultiply(this.handle.matrix.clone().multiply(this.start))
      .premultiply(back);
    const [position, rotation] = [new Vector3(), new Quaternion()];
    now.decompose(position, rotation, new Vector3());
    const turned = gizmoMode.peek() === "turn";
    const changes = turned ? moveTo(entry, null, rotation) : moveTo(entry, position, null);
    const done = await change(...changes);
    if (!done) {
      for (const { body, from } of this.carried) body.group.matrix.copy(from);
      for (const { body } of this.carried) body.group.matrixWorldNeedsUpdate = true;
      this.stage.moved();
      this.place();
    }
  }
}

// What is swept has no place of its own.
function isFixed({ table }: Entry): boolean {
  return table.swept === undefined;
}
