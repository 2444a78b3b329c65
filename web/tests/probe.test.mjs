// A probed point has the speed that its body gives it.

import assert from "node:assert/strict";
import { test } from "node:test";
import { Group, Vector3 } from "three";
import { load } from "./source.mjs";

const { followProbe, probe, probeAt, toggleProbe } = await load("view/probe");

test("a point of a body that turns has ω r, and none is said across a gap", () => {
  const world = new Group();
  world.rotation.x = -Math.PI / 2; // z up, as the page has it
  const body = new Group();
  world.add(body);
  body.position.set(1, 2, 0.5);
  world.updateMatrixWorld(true);
  toggleProbe();
  probeAt("arm", body.localToWorld(new Vector3(0.8, 0, 0.1)), body);
  const omega = 1.5;
  const at = (t) => {
    body.rotation.z = omega * t;
    followProbe(t, body);
    return probe.value;
  };
  assert.equal(at(0).speed, null);
  assert.deepEqual(
    at(0).at.map((x) => Math.round(x * 1e9) / 1e9),
    [1.8, 2, 0.6],
  );
  const { speed, over } = at(0.04);
  assert.ok(Math.abs(speed - omega * 0.8) < 0.001, String(speed));
  assert.ok(Math.abs(over - 0.04) < 1e-12);
  assert.equal(at(0.04).speed, speed); // shown again
  assert.equal(at(0.5).speed, null);
  assert.equal(at(0.4).speed, null); // time went back
  toggleProbe();
  assert.equal(probe.value, null);
});
