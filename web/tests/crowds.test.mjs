// Bodies of one shape are drawn in one call where they are, and one that stands out by itself.

import assert from "node:assert/strict";
import { test } from "node:test";
import {
  BoxGeometry,
  Frustum,
  Group,
  Matrix4,
  Mesh,
  MeshStandardMaterial,
  PerspectiveCamera,
  SphereGeometry,
  Vector3,
} from "three";
import { built, load } from "./source.mjs";

globalThis.location = { search: "?draw=full" };
const { ALONE_LAYER, crowdsOf } = await load("scene/crowds");
const { coarsening } = await load("scene/coarser");
// One who draws by the processor.
globalThis.location = { search: "?draw=light" };
const light = await import(`${await built("scene/crowds")}?light`);
light.crowdsOf([]);
const { Levels } = await import(`${await built("scene/levels")}?light`);

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
  const [crowd] = crowds;
  const [{ drawn }] = crowd.levels;
  assert.deepEqual([crowd.levels.length, drawn.count], [1, 4]);
  const place = new Matrix4();
  const at = (k) => {
    drawn.getMatrixAt(k, place);
    return new Vector3(0, 0, 0).applyMatrix4(place).toArray();
  };
  assert.deepEqual(at(2), [2, 0, 0.5]);
  bodies[2].group.matrix.makeTranslation(7, 8, 9);
  for (const follow of bodies[2].followers) follow();
  crowd.arrange(null, false);
  assert.deepEqual(at(2), [7, 8, 9.5]);
  assert.ok(bodies.every(({ meshes }) => meshes[0].mesh.layers.mask === 1 << ALONE_LAYER));
  // One that stands out, or is hidden, is no part of it.
  bodies[1].plain = false;
  bodies[3].group.visible = false;
  for (const { followers } of bodies) for (const follow of followers) follow();
  crowd.arrange(null, false);
  assert.equal(drawn.count, 2);
  assert.deepEqual(
    [at(0), at(1)],
    [
      [0, 0, 0.5],
      [7, 8, 9.5],
    ],
  );
  for (const k of [1, 3]) assert.equal(bodies[k].meshes[0].mesh.layers.mask, 1);
});

test("a coarser shape has fewer corners, and none of its points is off by more than a cell", () => {
  const ball = new SphereGeometry(0.5, 64, 32);
  const radius = (geometry) => {
    const at = geometry.getAttribute("position");
    return Array.from({ length: at.count }, (_, k) => Math.hypot(at.getX(k), at.getY(k), at.getZ(k)));
  };
  const counts = [0, 0.02, 0.1, 0.25].map((cell) => {
    const work = coarsening(ball, { shape: ball, off: 0 }, cell);
    let step = work.next();
    while (!step.done) step = work.next();
    const { shape: made, off } = step.value;
    assert.ok(off <= cell * Math.sqrt(3) && off >= cell / 2, `${off} m of a cell of ${cell}`);
    made.computeBoundingBox();
    // Corners stay on the surface; triangles between them sag by less than a cell.
    assert.ok(radius(made).every((r) => Math.abs(r - 0.5) < 1e-6));
    for (const [one, other] of [
      [made.boundingBox.min, -0.5],
      [made.boundingBox.max, 0.5],
    ])
      for (const x of one.toArray()) assert.ok(Math.abs(x - other) <= off + 1e-6);
    return made.index.count / 3;
  });
  // A pole of a ball has triangles without area.
  assert.deepEqual(counts[0], 2 * 64 * 31);
  for (const k of [1, 2, 3]) assert.ok(counts[k] < counts[k - 1]);
});

test("without a graphics card far ones are coarser by less than a pixel, and what is out of sight is left out", () => {
  const gear = new SphereGeometry(0.05, 64, 32);
  gear.deleteAttribute("uv");
  const bodies = [1, 3, 30, 200, -5].map((x) => body(x, gear));
  const [crowd] = light.crowdsOf(bodies);
  const camera = new PerspectiveCamera(60, 1, 0.01, 1000);
  camera.lookAt(1, 0, 0);
  camera.updateMatrixWorld();
  const frustum = new Frustum().setFromProjectionMatrix(
    new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse),
  );
  const pixel = 0.001;
  const sight = { eye: new Vector3(), frustum, pixel };
  const count = () =>
    crowd.levels.reduce((sum, { drawn: { count, geometry } }) => sum + count * geometry.index.count, 0);
  crowd.arrange(sight, true);
  // As it is until a coarser one is there, of which a little is made at each picture.
  assert.deepEqual([crowd.levels.length, count()], [1, 4 * gear.index.count]);
  let pictures = 0;
  for (let before = -1; before !== pictures; ) {
    before = pictures;
    const [had, drawn] = [crowd.levels.length, count()];
    let looks = 0;
    const { now } = performance;
    performance.now = () => looks++;
    crowd.refine(1);
    performance.now = now;
    assert.ok(looks <= 2);
    if (looks > 0) pictures += 1;
    crowd.arrange(sight, false);
    assert.ok(crowd.levels.length <= had + 1 && count() <= drawn);
  }
  assert.ok(pictures > crowd.levels.length, `${crowd.levels.length} shapes within ${pictures} pictures`);
  const place = new Matrix4();
  const drawn = crowd.levels.flatMap(({ drawn, off }) =>
    Array.from({ length: drawn.count }, (_, k) => {
      drawn.getMatrixAt(k, place);
      const x = new Vector3().setFromMatrixPosition(place).x;
      assert.ok(off <= pixel * x, `${off} m off at ${x} m`);
      return [x, drawn.geometry.index.count];
    }),
  );
  const counts = drawn.sort((one, other) => one[0] - other[0]).map(([, count]) => count);
  assert.equal(counts.length, 4);
  assert.equal(counts[0], gear.index.count);
  assert.ok(counts[3] < 0.05 * counts[0]);
  assert.ok(counts[2] < counts[0]);
  // None that nobody needs: those that are near are drawn as they are.
  const [near] = light.crowdsOf(
    [1, 1, 1, 1].map((x) => body(x, new SphereGeometry(0.9, 64, 32).deleteAttribute("uv"))),
  );
  near.arrange(sight, true);
  near.refine(Number.POSITIVE_INFINITY);
  near.arrange(sight, false);
  assert.equal(near.levels.length, 1);
  // All of it, as it is, where nobody says from where one looks.
  crowd.arrange(null, true);
  assert.equal(crowd.levels[0].drawn.count, 5);
});

test("few of a shape, and what one sees through, are drawn one by one", () => {
  assert.equal(crowdsOf([0, 1, 2].map((x) => body(x))).length, 0);
  const clear = [0, 1, 2, 3].map((x) => body(x));
  for (const { meshes } of clear) meshes[0].given = new MeshStandardMaterial({ transparent: true });
  assert.equal(crowdsOf(clear).length, 0);
});

test("coarser shapes are made once of one that is shared, and given back with it", () => {
  const ball = new SphereGeometry(0.5, 64, 32).deleteAttribute("uv");
  const levels = Levels.of(ball);
  while (levels.next < Number.POSITIVE_INFINITY) levels.work(Number.POSITIVE_INFINITY);
  assert.equal(Levels.of(ball), levels);
  assert.ok(levels.made.length > 3);
  // How far the true corners are off, though each is made of the one before.
  const at = ball.getAttribute("position");
  for (const { shape, off, standIn } of levels.made.slice(1)) {
    const there = shape.getAttribute("position");
    const from = (k) => new Vector3().fromBufferAttribute(at, k);
    const to = (k) => new Vector3().fromBufferAttribute(there, standIn[k]);
    const far = Array.from({ length: at.count }, (_, k) => from(k).distanceTo(to(k)));
    assert.ok(Math.abs(Math.max(...far) - off) < 1e-6);
  }
  const gone = [];
  for (const { shape } of levels.made) shape.addEventListener("dispose", () => gone.push(shape));
  Levels.drop(ball);
  assert.deepEqual(
    gone,
    levels.made.slice(1).map(({ shape }) => shape),
  );
  assert.notEqual(Levels.of(ball), levels);
});
