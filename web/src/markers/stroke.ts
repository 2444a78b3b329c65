// A straight line with a width in pixels, seen faintly through what hides it.

import { CylinderGeometry, Group, Mesh, Quaternion, Vector3 } from "three";
import { markerMaterial } from "../scene/materials";
import type { Vec3, Verdict } from "../wire";
import type { View } from "./view";

const SHAFT = new CylinderGeometry(1, 1, 1, 8, 1, true);
const UP = new Vector3(0, 1, 0);
const along = new Vector3();
const eye = new Vector3();
const turn = new Quaternion();

export class Stroke {
  readonly object = new Group();
  readonly start = new Vector3();
  readonly end = new Vector3();
  private readonly solid = new Mesh(SHAFT);
  private readonly ghost = new Mesh(SHAFT);
  private length = 0;

  constructor(private readonly widthPx: number) {
    this.ghost.renderOrder = 3;
    this.object.add(this.solid, this.ghost);
  }

  update(start: Vec3 | Vector3, end: Vec3 | Vector3, verdict: Verdict | null): void {
    copy(this.start, start);
    copy(this.end, end);
    along.subVectors(this.end, this.start);
    this.length = along.length();
    this.object.visible = this.length > 1e-9;
    this.object.position.addVectors(this.start, this.end).multiplyScalar(0.5);
    if (this.object.visible)
      this.object.quaternion.copy(turn.setFromUnitVectors(UP, along.divideScalar(this.length)));
    this.solid.material = markerMaterial("line", verdict);
    this.ghost.material = markerMaterial("ghost", verdict);
  }

  face(view: View): void {
    const radius = (this.widthPx / 2) * pixelAt(this.object, view);
    this.object.scale.set(radius, this.length, radius);
  }
}

/** World size of a pixel where an object is [m]. */
export function pixelAt(object: Group | Mesh, view: View): number {
  object.getWorldPosition(eye);
  return view.pixel * Math.max(eye.distanceTo(view.camera.position), 0.05);
}

function copy(to: Vector3, from: Vec3 | Vector3): void {
  if (from instanceof Vector3) to.copy(from);
  else to.fromArray(from);
}
