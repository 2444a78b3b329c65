// What the room marks stands out from its ground, dark and light, and colours go with the theme.

import assert from "node:assert/strict";
import { test } from "node:test";
import { together } from "./source.mjs";

globalThis.location = { search: "?draw=full" };
const [{ LOOKS, roomLook }, { doubtMaterial, bodyMaterial, markLine, markMaterial, recolor }] =
  await together("scene/room_look", "scene/materials");

const channels = (color) => [16, 8, 0].map((shift) => ((color >> shift) & 255) / 255);

function luminance(color) {
  const [r, g, b] = color.map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

function contrast(one, other) {
  const [high, low] = [luminance(one), luminance(other)].sort((a, b) => b - a);
  return (high + 0.05) / (low + 0.05);
}

for (const [name, look] of Object.entries(LOOKS)) {
  const ground = channels(look.ground);

  test(`verdicts, doubt and marks have a contrast of at least 3 in the ${name} room`, () => {
    for (const [tone, color] of Object.entries(look.tones))
      assert.ok(contrast(channels(color), ground) >= 3, `${tone}: ${contrast(channels(color), ground)}`);
  });

  test(`what is seen through has it, too, in the ${name} room`, () => {
    const mark = channels(look.tones.mark);
    for (const { opacity } of [
      markMaterial("solid"),
      markMaterial("over"),
      markMaterial("ghost"),
      markLine(true),
    ]) {
      const seen = mark.map((c, k) => opacity * c + (1 - opacity) * ground[k]);
      assert.ok(contrast(seen, ground) >= 3, `at ${opacity}: ${contrast(seen, ground)}`);
    }
  });
}

test("with the theme marks change, and who gives off no light does not begin to", () => {
  const [far, near] = doubtMaterial();
  const within = bodyMaterial("within");
  roomLook.value = LOOKS.light;
  recolor();
  assert.equal(markLine(true).color.getHex(), LOOKS.light.tones.mark);
  for (const each of [far, near]) {
    assert.equal(each.color.getHex(), LOOKS.light.tones.doubt);
    assert.equal(each.emissive.getHex(), 0);
  }
  assert.equal(within.emissive.getHex(), LOOKS.light.tones.within);
});
