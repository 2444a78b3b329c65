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
  private drawn: Hull | null = null;

  update(marker: Hull): void {
    if (this.drawn && sameShape(this.drawn, marker)) {
      this.surface.color(marker.verdict);
      return;
    }
    this.drawn = marker;
    const fill = new BufferGeometry();
    fill.setAttribute("position", new Float32BufferAttribute(marker.vertices.flat(), 3));
    fill.setIndex(marker.faces.flat());
    fill.computeBoundingSphere();
    fill.computeVertexNormals();
    const { lines, smooth } = featureEdges(fill);
    this.surface.reshape(fill, lines, smooth);
    this.surface.color(marker.verdict);
    if (fill.boundingSphere) this.anchor.copy(fill.boundingSphere.center);
  }

  dispose(): void {
    this.surface.free();
  }
}

function sameShape(a: Hull, b: Hull): boolean {
  return (
    a.vertices.length === b.vertices.length &&
    a.faces.length === b.faces.length &&
    a.vertices.every((v, i) => v.every((x, k) => x === b.vertices[i]![k])) &&
    a.faces.every((f, i) => f.every((x, k) => x === b.faces[i]![k]))
  );
}
