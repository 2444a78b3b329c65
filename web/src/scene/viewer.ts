// The middle of the page: bodies, markers and viewpoint, told by signals what to show.

import { effect, signal } from "@preact/signals";
import { Box3, type Mesh, type Object3D, Quaternion, type Raycaster, Vector3 } from "three";
import { following, others, showPresences } from "../company";
import type { PoseFeed } from "../connection";
import { doubts, doubtsIn } from "../doubts";
import { axisMarker, pointedAt } from "../editing/bringing";
import type { Form } from "../form";
import { Glide } from "../glide";
import { alike, MarkerLayer } from "../markers/layer";
import type { View } from "../markers/view";
import type { Frame, Shown, ShownResult, WrittenResult } from "../messages";
import {
  frame,
  hidden,
  mutedCriteria,
  overReality,
  scene as run,
  select,
  selectedNodes,
  selection,
  stale,
} from "../page_state";
import { manikinTints } from "../posture/coloring";
import { angleUnit, lengthUnit } from "../units";
import { camera, cameraShown, device } from "../view/camera";
import { measuring, type Normal, withFace } from "../view/measure";
import { followProbe, probe, probeAt, probing } from "../view/probe";
import { reaching } from "../view/reach";
import { sectionPlanes } from "../view/section";
import type { CameraInfo, Scene } from "../wire";
import { language } from "../words";
import { Bodies } from "./bodies";
import { CameraView } from "./camera_view";
import { Companions } from "./companions";
import { DoubtCaptions } from "./doubt_captions";
import { Gizmo } from "./gizmo";
import { recolor } from "./materials";
import { Outline } from "./outline";
import { nodeAlong, pickOnClick } from "./picking";
import { roomLook } from "./room_look";
import { Stage } from "./stage";
import { Viewpoint } from "./viewpoint";
import { hides } from "./volumes";

/** Criteria that are labelled in the room, and a room that has space for one. */
const LABELLED = 3;
const UNSEEN_LAYER = 29;
const NARROW_PX = 520;
/** Above and below the tools of the room. */
const TOOLS_MARGIN_PX = 20;

const NO_LOOKS = {};
const NONE: readonly unknown[] = [];
const UNPAINTED: ReadonlyMap<string, null> = new Map();

export const showCaptions = signal(true);
export const showGrid = signal(true);
/** Whether every volume with edges is drawn by those alone, also where it hides nothing of what is inside. */
export const outlinesOnly = signal(false);
/** Nodes whose mesh could not be fetched: they are there, but not to be seen. */
export const unseen = signal<readonly string[]>([]);

export class Viewer {
  readonly stage: Stage;
  readonly bodies = new Bodies();
  readonly markers = new MarkerLayer();
  readonly companions = new Companions();
  readonly viewpoint: Viewpoint;
  private readonly doubts = new DoubtCaptions(this.bodies);
  private readonly outline = new Outline(this.bodies);
  private readonly view: View;
  readonly gizmo: Gizmo;
  private readonly glide = new Glide();
  /** The camera through which one looks; null in the room. */
  private through: CameraView | null = null;
  private feed: PoseFeed | null = null;
  private frame: Shown | null = null;
  /** Heard, and shown as soon as the bodies are where it speaks of; with other numbers, if there are some. */
  private coming: Form | null = null;
  private numbers = new Float64Array();
  private filled = true;
  private tickedAt = Number.NEGATIVE_INFINITY;
  /** What the panels show, as far as it was written in the room. */
  private told: Frame | null = null;
  private posed = false;
  /** Whether bodies have moved since markers were drawn. */
  private moved = false;
  private labels = LABELLED;
  private doubted: Shown | null = null;
  // Made once: a picture allocates nothing of ours.
  private readonly results: ShownResult[] = [];
  private readonly written = { told: [] as WrittenResult[], selected: null as string | null, most: 0 };
  private framed = false;
  private dressed = false;

  constructor(element: HTMLElement) {
    this.stage = new Stage(element);
    this.stage.world.add(this.bodies.root, this.markers.root, this.doubts.root, this.companions.root);
    this.viewpoint = new Viewpoint(this.stage, this.bodies);
    this.view = { camera: this.stage.camera, pixel: 0, margins: true };
    this.gizmo = new Gizmo(this.stage, this.bodies, (free) => {
      this.viewpoint.controls.enabled = free;
    });
    pickOnClick(
      this.stage,
      this.bodies,
      (name, normal, point) => {
        const body = name === null ? undefined : this.bodies.byName.get(name);
        if (probing.peek() && body && point) {
          probeAt(body.node.name, point, body.group);
          this.probe();
        }
        if (name !== null)
          withFace(normal && this.inBody(name, normal), () => select({ kind: "node", name }));
        else if (!measuring.peek()) select(null);
      },
      () => this.gizmo.held,
    );
    this.follow();
    const tools = element.parentElement?.querySelector<HTMLElement>(".view-tools");
    const resized = new ResizeObserver(() => {
      if (tools) this.view.toolsPx = tools.offsetHeight + TOOLS_MARGIN_PX;
      // A phone that is turned.
      if (this.labelled() !== this.labels) this.draw();
      this.stage.invalidate();
    });
    for (const one of [element, tools]) if (one) resized.observe(one);
  }

  /** Show another scene; the viewpoint stays when one has been there before. */
  async begin(scene: Scene, feed: PoseFeed): Promise<void> {
    this.feed = feed;
    this.frame = null;
    this.coming = null;
    this.glide.clear();
    this.dressed = false;
    this.doubted = null;
    this.markers.update([], new Set(), { told: [], selected: null, most: 0 });
    unseen.value = await this.bodies.load(scene);
    if (feed !== this.feed) return;
    this.bodies.hide(hidden.peek());
    this.bodies.color(manikinTints.peek());
    this.emphasize();
    this.dressed = true;
    // What stands above bodies knows only now how high they are.
    this.draw();
    this.stage.moved();
  }

  /** @param numbers Other numbers than the form has; copied. */
  show(form: Form, numbers: Float64Array | null = null): void {
    // What the next picture replaces need not be drawn.
    if (this.coming && this.glide.moving) this.arrive();
    this.coming = form;
    this.filled = numbers === null;
    if (!numbers) return;
    if (this.numbers.length !== numbers.length) this.numbers = numbers.slice();
    else this.numbers.set(numbers);
  }

  /** Once per display frame, before drawing. */
  tick(time: number): void {
    const block = this.feed?.read();
    this.glide.drawnEvery = time - this.tickedAt;
    this.tickedAt = time;
    if (block) this.glide.take(block, this.feed!, time);
    if (block || this.glide.moving) {
      const shown = this.glide.at(time);
      if (shown) {
        const moved = this.bodies.pose(shown);
        if (!this.glide.moving) this.probe();
        this.posed = true;
        if (moved) {
          this.moved = true;
          this.gizmo.place();
          this.stage.moved();
        }
      }
    }
    if (this.coming && !this.glide.moving) this.arrive();
    if (!this.framed && this.posed && this.dressed) {
      this.framed = true;
      this.viewpoint.go("corner");
    }
    if (this.companions.tick(time)) this.stage.invalidate();
    if (!this.stage.renderer.xr.isPresenting) {
      if (this.through) this.through.tick();
      else {
        this.followVisitor();
        this.viewpoint.update();
      }
    }
    const { camera, element } = this.stage;
    this.view.pixel = (2 * Math.tan((camera.fov * Math.PI) / 360)) / Math.max(element.clientHeight, 1);
    this.view.margins = !this.stage.renderer.xr.isPresenting;
    camera.updateWorldMatrix(true, false);
    // Two figures for one thing at one instant would look like an error.
    const { told } = this;
    this.told = frame.peek();
    if (!alike(told, this.told)) this.draw();
    // Through a real camera and in a headset pixels have another size.
    const plain = this.view.margins && this.through === null;
    if (this.bodies.arrange(this.view, plain, time)) this.stage.invalidate();
    this.stage.standing = this.bodies.standing;
    this.fillVolumes();
    this.markers.face(this.view, this.doubts.captions);
  }

  /** Run time of the poses that bodies have [s]. */
  get posedT(): number {
    return this.glide.shownT;
  }

  /** Select the body that a ray of the world meets first, or nothing. */
  pick(ray: Raycaster): void {
    const name = nodeAlong(ray, this.bodies);
    select(name === null ? null : { kind: "node", name });
  }

  /** Pose of a body in three.js's own world, y up. */
  poseOf(name: string): { position: number[]; quaternion: number[] } | null {
    const group = this.bodies.byName.get(name)?.group;
    if (!group) return null;
    group.updateWorldMatrix(true, false);
    const position = group.getWorldPosition(new Vector3()).toArray();
    return { position, quaternion: group.getWorldQuaternion(new Quaternion()).toArray() };
  }

  /** A direction of a body's frame in the world, three.js's own; null for an unknown name. */
  turned(name: string, face: Normal): Normal | null {
    const group = this.bodies.byName.get(name)?.group;
    return group ? new Vector3(...face).transformDirection(group.matrixWorld).toArray() : null;
  }

  inBody(name: string, direction: Normal): Normal | null {
    const group = this.bodies.byName.get(name)?.group;
    if (!group) return null;
    return new Vector3(...direction).transformDirection(group.matrixWorld.clone().invert()).toArray();
  }

  /** Where a point of the world (z up) is on the screen [px]. */
  project(point: [number, number, number]): [number, number] {
    const { camera, world, element } = this.stage;
    camera.updateMatrixWorld();
    const at = world.localToWorld(new Vector3(...point)).project(camera);
    const box = element.getBoundingClientRect();
    return [box.left + ((at.x + 1) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
  }

  // Where bodies are between two instants is drawn, not known.
  private probe(): void {
    const probed = probe.peek();
    if (probed && this.feed) followProbe(this.feed.t, this.bodies.byName.get(probed.name)?.group);
  }

  /** Volumes with edges, of which one may be all that is seen. */
  private readonly volumes: Mesh[] = [];
  private readonly boxes: Box3[] = [];
  private readonly eye = new Vector3();
  private volumeCount = 0;
  private readonly addVolume = (part: Object3D): void => {
    if (part.userData.volume !== true) return;
    this.volumes[this.volumeCount] = part as Mesh;
    this.volumeCount += 1;
  };

  private findVolumes(): void {
    this.volumeCount = 0;
    this.stage.world.traverse(this.addVolume);
    this.volumes.length = this.volumeCount;
    while (this.boxes.length < this.volumes.length) this.boxes.push(new Box3());
    this.boxes.length = this.volumes.length;
  }

  /** Show volumes filled, or by their edges alone where they would hide what is inside: on a layer of no camera. */
  private fillVolumes(): void {
    if (this.volumes.length === 0) return;
    for (let k = 0; k < this.volumes.length; k += 1) {
      const { geometry, matrixWorld } = this.volumes[k]!;
      if (!geometry.boundingBox) geometry.computeBoundingBox();
      this.boxes[k]!.copy(geometry.boundingBox!).applyMatrix4(matrixWorld);
    }
    const eye = this.stage.camera.getWorldPosition(this.eye);
    for (let k = 0; k < this.volumes.length; k += 1) {
      const unseen = outlinesOnly.peek() || hides(this.boxes, k, eye);
      this.volumes[k]!.layers.set(unseen ? UNSEEN_LAYER : 0);
    }
  }

  private arrive(): void {
    const before = this.frame;
    const { shown } = this.coming!;
    const filled = !this.filled && this.coming!.fill(this.numbers);
    this.frame = shown;
    this.coming = null;
    // What hangs on bodies goes along with them.
    if (this.moved || filled || !alike(before, shown)) this.draw();
  }

  // On a phone there is no margin for more, and the table is right below.
  private labelled(): number {
    return this.stage.element.clientWidth < NARROW_PX ? 1 : LABELLED;
  }

  private draw(): void {
    this.moved = false;
    const chosen = selection.peek();
    const measured = measuring.peek()?.result;
    this.labels = this.labelled();
    const { results, written } = this;
    const asked = reaching.peek()?.result;
    const axis = axisMarker();
    let first = 0;
    for (let k = 0; k < 3; k += 1) {
      const one = k === 0 ? measured : k === 1 ? asked : axis;
      if (!one) continue;
      results[first] = written.told[first] = one;
      first += 1;
    }
    putFrom(results, first, this.frame?.results);
    putFrom(written.told, first, this.told?.results);
    written.selected = measured?.name ?? (chosen?.kind === "criterion" ? chosen.name : null);
    written.most = showCaptions.peek() ? this.labels : 0;
    this.markers.update(results, mutedCriteria.peek(), written);
    this.paint();
    this.findVolumes();
    this.bodies.wear(this.frame?.looks ?? NO_LOOKS);
    if (this.frame !== this.doubted) this.renew();
    this.doubts.update(run.peek(), doubts.peek(), showCaptions.peek() ? this.labels + 1 : 0);
    this.stage.invalidate();
  }

  /** Who is in doubt, and why, is of the form. */
  private renew(): void {
    this.doubted = this.frame;
    this.bodies.doubt(doubtsIn(this.frame));
  }

  // What may be out of date has no colour of a verdict.
  private paint(): void {
    this.bodies.paint(stale.peek() ? UNPAINTED : this.markers.painted);
  }

  // A body is bracketed, a whole robot or person only lit; a criterion shows itself by its markers.
  private emphasize(): void {
    const chosen = selection.peek();
    const names = selectedNodes.peek();
    this.bodies.light(chosen?.kind === "criterion" ? new Set() : names);
    this.outline.show(chosen?.kind === "node" ? names : new Set());
    this.stage.invalidate();
  }

  /** Look through a real camera, or no more. */
  private lookThrough(info: CameraInfo | null): void {
    this.through?.end();
    this.through = null;
    const { stage, bodies } = this;
    const number = cameraShown.peek();
    if (info && number !== null && !stage.renderer.xr.isPresenting) {
      following.value = null;
      this.through = new CameraView(stage, bodies, info, number);
    }
    this.viewpoint.controls.enabled = this.through === null;
    stage.moved();
  }

  /** Look with the eyes of the visitor whom one follows. */
  private followVisitor(): void {
    const id = following.peek();
    const head = id === null ? null : this.companions.limbsOf(id)?.[0];
    if (head?.visible) this.viewpoint.lookWith(head);
  }

  private follow(): void {
    showPresences((presences) => {
      this.companions.take(presences);
      this.stage.invalidate();
    });
    this.viewpoint.controls.addEventListener("start", () => {
      following.value = null;
    });
    effect(() => {
      // Another device is another picture.
      void device.value;
      this.lookThrough(camera.value);
    });
    effect(() => {
      this.companions.list(others.value);
      this.stage.invalidate();
    });
    effect(() => {
      void [selection.value, selectedNodes.value];
      this.emphasize();
    });
    effect(() => {
      void roomLook.value;
      recolor();
      this.stage.recolor();
    });
    effect(() => {
      this.bodies.hide(hidden.value);
      this.stage.moved();
    });
    effect(() => {
      this.bodies.overReality(overReality.value);
      this.stage.moved();
    });
    effect(() => {
      void outlinesOnly.value;
      this.stage.invalidate();
    });
    effect(() => {
      this.stage.renderer.clippingPlanes = sectionPlanes();
      this.stage.refresh();
    });
    effect(() => {
      this.stage.grid.visible = showGrid.value && !overReality.value;
      this.stage.invalidate();
    });
    effect(() => {
      // Read to be told of changes.
      void [mutedCriteria.value, selection.value, showCaptions.value, measuring.value, reaching.value];
      void pointedAt.value;
      void [language.value, lengthUnit.value, angleUnit.value];
      this.markers.rewrite();
      this.draw();
    });
    effect(() => {
      if (this.bodies.color(manikinTints.value)) this.stage.invalidate();
    });
    effect(() => {
      this.markers.root.visible = !stale.value;
      this.paint();
      this.stage.invalidate();
    });
  }
}

/** What a list has from some place on. An array that is emptied first would be made anew. */
function putFrom<T>(list: T[], first: number, others: readonly T[] = NONE as readonly T[]): void {
  for (let k = 0; k < others.length; k += 1) list[first + k] = others[k]!;
  list.length = first + others.length;
}
