// A headset without a headset, for a desktop browser: keys and mouse move what iwer emulates. Never in the product.

import { metaQuest3, XRDevice } from "iwer";

const device = new XRDevice(metaQuest3);
device.installRuntime({ forceInstall: true });
// The emulator draws a session into the page's own canvas, which is opaque where the processor draws: what is behind
// glasses would be black. A headset has a canvas of its own.
const { getContext } = HTMLCanvasElement.prototype;
HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, look?: object) {
  return getContext.call(this, kind, kind === "webgl2" ? { ...look, alpha: true } : look);
} as typeof getContext;
const left = device.controllers.left!;
const right = device.controllers.right!;

const WALK = 1.2;
const REACH = { least: 0.15, most: 0.8 };
const keys = new Set<string>();
const head = { x: 0, y: 1.62, z: 0, turn: 0, nod: -0.35 };
const hand = { far: 0.45, turn: 0, nod: -0.25 };
let before = performance.now();

const HELP = `
W A S D  go      R F  head up, down      drag  look around
move the mouse with Shift: right hand      wheel: nearer, farther
hold Space: take, pull      M: menu at the left wrist      Esc: leave`;

const help = document.createElement("pre");
help.textContent = HELP.trim();
help.style.cssText =
  "position:fixed;left:12px;bottom:12px;z-index:99;margin:0;padding:8px 12px;background:#0d131ce6;color:#dbe3ee;font:13px/1.5 sans-serif;border-radius:6px;pointer-events:none";
addEventListener("load", () => document.body.append(help));

const inside = (): boolean => device.activeSession !== undefined;

addEventListener(
  "keydown",
  (event) => {
    if (!inside()) return;
    keys.add(event.code);
    if (event.code === "Space") right.updateButtonValue("trigger", 1);
    if (event.code === "Escape") void device.activeSession?.end();
    event.preventDefault();
    event.stopPropagation();
  },
  true,
);
addEventListener(
  "keyup",
  (event) => {
    keys.delete(event.code);
    if (event.code === "Space") right.updateButtonValue("trigger", 0);
  },
  true,
);
addEventListener("pointermove", (event) => {
  if (!inside()) return;
  const [turn, nod] = [-event.movementX * 0.004, -event.movementY * 0.004];
  const of = event.shiftKey ? hand : event.buttons & 1 ? head : null;
  if (!of) return;
  of.turn += turn;
  of.nod = Math.min(1.4, Math.max(-1.4, of.nod + nod));
});
addEventListener("wheel", (event) => {
  hand.far = Math.min(REACH.most, Math.max(REACH.least, hand.far - event.deltaY * 0.0006));
});

/** Turned about the vertical, then nodded: a quaternion x, y, z, w. */
function turned(turn: number, nod: number): [number, number, number, number] {
  const [a, b] = [turn / 2, nod / 2];
  return [
    Math.cos(a) * Math.sin(b),
    Math.sin(a) * Math.cos(b),
    -Math.sin(a) * Math.sin(b),
    Math.cos(a) * Math.cos(b),
  ];
}

function ahead(turn: number, nod: number): [number, number, number] {
  return [-Math.sin(turn) * Math.cos(nod), Math.sin(nod), -Math.cos(turn) * Math.cos(nod)];
}

/** Nobody stands still to the last bit; who does is taken for a device that hangs. */
const noise = (): number => 4e-4 * (Math.random() - 0.5);

setInterval(() => {
  const now = performance.now();
  const step = (WALK * (now - before)) / 1000;
  before = now;
  const [x, , z] = ahead(head.turn, 0);
  const on = (code: string): number => (keys.has(code) ? step : 0);
  head.x += x * (on("KeyW") - on("KeyS")) - z * (on("KeyD") - on("KeyA"));
  head.z += z * (on("KeyW") - on("KeyS")) + x * (on("KeyD") - on("KeyA"));
  head.y = Math.min(1.95, Math.max(0.9, head.y + on("KeyR") - on("KeyF")));
  device.position.set(head.x + noise(), head.y + noise(), head.z + noise());
  device.quaternion.set(...turned(head.turn, head.nod));
  const way = head.turn + hand.turn;
  const [i, j, k] = ahead(way, hand.nod);
  right.position.set(
    head.x + 0.2 * Math.cos(head.turn) + hand.far * i + noise(),
    head.y - 0.35 + hand.far * j + noise(),
    head.z - 0.2 * Math.sin(head.turn) + hand.far * k + noise(),
  );
  right.quaternion.set(...turned(way, hand.nod));
  // The board above the hand is 0.54 m wide: at arm's length, beside the way one looks, it can be read.
  const menu = keys.has("KeyM");
  const [p, , q] = ahead(head.turn + (menu ? 0.3 : 0.8), 0);
  const out = menu ? 0.5 : 0.62;
  left.position.set(head.x + out * p + noise(), head.y - (menu ? 0.4 : 0.6), head.z + out * q);
  left.quaternion.set(...turned(head.turn, 0));
}, 10);
