// A click (not a drag) on a body selects it.

import { type Intersection, type Object3D, type Plane, Raycaster, Vector2, type Vector3 } from "three";
import type { Bodies } from "./bodies";
import { ALONE_LAYER } from "./crowds";
import type { Stage } from "./stage";

/** A pointer that moved less than this between press and release clicked [px]. */
const STILL_PX = 4;

/** @param taken Whether something else has the pointer, such as the handles of what is moved. */
export function pickOnClick(
  stage: Stage,
  bodies: Bodies,
  picked: (name: string | null, normal: [number, number, number] | null, point: Vector3 | null) => void,
  taken: () => boolean,
): void {
  const canvas = stage.renderer.domElement;
  const ray = new Raycaster();
  const at = new Vector2();
  const pressed = new Vector2();
  canvas.addEventListener("pointerdown", (event) => pressed.set(event.clientX, event.clientY));
  canvas.addEventListener("pointerup", (event) => {
    if (taken() || event.button !== 0 || pressed.distanceTo(at.set(event.clientX, event.clientY)) > STILL_PX)
      return;
    const box = canvas.getBoundingClientRect();
    at.set(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    ray.setFromCamera(at, stage.camera);
    const planes = stage.renderer.clippingPlanes;
    const hit = hitAlong(ray, bodies, planes);
    const normal = hit?.face?.normal.clone().transformDirection(hit.object.matrixWorld);
    picked(
      hit ? nodeOf(hit.object) : null,
      normal ? [normal.x, normal.y, normal.z] : null,
      hit?.point ?? null,
    );
  });
}

/** Name of the node that a ray of the world meets first; null for none. */
export function nodeAlong(ray: Raycaster, bodies: Bodies): string | null {
  return nodeOf(hitAlong(ray, bodies)?.object ?? null);
}

/** What a ray of the world meets first; what a section takes away is not met. */
export function hitAlong(
  ray: Raycaster,
  bodies: Bodies,
  planes: readonly Plane[] = [],
): Intersection | undefined {
  ray.layers.enable(ALONE_LAYER);
  return ray
    .intersectObject(bodies.root, true)
    .find(
      ({ object, point }) =>
        nodeOf(object) !== null && planes.every((plane) => plane.distanceToPoint(point) >= 0),
    );
}

/** Name of the node that something drawn is of; null for none, and for what is hidden: rays meet that, too. */
export function nodeOf(object: Object3D | null): string | null {
  for (let at = object; at; at = at.parent) {
    if (!at.visible) return null;
    if (typeof at.userData.node === "string") return at.userData.node;
  }
  return null;
}
