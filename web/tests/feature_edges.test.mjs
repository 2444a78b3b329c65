// Which edges of a surface are drawn: those of facets, never the net of a round one; and which volumes are
// drawn by edges alone.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Box3, BoxGeometry, CylinderGeometry, IcosahedronGeometry, SphereGeometry, Vector3 } from "three";
import { ConvexGeometry } from "three/addons/geometries/ConvexGeometry.js";
import { load } from "./source.mjs";

const { featureEdges, turnOutward } = await load("scene/feature_edges");
const { hides } = await load("scene/volumes");
const edges = (surface) => (featureEdges(surface).lines.getAttribute("position")?.count ?? 0) / 2;

/** Sums of some of these vectors: a force polytope is such a zonotope. */
function zonotope(vectors) {
  const sums = vectors.reduce((all, v) => all.flatMap((s) => [s, s.clone().add(v)]), [new Vector3()]);
  return new ConvexGeometry(sums);
}

test("a box has twelve edges, however finely it is cut", () => {
  assert.equal(edges(new BoxGeometry(1, 2, 3)), 12);
  assert.equal(edges(new BoxGeometry(1, 1, 1, 2, 2, 2)), 24);
});

test("a polytope of three and of four joints has the edges of its facets", () => {
  const axes = [new Vector3(1, 0, 0), new Vector3(0, 1, 0), new Vector3(0, 0, 1), new Vector3(1, 1, 1)];
  assert.equal(edges(zonotope(axes.slice(0, 3))), 12);
  // The rhombic dodecahedron.
  assert.equal(edges(zonotope(axes)), 24);
});

test("what is round is drawn by its rim, without a net of edges", () => {
  const stretched = new SphereGeometry(1, 14, 9).scale(1, 2, 0.5);
  const bumpy = new IcosahedronGeometry(1, 9);
  const at = bumpy.getAttribute("position");
  const place = new Vector3();
  for (let i = 0; i < at.count; i += 1) {
    place.fromBufferAttribute(at, i);
    // The same bump at the same place: triangles share their corners.
    place.multiplyScalar(1 + 0.01 * Math.sin(37 * place.x + 91 * place.y + 53 * place.z));
    at.setXYZ(i, place.x, place.y, place.z);
  }
  for (const surface of [new IcosahedronGeometry(1, 1), stretched, bumpy]) {
    assert.deepEqual([edges(surface), featureEdges(surface).smooth], [0, true]);
  }
});

test("a closed surface is turned outward, with its normals", () => {
  const inward = new SphereGeometry(1, 12, 8).scale(1, 1, -1);
  turnOutward(inward);
  const [at, index, normal] = [
    inward.getAttribute("position"),
    inward.getIndex(),
    inward.getAttribute("normal"),
  ];
  for (let k = 0; k < index.count; k += 3) {
    const [a, b, c] = [0, 1, 2].map((i) => new Vector3().fromBufferAttribute(at, index.getX(k + i)));
    const across = b.clone().sub(a).cross(c.clone().sub(a));
    assert.ok(across.dot(a.add(b).add(c)) > -1e-9);
  }
  const outward = new SphereGeometry(1, 12, 8);
  const before = [...outward.getIndex().array];
  turnOutward(outward);
  assert.deepEqual([...outward.getIndex().array], before);
  assert.equal(normal.count, at.count);
});

test("a barrel keeps its two rims", () => {
  assert.equal(edges(new CylinderGeometry(1, 1, 1, 48)), 96);
});

test("a volume hides what is inside when the eye is within it, or when it is one of too many in a row", () => {
  const box = (x, y = 0) => new Box3(new Vector3(x, y - 0.5, -0.5), new Vector3(x + 1, y + 0.5, 0.5));
  const eye = new Vector3(-5, 0, 0);
  const hiding = (boxes, from) => boxes.map((_, k) => hides(boxes, k, from));
  assert.deepEqual(hiding([box(0)], eye), [false]);
  assert.deepEqual(hiding([box(-5.5), box(0)], eye), [true, false]);
  assert.deepEqual(hiding([box(0), box(2), box(4)], eye), [false, false, false]);
  assert.ok(hiding([box(0), box(2), box(4), box(6)], eye).every((one) => one));
  // Beside each other as many as one likes.
  assert.ok(hiding([box(0), box(0, 2), box(0, 4), box(0, 6), box(0, 8)], eye).every((one) => !one));
});
