// A translucent extruded polygon, convex or not, with its edges.

import { BufferGeometry, Float32BufferAttribute, ShapeUtils, Vector2, Vector3 } from "three";
import type { Prism } from "../wire";
import type { Drawn } from "./drawn";
import { Surface, turn } from "./surface";

export class PrismDrawn implements Drawn<Prism> {
  private readonly surface = new Surface(new BufferGeometry(), new BufferGeometry());
  readonly object = this.surface.object;
  readonly anchor = new Vector3();
  /** Outline, lower and upper edge of what is drawn. */
  private shape = new Float64Array();
  private readonly top = new Vector3();

  update(marker: Prism): void {
    this.object.position.fromArray(marker.position);
    turn(this.object.quaternion, marker.wxyz);
    this.surface.color(marker.verdict);
    if (this.changed(marker)) this.reshape(marker);
    this.anchor.copy(this.top).applyQuaternion(this.object.quaternion).add(this.object.position);
  }

  dispose(): void {
    this.surface.free();
  }

  // Numbers of a marker change in place: it is compared with what is drawn.
  private changed({ outline, lower, upper }: Prism): boolean {
    const count = 2 * outline.length + 2;
    let changed = this.shape.length !== count;
    if (changed) this.shape = new Float64Array(count);
    const { shape } = this;
    for (let k = 0; k < count; k += 1) {
      const next = k < count - 2 ? outline[k >> 1]![k % 2]! : k === count - 2 ? lower : upper;
      if (shape[k] !== next) changed = true;
      shape[k] = next;
    }
    return changed;
  }

  private reshape({ outline, lower, upper }: Prism): void {
    const n = outline.length;
    const heights = [lower, upper];
    const points = heights.flatMap((z) => outline.flatMap(([px, py]) => [px, py, z]));
    const faces = caps(outline).flatMap(([a, b, c]) => [c, b, a, a + n, b + n, c + n]);
    const edges: number[] = [];
    for (let a = 0; a < n; a += 1) {
      const b = (a + 1) % n;
      faces.push(a, b, b + n, a, b + n, a + n);
      edges.push(a, b, a + n, b + n, a, a + n);
    }
    const position = new Float32BufferAttribute(points, 3);
    const fill = new BufferGeometry().setAttribute("position", position).setIndex(faces);
    this.surface.reshape(fill, new BufferGeometry().setAttribute("position", position).setIndex(edges));
    const middle = outline.reduce(([sx, sy], [px, py]) => [sx + px / n, sy + py / n], [0, 0] as const);
    this.top.set(middle[0], middle[1], upper);
  }
}

function caps(outline: readonly (readonly [number, number])[]): [number, number, number][] {
  if (outline.length < 3) return [];
  return ShapeUtils.triangulateShape(
    outline.map(([x, y]) => new Vector2(x, y)),
    [],
  ) as [number, number, number][];
}
