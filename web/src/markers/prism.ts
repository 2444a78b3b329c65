// A translucent extruded polygon, convex or not, with its edges.

import { BufferGeometry, Float32BufferAttribute, ShapeUtils, Vector2, Vector3 } from "three";
import type { Prism } from "../wire";
import type { Drawn } from "./drawn";
import { Surface } from "./surface";

export class PrismDrawn implements Drawn<Prism> {
  private readonly surface = new Surface(new BufferGeometry(), new BufferGeometry());
  readonly object = this.surface.object;
  readonly anchor = new Vector3();
  private shape = "";
  private readonly top = new Vector3();

  update(marker: Prism): void {
    const [w, x, y, z] = marker.wxyz;
    this.object.position.fromArray(marker.position);
    this.object.quaternion.set(x, y, z, w);
    this.surface.color(marker.verdict);
    const shape = JSON.stringify([marker.outline, marker.lower, marker.upper]);
    if (shape !== this.shape) {
      this.shape = shape;
      this.reshape(marker);
    }
    this.anchor.copy(this.top).applyQuaternion(this.object.quaternion).add(this.object.position);
  }

  dispose(): void {
    this.surface.free();
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
