// The bodies of the twin: one group per node, posed by the newest block, dressed by its mesh.

import {
  Box3,
  type BufferGeometry,
  Frustum,
  Group,
  LineSegments,
  type Material,
  Matrix4,
  Mesh,
  type Object3D,
  Quaternion,
  Vector3,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { type Doubts, doubtOf } from "../doubts";
import type { View } from "../markers/view";
import { FLOATS_PER_NODE } from "../poses";
import type { Node, Scene, Snapshot, Verdict } from "../wire";
import { coarsening } from "./coarser";
import { type Crowd, crowdsOf, type Dressed, type Sight } from "./crowds";
import { drawnBySoftware } from "./effort";
import { featureEdges, turnOutward } from "./feature_edges";
import { Levels } from "./levels";
import {
  bodyMaterial,
  doubtMaterial,
  drawnTwice,
  lineMaterial,
  markerMaterial,
  occluderMaterial,
  ownMaterial,
  scoreMaterial,
} from "./materials";
import { veilMaterial } from "./veil";

/** Role of what is only room: a safety area. */
const AREA = "area";

/** Drawn before everything else: what is behind it fails the test of depth. */
const FIRST = -1;

/** What is no farther than this from where it was drawn last stands still: single precision, in metres and as a turn. */
const STANDS = 1e-6;

/** How far something may be from where it is while one moves [px], and how long after that one stands [ms]. */
const MOVING_PX = 3;
const SETTLED_MS = 150;

/** Triangles that stand still from which on they are kept as a picture. */
const HEAVY = 20_000;

/** Time for coarser shapes in each picture [ms], and as a share of what it takes: they make slow ones faster. */
const COARSER_MS = 4;
const COARSER_SHARE = 0.2;

/** Longest time for which normals are worked on at a stretch [ms]: the page answers between two. */
const STRETCH_MS = 6;

/** Light that a selected body gives off. */
const SELECTED_GLOW = 0x1c4a7d;

type Looks = Snapshot["looks"];

const ONE = new Vector3(1, 1, 1);

const sharp = new WeakMap<BufferGeometry, Promise<BufferGeometry>>();

/** A geometry with a normal for each of its triangles, one for all bodies that share it. */
function withNormals(geometry: BufferGeometry): Promise<BufferGeometry> {
  let made = sharp.get(geometry);
  if (!made) {
    made = sharpened(geometry);
    sharp.set(geometry, made);
  }
  return made;
}

let stretchOver = 0;

async function sharpened(geometry: BufferGeometry): Promise<BufferGeometry> {
  const apart = geometry.toNonIndexed();
  apart.computeVertexNormals();
  if (Object.keys(apart.attributes).length !== 2) return apart;
  // Corners of a flat face are worked out once.
  const work = coarsening(apart, { shape: apart, off: 0 }, 0);
  for (;;) {
    // Where nobody looks, a page gets its turn but once a second.
    if (performance.now() > stretchOver && !document.hidden) {
      await new Promise((resolve) => setTimeout(resolve));
      stretchOver = performance.now() + STRETCH_MS;
    }
    const step = work.next();
    if (step.done) return step.value.shape;
  }
}

/** Have what came without normals drawn with some, where light falls on corners. */
async function lit(model: Object3D): Promise<void> {
  const meshes: Mesh[] = [];
  model.traverse((part) => {
    if (part instanceof Mesh && !part.geometry.hasAttribute("normal")) meshes.push(part);
  });
  for (const mesh of meshes) mesh.geometry = await withNormals(mesh.geometry);
}

/** Give back what a model takes of the graphics card, with the shapes that were made of its own. */
function drop(model: Object3D): void {
  model.traverse((part) => {
    if (!(part instanceof Mesh)) return;
    const { geometry } = part as Mesh;
    const give = (one: BufferGeometry): void => {
      Levels.drop(one);
      one.dispose();
    };
    give(geometry);
    void sharp.get(geometry)?.then(give);
  });
}

function worn(given: Material | Material[], glow: number): Material | Material[] {
  return Array.isArray(given) ? given.map((each) => ownMaterial(each, glow)) : ownMaterial(given, glow);
}

export class Body {
  readonly group = new Group();
  /** Box around its mesh, in its own frame; empty until the mesh came. */
  readonly extent = new Box3();
  /** What it wears. */
  readonly meshes: Dressed[] = [];
  /** Told when it looks different or is elsewhere. */
  readonly followers: (() => void)[] = [];
  /** Whether it was put somewhere that no block says. */
  carried = false;
  private enclosed: { fill: Mesh; edges: LineSegments; smooth: boolean }[] = [];
  private painted: Verdict | null | undefined = undefined;
  /** Colour of a score; undefined while it has its own or a verdict's. */
  tint: number | undefined = undefined;
  /** Colour that a variable gives it; undefined for its own. */
  private worn: number | undefined = undefined;
  private lit = false;
  /** Whether it is seen as it is, behind the picture: the twin is over the real cell. */
  private behind = false;
  /** Whether nothing of it is drawn and it hides what is behind it all the same. */
  get occludes(): boolean {
    return this.behind && !this.doubted;
  }
  /** Whether it is seen as it came. */
  get plain(): boolean {
    const { painted, tint, worn } = this;
    const colored = painted !== undefined || tint !== undefined || worn !== undefined;
    return !(colored || this.lit || this.doubted || this.behind);
  }
  /** Whether it may be elsewhere. */
  doubted = false;
  /** Whether a variable says that it is not there. */
  absent = false;

  constructor(readonly node: Node) {
    this.group.name = node.name;
    this.group.matrixAutoUpdate = false;
    this.group.userData.node = node.name;
  }

  /** Put on a mesh that is given in the body's frame. */
  dress(model: Object3D): void {
    const parts: Mesh[] = [];
    model.updateMatrixWorld(true);
    model.traverse((part) => {
      if (part instanceof Mesh) parts.push(part);
    });
    for (const part of parts) {
      if (this.node.role === AREA) {
        this.enclose(part);
        continue;
      }
      const given = part.material;
      part.material = worn(given, 0);
      drawnTwice(part.geometry);
      this.meshes.push({ mesh: part, given, local: part.matrixWorld.clone() });
    }
    this.extent.setFromObject(model);
    this.group.add(model);
    this.repaint();
  }

  // An area is room, not matter: one sees and clicks through it.
  private enclose(part: Mesh): void {
    turnOutward(part.geometry);
    const { lines, smooth } = featureEdges(part.geometry);
    const edges = new LineSegments(lines);
    if (smooth && !part.geometry.hasAttribute("normal")) part.geometry.computeVertexNormals();
    for (const shape of [part, edges]) shape.raycast = () => {};
    part.renderOrder = 2;
    // A smooth one has no edges to be shown by; its veil covers nothing.
    part.userData.volume = !smooth;
    part.add(edges);
    this.enclosed.push({ fill: part, edges, smooth });
  }

  /** Show it in the colour of a verdict; `undefined` for its own. */
  paint(verdict: Verdict | null | undefined): void {
    if (verdict === this.painted) return;
    this.painted = verdict;
    this.repaint();
  }

  /** Show it in the colour of a score, sRGB; goes before a verdict's; `undefined` for none. */
  color(tint: number | undefined): void {
    if (tint === this.tint) return;
    this.tint = tint;
    this.repaint();
  }

  /** Show it in the colour of a lamp, sRGB; goes after a verdict's; `undefined` for none. */
  wear(color: number | undefined): void {
    if (color === this.worn) return;
    this.worn = color;
    this.repaint();
  }

  /** Show that it may be elsewhere; goes before every colour, as none may be relied on. */
  doubt(on: boolean): void {
    if (on === this.doubted) return;
    this.doubted = on;
    this.repaint();
  }

  /** Show it over the real cell: what exists there only hides what is behind it. */
  overReality(on: boolean): void {
    const behind = on && this.node.real;
    if (behind === this.behind) return;
    this.behind = behind;
    this.repaint();
  }

  /** Make it stand out as selected. */
  light(on: boolean): void {
    if (on === this.lit) return;
    this.lit = on;
    this.repaint();
  }

  private repaint(): void {
    for (const { fill, edges, smooth } of this.enclosed) {
      const verdict = this.doubted ? "undecided" : (this.painted ?? null);
      fill.material = smooth ? veilMaterial(verdict) : markerMaterial("volume", verdict);
      edges.material = lineMaterial(verdict);
    }
    for (const { mesh, given } of this.meshes) {
      // Where it may be elsewhere the eye cannot tell: that is drawn over the real one, too.
      mesh.renderOrder = this.occludes ? FIRST : 0;
      mesh.castShadow = mesh.receiveShadow = !this.occludes;
      if (this.occludes) mesh.material = occluderMaterial();
      else if (this.doubted) mesh.material = doubtMaterial();
      else if (this.tint !== undefined) mesh.material = scoreMaterial(this.tint);
      else if (this.painted !== undefined) mesh.material = bodyMaterial(this.painted);
      else if (this.worn !== undefined) mesh.material = scoreMaterial(this.worn);
      else mesh.material = worn(given, this.lit ? SELECTED_GLOW : 0);
    }
    this.follow();
  }

  /** Tell whoever draws it with others. */
  follow(): void {
    for (const follower of this.followers) follower();
  }
}

export class Bodies {
  readonly root = new Group();
  readonly byName = new Map<string, Body>();
  private list: Body[] = [];
  private crowds: Crowd[] = [];
  /** Crowds that stand still, and all of them below one group. */
  private readonly standingCrowds = new Set<Crowd>();
  readonly standing = { root: new Group(), version: 0, heavy: false };
  /** Where every body was put. */
  private posed = new Float32Array();
  private hidden: ReadonlySet<string> = new Set();
  private real = false;
  private generation = 0;
  /** Whether somebody wears a look of a variable, or is in doubt. */
  private worn = false;
  private doubted = false;
  /** Meshes of this scene and the one before: an edit changes few. */
  private models = new Map<string, Promise<Object3D>>();
  private readonly position = new Vector3();
  private readonly orientation = new Quaternion();

  /**
   * Make the bodies of a scene and fetch their meshes.
   *
   * @returns Full names of the nodes whose mesh could not be had.
   */
  async load(scene: Scene): Promise<string[]> {
    this.generation += 1;
    const generation = this.generation;
    this.root.clear();
    for (const crowd of this.crowds) crowd.dispose();
    this.crowds = [];
    this.standingCrowds.clear();
    this.standing.root.clear();
    this.root.add(this.standing.root);
    this.standing.version += 1;
    this.posed = new Float32Array();
    this.byName.clear();
    this.list = scene.nodes.map((node) => new Body(node));
    this.worn = this.doubted = false;
    this.overReality(this.real);
    for (const body of this.list) {
      this.byName.set(body.node.name, body);
      this.root.add(body.group);
    }
    const failed: string[] = [];
    const before = this.models;
    const models = new Map<string, Promise<Object3D>>();
    this.models = models;
    const dressed = Promise.all(
      this.list.map(async (body) => {
        const hash = body.node.mesh;
        if (!hash) return;
        let model = models.get(hash);
        if (!model) {
          model = before.get(hash) ?? fetchModel(hash);
          models.set(hash, model);
        }
        try {
          const shape = (await model).clone();
          if (drawnBySoftware() && body.node.role !== AREA) await lit(shape);
          if (generation === this.generation) body.dress(shape);
        } catch {
          models.delete(hash);
          failed.push(body.node.name);
        }
      }),
    );
    // All that are needed have been asked for by now.
    for (const [hash, model] of before) if (!models.has(hash)) void model.then(drop, () => {});
    await dressed;
    if (generation === this.generation) {
      this.crowds = crowdsOf(this.list);
      for (const { root } of this.crowds) this.root.add(root);
      this.seenFrom.elements.fill(0);
    }
    return failed;
  }

  /**
   * Put every body where the block says: x, y, z [m], w, x, y, z in the world.
   *
   * @returns Whether one is elsewhere than it was.
   */
  pose(block: Float32Array): boolean {
    const known = this.posed.length === block.length;
    if (!known) this.posed = block.slice();
    const before = this.posed;
    let moved = false;
    for (let i = 0, k = 0; i < this.list.length; i += 1, k += FLOATS_PER_NODE) {
      const body = this.list[i]!;
      let same = known && !body.carried;
      for (let j = k; same && j < k + FLOATS_PER_NODE; j += 1)
        same = Math.abs(before[j]! - block[j]!) <= STANDS;
      if (same) continue;
      moved = true;
      body.carried = false;
      for (let j = k; j < k + FLOATS_PER_NODE; j += 1) before[j] = block[j]!;
      this.position.set(block[k]!, block[k + 1]!, block[k + 2]!);
      this.orientation.set(block[k + 4]!, block[k + 5]!, block[k + 6]!, block[k + 3]!);
      body.group.matrix.compose(this.position, this.orientation, ONE);
      body.group.matrixWorldNeedsUpdate = true;
      body.follow();
    }
    return moved;
  }

  private movedAt = Number.NEGATIVE_INFINITY;
  private arrangedAt = 0;
  private readonly sight: Sight = { eye: new Vector3(), frustum: new Frustum(), pixel: 0 };
  private readonly toScreen = new Matrix4();
  private readonly seenFrom = new Matrix4();

  /**
   * Draw those that are many no finer than one sees them.
   *
   * While one moves they are coarser by up to `MOVING_PX` pixels, and by less than one as soon as one stands.
   *
   * @param view Matrices of its camera up to date.
   * @param plain Whether the screen's pixels count; else all are drawn as they are.
   * @param time Of the picture [ms].
   * @returns Whether it is time for a picture, as one has come to stand.
   */
  arrange({ camera, pixel: ofScreen }: View, plain: boolean, time: number): boolean {
    if (this.crowds.length === 0) return false;
    const { sight, toScreen, seenFrom } = this;
    const pixel = plain ? ofScreen : 0;
    const close = pixel > 0 && drawnBySoftware();
    if (close) {
      toScreen.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
      toScreen.multiply(this.root.matrixWorld);
    } else toScreen.identity();
    const elsewhere = !toScreen.equals(seenFrom);
    if (elsewhere) this.movedAt = time;
    const off = close && time - this.movedAt < SETTLED_MS ? MOVING_PX * pixel : pixel;
    const anew = elsewhere || sight.pixel !== off;
    if (anew) {
      seenFrom.copy(toScreen);
      sight.pixel = off;
      sight.frustum.setFromProjectionMatrix(toScreen);
      this.root.worldToLocal(camera.getWorldPosition(sight.eye));
    }
    this.settle(close, anew, time);
    const took = Math.min(time - this.arrangedAt, 1000);
    this.arrangedAt = time;
    const until = performance.now() + Math.max(COARSER_MS, COARSER_SHARE * took);
    for (let k = 0; k < this.crowds.length; k += 1) this.crowds[k]!.refine(until);
    return anew && !elsewhere;
  }

  /** Arrange crowds, and tell those that stand still from others. */
  private settle(close: boolean, anew: boolean, time: number): void {
    const { standing, standingCrowds, sight } = this;
    let other = anew;
    for (let k = 0; k < this.crowds.length; k += 1) {
      const crowd = this.crowds[k]!;
      const stood = standingCrowds.has(crowd);
      const stands = close && crowd.stands(time);
      const arranged = crowd.arrange(close ? sight : null, anew, stood && stands && standing.heavy);
      if (stands !== stood) {
        (stands ? standing.root : this.root).add(crowd.root);
        if (stands) standingCrowds.add(crowd);
        else standingCrowds.delete(crowd);
      }
      if (stands !== stood || (stood && arranged)) other = true;
    }
    if (!other) return;
    standing.version += 1;
    let triangles = 0;
    for (const crowd of standingCrowds) triangles += crowd.triangles;
    standing.heavy = triangles >= HEAVY;
  }

  /** Show them over the real cell, or in a room of their own. */
  overReality(on: boolean): void {
    this.real = on;
    for (const body of this.list) body.overReality(on);
  }

  hide(names: ReadonlySet<string>): void {
    this.hidden = names;
    this.reveal();
  }

  /** Looks that follow variables: colours in 0…1, null for what is not drawn. */
  wear(looks: Looks): void {
    if (!this.worn && isEmpty(looks)) return;
    this.worn = !isEmpty(looks);
    for (let k = 0; k < this.list.length; k += 1) {
      const body = this.list[k]!;
      const look = looks[body.node.name];
      body.absent = look === null;
      let color = 0;
      if (look) for (let i = 0; i < look.length; i += 1) color = color * 256 + Math.round(255 * look[i]!);
      body.wear(look ? color : undefined);
    }
    this.reveal();
  }

  /** Show who may be elsewhere, and only those. */
  doubt(doubts: Doubts): void {
    if (doubts.size === 0 && !this.doubted) return;
    this.doubted = doubts.size > 0;
    for (const body of this.list) body.doubt(doubtOf(body.node, doubts) !== undefined);
  }

  private reveal(): void {
    for (let k = 0; k < this.list.length; k += 1) {
      const body = this.list[k]!;
      const visible = !this.hidden.has(body.node.name) && !body.absent;
      if (visible === body.group.visible) continue;
      body.group.visible = visible;
      body.follow();
    }
  }

  /** Make these stand out as selected, and only these. */
  light(names: ReadonlySet<string>): void {
    for (const body of this.list) body.light(names.has(body.node.name));
  }

  /** Colour bodies by scores, and only those; whether one has another colour now. */
  color(tints: ReadonlyMap<string, number>): boolean {
    let other = false;
    for (let k = 0; k < this.list.length; k += 1) {
      const body = this.list[k]!;
      const before = body.tint;
      body.color(tints.get(body.node.name));
      if (body.tint !== before) other = true;
    }
    return other;
  }

  /** Colour the bodies that verdicts are about, and only those. */
  paint(verdicts: ReadonlyMap<string, Verdict | null>): void {
    for (let k = 0; k < this.list.length; k += 1) {
      const body = this.list[k]!;
      body.paint(verdicts.get(body.node.name));
    }
  }
}

function isEmpty(looks: Looks): boolean {
  for (const _ in looks) return false;
  return true;
}

const given = new Map<string, Uint8Array>();

/** A mesh that is here already, and that nobody is asked for: there is no server in a notebook. */
export function give(hash: string, glb: Uint8Array): void {
  given.set(hash, glb);
}

async function fetchModel(hash: string): Promise<Object3D> {
  const model = await new GLTFLoader().parseAsync(await meshOf(hash), "");
  return model.scene;
}

async function meshOf(hash: string): Promise<ArrayBuffer> {
  const here = given.get(hash);
  if (here) return here.slice().buffer;
  const response = await fetch(`/mesh/${encodeURIComponent(hash)}.glb`);
  if (!response.ok) throw new Error(`mesh ${hash}: ${response.status}`);
  return response.arrayBuffer();
}
