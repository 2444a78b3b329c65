// What is selected: corner brackets around each body's own box.

import { type Box3, BufferGeometry, Float32BufferAttribute, LineSegments, type Object3D } from "three";
import type { Bodies } from "./bodies";
import { markLine } from "./materials";

/** Length of a bracket's arm as a share of the edge. */
const ARM = 0.22;

export class Outline {
  private drawn: LineSegments[] = [];

  constructor(private readonly bodies: Bodies) {}

  show(names: ReadonlySet<string>): void {
    for (const lines of this.drawn) {
      lines.removeFromParent();
      lines.geometry.dispose();
    }
    this.drawn = [];
    for (const name of names) {
      const body = this.bodies.byName.get(name);
      if (!body || body.extent.isEmpty()) continue;
      const lines = new LineSegments(brackets(body.extent), markLine(true));
      lines.renderOrder = 5;
      lines.raycast = () => {};
      (body.group as Object3D).add(lines);
      this.drawn.push(lines);
    }
  }
}

function brackets(box: Box3): BufferGeometry {
  const points: number[] = [];
  const low = box.min.toArray();
  const high = box.max.toArray();
  for (let corner = 0; corner < 8; corner += 1) {
    const at = [0, 1, 2].map((axis) => (corner & (1 << axis) ? high[axis]! : low[axis]!));
    for (let axis = 0; axis < 3; axis += 1) {
      const end = [...at];
      const inward = (high[axis]! - low[axis]!) * ARM;
      end[axis] = at[axis]! + (corner & (1 << axis) ? -inward : inward);
      points.push(...at, ...end);
    }
  }
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
}
