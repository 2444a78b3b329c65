// The room: renderer, light, floor, and the one place where the world's z-up becomes the screen's y-up.

import {
  Color,
  DirectionalLight,
  Fog,
  Group,
  HemisphereLight,
  Mesh,
  NeutralToneMapping,
  NoToneMapping,
  PCFShadowMap,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  ShadowMaterial,
  WebGLRenderer,
} from "three";
import { Backdrop, type Standing } from "./backdrop";
import { drawnBySoftware, Sharpness } from "./effort";
import { makeGrid, recolorGrid } from "./grid";
import { keepLists } from "./render_list";
import { roomLook } from "./room_look";

/** Pictures per second below which pixels are made larger, and the largest of them, by processor and by graphics card. */
const LEAST_RATE = { software: 24, hardware: 45 };
const LEAST_SHARPNESS = { software: 0.6, hardware: 1 };
/** After so long without a picture the last one is drawn again as sharp as can be [ms]. */
const STILL_MS = 300;

export class Stage {
  readonly renderer: WebGLRenderer;
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(42, 1, 0.03, 120);
  /** What a person's eyes and hands hang on; moved and scaled when the person is. */
  readonly rig = new Group();
  /** Everything that is given in world coordinates: z up, metres. */
  readonly world = new Group();
  readonly grid = makeGrid();
  private readonly ground = new Color(roomLook.peek().ground);
  private readonly fog = new Fog(roomLook.peek().ground, 14, 40);
  /** Makes the projection, in place of one by the element's shape. */
  project: (() => void) | null = null;
  private dirty = true;
  private tickedAt = Number.NEGATIVE_INFINITY;
  /** What stands still, where it is drawn once while one looks from one place; null where all is drawn anew. */
  standing: Standing | null = null;
  private readonly backdrop: Backdrop;
  /** Told after each picture, while it can still be read. */
  drawn: (() => void) | null = null;
  private drawnAt = Number.NEGATIVE_INFINITY;
  private readonly sharpest: number;
  private readonly sharpness: Sharpness;

  constructor(readonly element: HTMLElement) {
    const light = drawnBySoftware();
    const kind = light ? "software" : "hardware";
    this.renderer = light ? opaque() : new WebGLRenderer({ antialias: true });
    keepLists(this.renderer);
    this.backdrop = new Backdrop(this.renderer);
    this.sharpest = Math.min(globalThis.devicePixelRatio, light ? 1 : 2);
    const least = Math.min(LEAST_SHARPNESS[kind], this.sharpest);
    this.sharpness = new Sharpness(this.sharpest, least, LEAST_RATE[kind]);
    this.renderer.setPixelRatio(this.sharpest);
    // Of light at corners every colour is shown as it is.
    this.renderer.toneMapping = light ? NoToneMapping : NeutralToneMapping;
    this.renderer.shadowMap.enabled = !light;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.renderer.shadowMap.autoUpdate = false;
    element.append(this.renderer.domElement);
    this.renderer.domElement.addEventListener("webglcontextrestored", () => {
      keepLists(this.renderer);
      this.refresh();
    });
    this.scene.background = this.ground;
    this.scene.fog = this.fog;
    this.world.rotation.x = -Math.PI / 2;
    this.rig.add(this.camera);
    this.scene.add(this.world, this.rig, this.grid);
    // Bodies bring their own light there, and a floor only shows shadows.
    if (!light) this.scene.add(...lights(), floor());
    new ResizeObserver(() => this.resize()).observe(element);
    this.resize();
  }

  /** Whether what stands still was not drawn anew for the last picture. */
  get keeps(): boolean {
    return this.standing !== null && this.backdrop.holds(this.standing);
  }

  /** Ask for a new picture; without being asked none is drawn. */
  invalidate(): void {
    this.dirty = true;
  }

  /** The bodies moved: their shadows are out of date. */
  moved(): void {
    this.renderer.shadowMap.needsUpdate = true;
    this.dirty = true;
  }

  /** Take the colours of the room as it looks now. */
  recolor(): void {
    const { ground } = roomLook.peek();
    this.ground.setHex(ground);
    this.fog.color.setHex(ground);
    recolorGrid(this.grid);
    this.refresh();
  }

  /** Ask for a picture in which everything is drawn anew: its colours, or where it is cut, are others. */
  refresh(): void {
    this.backdrop.forget();
    this.dirty = true;
  }

  /** Call `each` once per display frame, before drawing. */
  run(each: (time: number, frame?: XRFrame) => void): void {
    this.renderer.setAnimationLoop((time: number, frame?: XRFrame) => {
      each(time, frame);
      if (this.renderer.xr.isPresenting) {
        this.renderer.render(this.scene, this.camera);
        return;
      }
      // What comes after a picture waits for it.
      const following = this.drawnAt === this.tickedAt;
      if (following) this.sharpness.take(time - this.drawnAt, time);
      this.tickedAt = time;
      if (this.dirty) this.draw(following ? this.sharpness.ratio : this.sharpest, time);
      else if (time - this.drawnAt > STILL_MS && this.renderer.getPixelRatio() < this.sharpest)
        this.draw(this.sharpest, time);
    });
  }

  private draw(ratio: number, time: number): void {
    this.dirty = false;
    this.drawnAt = time;
    if (this.renderer.getPixelRatio() !== ratio) this.renderer.setPixelRatio(ratio);
    this.redraw();
  }

  /** Draw at once: what was drawn before is not kept. */
  redraw(): void {
    const { renderer, scene, camera, standing } = this;
    if (!(standing && this.backdrop.draw(scene, camera, standing))) renderer.render(scene, camera);
    this.drawn?.();
  }

  /**
   * What is drawn now, as a PNG file.
   *
   * @param anew Whether all of it is drawn, also what was kept.
   */
  picture(anew = false): Promise<Blob> {
    const { standing } = this;
    if (anew) this.standing = null;
    this.redraw();
    this.standing = standing;
    return new Promise((resolve, reject) => {
      this.renderer.domElement.toBlob((png) => (png ? resolve(png) : reject(new Error("no picture"))));
    });
  }

  /** Fit the element; what is seen in a headset has a size of its own. */
  resize(): void {
    const { clientWidth: width, clientHeight: height } = this.element;
    if (width === 0 || height === 0 || this.renderer.xr.isPresenting) return;
    this.camera.aspect = width / height;
    if (this.project) this.project();
    else this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height);
    // Drawn at once: a cleared canvas would flash.
    this.renderer.render(this.scene, this.camera);
  }
}

// Nothing lies behind it that the browser would have to blend it with.
function opaque(): WebGLRenderer {
  const canvas = document.createElement("canvas");
  const context = canvas.getContext("webgl2", { alpha: false, antialias: false, stencil: false });
  return new WebGLRenderer(context ? { canvas, context } : { antialias: false });
}

function lights(): (HemisphereLight | DirectionalLight)[] {
  const sky = new HemisphereLight(0xe8f0ff, 0x7d8592, 1.8);
  const key = new DirectionalLight(0xfff4e6, 2.1);
  key.position.set(2.6, 5, 3.2);
  key.castShadow = true;
  key.shadow.mapSize.set(1024, 1024);
  key.shadow.normalBias = 0.02;
  Object.assign(key.shadow.camera, { left: -3.5, right: 3.5, top: 3.5, bottom: -3.5, near: 0.5, far: 12 });
  const fill = new DirectionalLight(0xbfd4ff, 0.7);
  fill.position.set(-4, 2.5, -2);
  return [sky, key, fill];
}

function floor(): Mesh {
  const shade = new Mesh(new PlaneGeometry(16, 16), new ShadowMaterial({ opacity: 0.38 }));
  shade.rotation.x = -Math.PI / 2;
  shade.position.y = -0.001;
  shade.receiveShadow = true;
  return shade;
}
