// What stands still while one looks from one place: drawn once and kept, with its depth, so that a line of a million
// triangles costs a picture no more than what moves before it and behind it.

import {
  type Camera,
  type Object3D,
  type Scene,
  SRGBColorSpace,
  type WebGLRenderer,
  WebGLRenderTarget,
} from "three";

/** Layer of what is drawn to be kept, besides the one that cameras see. */
const STANDING_LAYER = 27;
const show = ({ layers }: Object3D): void => layers.enable(STANDING_LAYER);
const unshow = ({ layers }: Object3D): void => layers.disable(STANDING_LAYER);

/** What stands still. */
export interface Standing {
  /** All of it is below. */
  readonly root: Object3D;
  /** Another number whenever it looks different from where one looks. */
  readonly version: number;
  /** Whether it is so much that it pays to keep it. */
  readonly heavy: boolean;
}

export class Backdrop {
  private kept: WebGLRenderTarget | null = null;
  private whole: WebGLRenderTarget | null = null;
  /** What stood still at the picture before, and in the one that is kept. */
  private before = -1;
  private version = -1;

  constructor(private readonly renderer: WebGLRenderer) {
    // What the graphics card had is lost with it.
    renderer.domElement.addEventListener("webglcontextrestored", () => this.dispose());
  }

  /** Keep nothing of before: colours or cuts are others. */
  forget(): void {
    this.version = -1;
  }

  /** Whether what stands still is kept as it looks now. */
  holds({ version, heavy }: Standing): boolean {
    return heavy && this.version === version;
  }

  /**
   * Draw a scene with what was kept.
   *
   * @returns Whether it was drawn; not where things look different from picture to picture, or are few.
   */
  draw(scene: Scene, camera: Camera, { root, version, heavy }: Standing): boolean {
    const same = version === this.before;
    this.before = version;
    if (!same || !heavy) return false;
    const { renderer } = this;
    const { width, height } = renderer.domElement;
    if (this.kept?.width !== width || this.kept.height !== height) {
      this.dispose();
      this.kept = target(width, height);
      this.whole = target(width, height);
    }
    const [kept, whole] = [this.kept!, this.whole!];
    const { background } = scene;
    const { mask } = camera.layers;
    if (this.version !== version) {
      // Asked for now: what moves may have stood before, and is not to be seen where it was.
      root.traverse(show);
      camera.layers.set(STANDING_LAYER);
      renderer.setRenderTarget(kept);
      renderer.render(scene, camera);
      camera.layers.mask = mask;
      root.traverse(unshow);
      this.version = version;
    }
    renderer.initRenderTarget(whole);
    this.copy(kept, whole);
    renderer.setRenderTarget(whole);
    scene.background = null;
    renderer.autoClear = false;
    root.visible = false;
    renderer.render(scene, camera);
    root.visible = renderer.autoClear = true;
    scene.background = background;
    this.copy(whole, null);
    renderer.setRenderTarget(null);
    return true;
  }

  private copy(from: WebGLRenderTarget, to: WebGLRenderTarget | null): void {
    const { state, properties } = this.renderer;
    const gl = this.renderer.getContext() as WebGL2RenderingContext;
    const { width, height } = from;
    const buffer = (one: WebGLRenderTarget | null): WebGLFramebuffer | null =>
      one && (properties.get(one) as { __webglFramebuffer: WebGLFramebuffer }).__webglFramebuffer;
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, buffer(from));
    state.bindFramebuffer(gl.DRAW_FRAMEBUFFER, buffer(to));
    gl.disable(gl.SCISSOR_TEST);
    const what = to ? gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT : gl.COLOR_BUFFER_BIT;
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, what, gl.NEAREST);
    state.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  dispose(): void {
    this.kept?.dispose();
    this.whole?.dispose();
    this.kept = this.whole = null;
    this.version = -1;
  }
}

// Colours as on the screen, not linear ones in eight bits: as three.js itself draws for a headset.
function target(width: number, height: number): WebGLRenderTarget {
  const made = new WebGLRenderTarget(width, height, { colorSpace: SRGBColorSpace, generateMipmaps: false });
  return Object.assign(made, { isXRRenderTarget: true });
}
