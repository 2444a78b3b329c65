// Handles on what is selected, to move and to turn it; the bodies go along until the server has said what it is.

import { effect } from "@preact/signals";
import { MathUtils, Matrix4, Object3D } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { holding } from "../company";
import { chosenEntry, draft, type Entry, mayEdit } from "../editing/draft";
import { gizmoMode, STEPS, steps } from "../editing/handles";
import { placing } from "../editing/pose";
import { measuring } from "../view/measure";
import type { Bodies } from "./bodies";
import { Carried, frameOf } from "./carried";
import type { Stage } from "./stage";

export class Gizmo {
  /**
   * Made when something is edited first: its meshes come after all others by an infinite number, and from then on V8
   * has that number of every mesh as an object of its own.
   */
  private controls: TransformControls | null = null;
  /** Stands where the entry is, along the axes of the world (z up); turned only while it is turned. */
  private readonly handle = new Object3D();
  private entry: Entry | null = null;
  /** Frame that the file's place is given in, in the world. */
  private readonly frame = new Matrix4();
  private readonly start = new Matrix4();
  private carried: Carried | null = null;

  constructor(
    private readonly stage: Stage,
    private readonly bodies: Bodies,
    private readonly free: (yes: boolean) => void,
  ) {
    stage.world.add(this.handle);
    effect(() => {
      void [gizmoMode.value, steps.value];
      if (this.controls) this.choose(this.controls);
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
    return this.controls !== null && (this.controls.dragging || this.controls.axis !== null);
  }

  private make(): TransformControls {
    const { stage } = this;
    const controls = new TransformControls(stage.camera, stage.renderer.domElement);
    // The handle has the world's axes: its own space is z up, that of three.js is y up.
    controls.setSpace("local");
    controls.setSize(0.8);
    controls.addEventListener("change", () => stage.invalidate());
    controls.addEventListener("objectChange", () => this.carry());
    controls.addEventListener("dragging-changed", ({ value }) => {
      this.free(value !== true);
      holding.value = value === true && this.entry ? [this.entry.name] : [];
      if (value === true) this.take();
      else void this.put();
    });
    this.choose(controls);
    return controls;
  }

  /** Have handles do what is chosen, in the steps that are. */
  private choose(controls: TransformControls): void {
    controls.setMode(gizmoMode.peek() === "move" ? "translate" : "rotate");
    const [length, angle] = STEPS[steps.peek()];
    controls.setTranslationSnap(length || null);
    controls.setRotationSnap(angle ? MathUtils.degToRad(angle) : null);
  }

  /** Stand where the entry is; none that is on something whose place is not known here. */
  place(): void {
    if (this.controls?.dragging) return;
    const { entry } = this;
    if (!entry || !frameOf(entry, this.bodies, this.frame)) {
      this.controls?.detach();
      // Hidden handles, too, are turned to the eye in each picture.
      this.controls?.getHelper().removeFromParent();
      this.stage.invalidate();
      return;
    }
    this.controls ??= this.make();
    const { position } = placing(entry);
    this.handle.position.copy(position.applyMatrix4(this.frame));
    this.handle.quaternion.identity();
    this.handle.updateMatrixWorld();
    this.controls.attach(this.handle);
    this.stage.scene.add(this.controls.getHelper());
    this.stage.invalidate();
  }

  private take(): void {
    this.handle.updateMatrix();
    this.start.copy(this.handle.matrix).invert();
    this.carried = this.entry && Carried.of(this.entry, this.bodies, () => this.stage.moved());
  }

  private carry(): void {
    if (!this.controls?.dragging || !this.carried) return;
    this.handle.updateMatrix();
    this.carried.motion.multiplyMatrices(this.handle.matrix, this.start);
    this.carried.show();
  }

  private async put(): Promise<void> {
    const { carried } = this;
    if (carried && !(await carried.put(gizmoMode.peek() === "turn"))) this.place();
  }
}
