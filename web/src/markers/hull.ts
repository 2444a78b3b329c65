// A translucent closed surface given by its triangles.

import { BufferGeometry, Float32BufferAttribute, Vector3 } from "three";
import { featureEdges } from "../scene/feature_edges";
import type { Hull } from "../wire";
import type { Drawn } from "./drawn";
import { Surface } from "./surface";

export class HullDrawn implements Drawn<Hull> {
  private readonly surface = new Surface(new BufferGeometry(), new BufferGeometry());
  readonly object = this.surface.object;
  readonly anchor = new Vector3();
  private vertices: readonly number[] = [];
  private faces: readonly number[] = [];

  update(marker: Hull): void {
    const { vertices, faces, verdict } = marker;
    // Numbers of a marker change in place: it is compared with what was drawn.
    if (same(vertices, this.vertices) && same(faces, this.faces)) {
      this.surface.color(verdict);
      return;
    }
    const points = flat(vertices);
    const corners = flat(faces);
    this.vertices = points;
    this.faces = corners;
    const fill = new BufferGeometry();
    fill.setAttribute("position", new Float32BufferAttribute(points, 3));
    fill.setIndex(corners);
    fill.computeBoundingSphere();
    fill.computeVertexNormals();
    const { lines, smooth } = featureEdges(fill);
    this.surface.reshape(fill, lines, smooth);
    this.surface.color(verdict);
    if (fill.boundingSphere) this.anchor.copy(fill.boundingSphere.center);
  }

  dispose(): void {
    this.surface.free();
  }
}

const flat = (triples: readonly ArrayLike<number>[]): number[] =>
  triples.flatMap((triple) => Array.from(triple));

function same(triples: readonly ArrayLike<number>[], numbers: readonly number[]): boolean {
  if (3 * triples.length !== numbers.length) return false;
  for (let i = 0; i < triples.length; i += 1)
    for (let k = 0; k < 3; k += 1) if (triples[i]![k] !== numbers[3 * i + k]) return false;
  return true;
}
