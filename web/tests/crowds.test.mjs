// Bodies of one shape are drawn in one call where they are, and one that stands out by itself.

import assert from "node:assert/strict";
import { test } from "node:test";
import { BoxGeometry, Group, Matrix4, Mesh, MeshStandardMaterial, Vector3 } from "three";
import { load } from "./source.mjs";

globalThis.location = { search: "?draw=full" };
const { ALONE_LAYER, crowdsOf } = await load("scene/crowds");

const shape = new BoxGeometry(1, 2, 3);
const given = new MeshStandardMaterial();
const local = new Matrix4().makeTranslation(0, 0, 0.5);

function body(x, geometry = shape) {
  const mesh = new Mesh(geometry, given.clone());
  const group = new Group();
  group.matrix.makeTranslation(x, 0, 0);
  const meshes = [{ mesh, own: mesh.material, given, local }];
  return { group, meshes, plain: true, followers: [] };
}

test("equal shapes are one call, each where its body is; who is told follows", () => {
  const bodies = [0, 1, 2, 3].map((x) => body(x));
  const crowds = crowdsOf([...bodies, body(9, new BoxGeometry())]);
  assert.equal(crowds.length, 1);
  const { drawn } = crowds[0];
  assert.equal(drawn.count, 4);
  const place = new Matrix4();
  const at = (k) => {
    drawn.getMatrixAt(k, place);
    return new Vector3(0, 0, 0).applyMatrix4(place).toArray();
  };
  assert.deepEqual(at(2), [2, 0, 0.5]);
  bodies[2].group.matrix.makeTranslation(7, 8, 9);
  for (const follow of bodies[2].followers) follow();
  assert.deepEqual(at(2), [7, 8, 9.5]);
  assert.ok(bodies.every(({ meshes }) => meshes[0].mesh.layers.mask === 1 << ALONE_LAYER));
  // One that stands out, or is hidden, is no part of it.
  bodies[1].plain = false;
  bodies[3].group.visible = false;
  for (const { followers } of bodies) for (const follow of followers) follow();
  for (const k of [1, 3]) {
    drawn.getMatrixAt(k, place);
    assert.equal(place.determinant(), 0);
    assert.equal(bodies[k].meshes[0].mesh.layers.mask, 1);
  }
});

test("few of a shape, and what one sees through, are drawn one by one", () => {
  assert.equal(crowdsOf([0, 1, 2].map((x) => body(x))).length, 0);
  const clear = [0, 1, 2, 3].map((x) => body(x));
  for (const { meshes } of clear) meshes[0].given = new MeshStandardMaterial({ transparent: true });
  assert.equal(crowdsOf(clear).length, 0);
});
