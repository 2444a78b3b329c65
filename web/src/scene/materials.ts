// Materials that carry a meaning: their colours are what the legend says, whatever the light.

import {
  BackSide,
  type BufferGeometry,
  Color,
  DoubleSide,
  FrontSide,
  LineBasicMaterial,
  type Material,
  MeshBasicMaterial,
  MeshStandardMaterial,
  type MeshStandardMaterialParameters,
  PointsMaterial,
  ShaderMaterial,
  type WebGLProgramParametersWithUniforms,
} from "three";
import type { Verdict } from "../wire";
import { drawnBySoftware } from "./effort";
import { roomLook, type Tone } from "./room_look";

/** Colour of a verdict, of none or of doubt in the room as it looks now, sRGB. */
export function colorOf(tone: Tone): number {
  return roomLook.peek().tones[tone];
}

// UNDECIDED is hatched on the screen, so that it differs in more than colour.
function hatch(material: Material): void {
  const before = material.onBeforeCompile.bind(material);
  const key = material.customProgramCacheKey();
  material.onBeforeCompile = (shader, renderer) => {
    before(shader, renderer);
    shader.fragmentShader = shader.fragmentShader.replace(
      "#include <opaque_fragment>",
      `#include <opaque_fragment>
       if (mod(gl_FragCoord.x - gl_FragCoord.y, 12.0) < 5.0) gl_FragColor.a *= 0.25;`,
    );
  };
  material.customProgramCacheKey = () => `${key} hatched`;
}

// One light from above the right shoulder, less from the sky than from the floor, and some from the eye, so that
// no side is dark; worked out where corners are, not pixels: a twentieth of the work.
const CORNER_LIGHT = `
  vec3 across = normal;
  #ifdef USE_INSTANCING
    across = mat3(instanceMatrix) * across;
  #endif
  across = normalize(normalMatrix * across);
  float above = dot(across, viewMatrix[1].xyz);
  float key = max(dot(across, (viewMatrix * vec4(0.40, 0.77, 0.49, 0.0)).xyz), 0.0);
  float toEye = abs(dot(across, normalize(mvPosition.xyz)));
  vLight = own + 0.26 + 0.12 * above + 0.55 * key + 0.16 * toEye;`;

function lightCorners(shader: WebGLProgramParametersWithUniforms, own: number, glow: Color): void {
  Object.assign(shader.uniforms, { own: { value: own }, glow: { value: glow } });
  shader.vertexShader = `uniform float own;\nvarying float vLight;\n${shader.vertexShader}`.replace(
    "#include <project_vertex>",
    `#include <project_vertex>\n${CORNER_LIGHT}`,
  );
  shader.fragmentShader = `uniform vec3 glow;\nvarying float vLight;\n${shader.fragmentShader}`.replace(
    "#include <opaque_fragment>",
    "outgoingLight = outgoingLight * vLight + glow;\n#include <opaque_fragment>",
  );
}

/** A surface that light falls on. */
interface Solid extends MeshStandardMaterialParameters {
  /** How much of its colour it gives off itself. */
  own?: number;
}

function solid({ own = 0, roughness = 0.7, ...look }: Solid): Material {
  const { color } = look;
  if (!drawnBySoftware())
    return new MeshStandardMaterial({
      ...look,
      roughness,
      metalness: 0,
      ...(own > 0 && color !== undefined && { emissive: color, emissiveIntensity: own }),
    });
  const glow = new Color(0);
  const material = new MeshBasicMaterial({ ...look, fog: false });
  material.userData.glow = glow;
  material.onBeforeCompile = (shader) => lightCorners(shader, own, glow);
  material.customProgramCacheKey = () => "corners";
  return material;
}

/** Materials of bodies by their look; those with pictures, by the one that they came with. */
const alike = new Map<string, Material>();
const pictured = new WeakMap<Material, Map<number, Material>>();

/**
 * The material of bodies that came with one of this look, shared by all of them: three.js tells the graphics card of a
 * material once for all that wear it.
 *
 * @param glow Light that it gives off, sRGB; 0 for none.
 */
export function ownMaterial(given: Material, glow = 0): Material {
  const look = lookOf(given);
  const key = `${look} ${glow}`;
  const known = look === null ? pictured.get(given)?.get(glow) : alike.get(key);
  if (known) return known;
  const material = madeOwn(given);
  if (material instanceof MeshStandardMaterial) {
    if (glow > 0) material.emissive.setHex(glow);
  } else if (material.userData.glow instanceof Color) material.userData.glow.setHex(glow);
  if (look !== null) alike.set(key, material);
  else pictured.set(given, (pictured.get(given) ?? new Map()).set(glow, material));
  return material;
}

function madeOwn(given: Material): Material {
  if (!drawnBySoftware() || !(given instanceof MeshStandardMaterial)) return given.clone();
  const { color, map, side, transparent, opacity, alphaTest, vertexColors } = given;
  return solid({ color, map, side, transparent, opacity, alphaTest, vertexColors });
}

/** What a material without pictures looks like; null for others. */
function lookOf(given: Material): string | null {
  if (!(given instanceof MeshStandardMaterial) || given.type !== "MeshStandardMaterial") return null;
  const { map, normalMap, roughnessMap, metalnessMap, emissiveMap, aoMap, alphaMap } = given;
  if (map || normalMap || roughnessMap || metalnessMap || emissiveMap || aoMap || alphaMap) return null;
  const { color, emissive, emissiveIntensity, roughness, metalness, flatShading } = given;
  const { side, transparent, opacity, alphaTest, vertexColors, depthWrite } = given;
  const seen = [color.r, color.g, color.b, emissive.getHex(), emissiveIntensity, roughness, metalness];
  return [...seen, flatShading, side, transparent, opacity, alphaTest, vertexColors, depthWrite].join(" ");
}

/** `volume` is the far side of a closed surface alone, so that it covers nothing that is inside. */
type Kind = "line" | "ghost" | "fill" | "volume";

const LOOK: Record<Kind, { opacity: number; depthTest: boolean; depthWrite: boolean }> = {
  line: { opacity: 1, depthTest: true, depthWrite: true },
  ghost: { opacity: 0.35, depthTest: false, depthWrite: false },
  fill: { opacity: 0.15, depthTest: true, depthWrite: false },
  volume: { opacity: 0.18, depthTest: true, depthWrite: false },
};

// Keys are made once: they are asked for with every marker of every frame.
const KEYS = byTone("line", "ghost", "fill", "volume");
const THIN_KEYS = byTone("thin", "faint");
const DOT_KEYS = byTone("dot");

export function byTone<K extends string>(...kinds: K[]): Record<K, Record<Tone, string>> {
  const tones: Tone[] = ["within", "exceeded", "undecided", "none"];
  const keys = (kind: K) => Object.fromEntries(tones.map((tone) => [tone, `${kind} ${tone}`]));
  return Object.fromEntries(kinds.map((kind) => [kind, keys(kind)])) as Record<K, Record<Tone, string>>;
}

const made = new Map<string, Material>();

/** Give shared materials the colours of the room as it looks now; the second word of a key is the tone. */
export function recolor(): void {
  const { tones } = roomLook.peek();
  for (const [key, material] of made) {
    const tone = tones[key.split(" ")[1] as Tone];
    if (tone === undefined) continue;
    if (material instanceof ShaderMaterial) material.uniforms.tone!.value.setHex(tone);
    else (material as MeshBasicMaterial).color.setHex(tone);
    // Who gives off no light does not begin to.
    if (material instanceof MeshStandardMaterial && material.emissive.getHex() !== 0)
      material.emissive.setHex(tone);
  }
}

/** How much of a ghost is seen: enough to stand out from the ground. */
export const GHOSTLY = 0.5;

/** The shared material of surfaces that point or mark; over everything, seen through, or neither. */
export function markMaterial(kind: "solid" | "held" | "over" | "ghost"): Material {
  const ghost = { transparent: true, opacity: GHOSTLY, depthWrite: false };
  const look = { solid: {}, held: {}, over: { depthTest: false }, ghost }[kind];
  return once(`${kind} mark`, () => {
    const material = new MeshBasicMaterial({ color: colorOf("mark"), toneMapped: false, ...look });
    return kind === "held" ? uncut(material) : material;
  });
}

/** Have a material drawn whole where a section cuts the room open: of what a visitor holds. */
export function uncut<M extends Material>(material: M): M {
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace("#include <clipping_planes_fragment>", "");
  };
  material.customProgramCacheKey = () => "uncut";
  return material;
}

/** The shared material of lines that point or mark; over everything or not. */
export function markLine(over: boolean): Material {
  const look = { toneMapped: false, transparent: over, opacity: over ? 0.85 : 1, depthTest: !over };
  return once(`${over ? "line-over" : "beam"} mark`, () => {
    const material = new LineBasicMaterial({ color: colorOf("mark"), ...look });
    return over ? material : uncut(material);
  });
}

/** A shared material that is there already. */
export const known = (key: string): Material | undefined => made.get(key);

/** A material that is made when it is first needed and shared from then on. */
export function once(key: string, make: () => Material): Material {
  let material = made.get(key);
  if (!material) {
    material = make();
    made.set(key, material);
  }
  return material;
}

/** The shared material of markers of one verdict. */
export function markerMaterial(kind: Kind, verdict: Verdict | null): Material {
  const tone: Tone = verdict ?? "none";
  // Asked for each marker of each picture: a function that makes one is not made for nothing.
  return made.get(KEYS[kind][tone]) ?? madeForMarkers(kind, tone);
}

function madeForMarkers(kind: Kind, tone: Tone): Material {
  const hatched = tone === "undecided";
  const material = new MeshBasicMaterial({
    color: colorOf(tone),
    side: kind === "volume" ? BackSide : DoubleSide,
    toneMapped: false,
    transparent: LOOK[kind].opacity < 1 || hatched,
    // One colour without light: in which order both sides are blended does not matter, and asking for two passes
    // has three.js look its programs up twice per picture.
    forceSinglePass: true,
    ...LOOK[kind],
  });
  if (hatched) hatch(material);
  made.set(KEYS[kind][tone], material);
  return material;
}

/** The shared material of thin lines: edges of translucent things. */
export function lineMaterial(verdict: Verdict | null): Material {
  return thin("thin", verdict, 0.85);
}

/** The shared material of lines that are many and mean little one by one: beams that hit nothing. */
export function faintMaterial(verdict: Verdict | null): Material {
  return thin("faint", verdict, 0.22);
}

function thin(key: "thin" | "faint", verdict: Verdict | null, opacity: number): Material {
  const tone: Tone = verdict ?? "none";
  return made.get(THIN_KEYS[key][tone]) ?? madeThin(key, tone, opacity);
}

function madeThin(key: "thin" | "faint", tone: Tone, opacity: number): Material {
  return once(THIN_KEYS[key][tone], () => {
    // Seen through: what lies in the same plane, such as a field and its beams, must not flicker.
    const look = { toneMapped: false, transparent: true, opacity, depthWrite: false };
    return new LineBasicMaterial({ color: colorOf(tone), ...look });
  });
}

/** The shared material of dots with a size in pixels. */
export function dotMaterial(verdict: Verdict | null): Material {
  const tone: Tone = verdict ?? "none";
  return made.get(DOT_KEYS.dot[tone]) ?? madeDot(tone);
}

function madeDot(tone: Tone): Material {
  return once(DOT_KEYS.dot[tone], () => {
    return new PointsMaterial({ color: colorOf(tone), toneMapped: false, size: 5, sizeAttenuation: false });
  });
}

/** The shared material of a body that a verdict is about. */
export function bodyMaterial(verdict: Verdict | null): Material | Material[] {
  const tone: Tone = verdict ?? "none";
  const look = { color: colorOf(tone), own: 0.45, roughness: 0.6, toneMapped: false };
  if (tone === "undecided") return bothSides("body undecided", look);
  return once(`body ${tone}`, () => solid({ ...look, side: DoubleSide }));
}

/** The shared material of a body that may be elsewhere: no colour of its own, and seen through. */
export function doubtMaterial(): Material[] {
  return bothSides("body doubt", { color: colorOf("doubt"), roughness: 0.9, opacity: 0.8 });
}

// Seen through and hatched: the far side before the near one, for the two groups of `drawnTwice`. three.js makes
// such passes of one material by itself, and looks its programs up anew in each, in every picture.
function bothSides(key: string, look: Solid): Material[] {
  return [BackSide, FrontSide].map((side) =>
    once(`${key} ${side}`, () => {
      const material = solid({ ...look, side, transparent: true });
      hatch(material);
      return material;
    }),
  );
}

/** Have a geometry drawn once for each of two materials, where it is given two. */
export function drawnTwice(geometry: BufferGeometry): void {
  if (geometry.groups.length > 0) return;
  for (const material of [0, 1]) geometry.addGroup(0, Number.POSITIVE_INFINITY, material);
}

/** The shared material of what is real, over the real cell: nothing is drawn, and what is behind it is hidden. */
export function occluderMaterial(): Material {
  return once("occluder", () => new MeshBasicMaterial({ colorWrite: false, side: DoubleSide }));
}

/** Score colours in use; scales have few steps. */
const MOST_SCORES = 256;

/** The shared material of a body in the colour of a score, sRGB. */
export function scoreMaterial(color: number): Material {
  if (made.size > MOST_SCORES) {
    for (const key of made.keys()) if (key.startsWith("score ")) made.delete(key);
  }
  return once(`score ${color}`, () => {
    return solid({ color, own: 0.3, roughness: 0.65, side: DoubleSide, toneMapped: false });
  });
}
