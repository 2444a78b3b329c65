// A veil: the far side of a closed surface, denser toward its rim, so that a smooth volume shows its shape
// without a line and covers nothing that is inside.

import { BackSide, Color, type Material, ShaderMaterial } from "three";
import type { Verdict } from "../wire";
import { byTone, colorOf, known, once } from "./materials";
import type { Tone } from "./room_look";

const VERTEX = `
varying vec3 vAcross;
varying vec3 vToEye;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  vAcross = normalMatrix * normal;
  vToEye = -place.xyz;
  gl_Position = projectionMatrix * place;
}`;

// UNDECIDED is hatched like every other surface.
const FRAGMENT = `
uniform vec3 tone;
uniform bool hatched;
varying vec3 vAcross;
varying vec3 vToEye;
void main() {
  float rim = 1.0 - abs(dot(normalize(vAcross), normalize(vToEye)));
  float opacity = 0.14 + 0.5 * rim * rim * rim;
  if (hatched && mod(gl_FragCoord.x - gl_FragCoord.y, 12.0) < 5.0) opacity *= 0.25;
  gl_FragColor = vec4(tone, opacity);
  #include <colorspace_fragment>
}`;

/** The shared veil of one verdict; its geometry needs normals. */
export function veilMaterial(verdict: Verdict | null): Material {
  const tone: Tone = verdict ?? "none";
  return known(KEYS.veil[tone]) ?? made(tone);
}

const KEYS = byTone("veil");

function made(tone: Tone): Material {
  return once(KEYS.veil[tone], () => {
    return new ShaderMaterial({
      uniforms: { tone: { value: new Color(colorOf(tone)) }, hatched: { value: tone === "undecided" } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      side: BackSide,
      transparent: true,
      depthWrite: false,
      toneMapped: false,
    });
  });
}
