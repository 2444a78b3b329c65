// What a device's own camera sees, where the browser hands it over (WebXR Raw Camera Access, `camera-access`):
// a picture that is aligned with a view, so that the view's projection is its lens and the view's pose its place.

/** Pixels of a picture at most, as the server takes it; larger ones are made smaller. */
const MOST_PIXELS = 1 << 20;

/** The part of `XRView` that not every browser has. */
interface Seeing extends XRView {
  readonly camera?: { readonly width: number; readonly height: number };
}
interface Binding {
  getCameraImage?: (camera: object) => WebGLTexture;
}

export interface Look {
  /** Grey, rows from above. */
  grey: Uint8Array<ArrayBuffer>;
  width: number;
  /** fx, fy, cx, cy [px]. */
  lens: [number, number, number, number];
  pose: XRRigidTransform;
}

/** fx, fy, cx and cy [px] of a picture, rows from above, that a projection (column by column) is aligned with. */
export function lensOf(projection: ArrayLike<number>, width: number, height: number): Look["lens"] {
  const p = (k: number): number => projection[k]!;
  return [(p(0) * width) / 2, (p(5) * height) / 2, ((1 - p(8)) * width) / 2, ((1 + p(9)) * height) / 2];
}

/**
 * Grey, rows from above, each pixel the mean of a square of `step` pixels.
 *
 * @param rgba Rows from below, as WebGL reads them.
 */
export function greyOf(
  rgba: Uint8Array,
  width: number,
  height: number,
  step: number,
): Uint8Array<ArrayBuffer> {
  const [across, up] = [Math.floor(width / step), Math.floor(height / step)];
  const grey = new Uint8Array(across * up);
  for (let y = 0; y < up; y += 1)
    for (let x = 0; x < across; x += 1) {
      let sum = 0;
      for (let j = 0; j < step; j += 1)
        for (let i = 0; i < step; i += 1) {
          const at = 4 * ((height - 1 - (y * step + j)) * width + x * step + i);
          sum += 0.299 * rgba[at]! + 0.587 * rgba[at + 1]! + 0.114 * rgba[at + 2]!;
        }
      grey[y * across + x] = Math.round(sum / (step * step));
    }
  return grey;
}

/** Whether a session hands over pictures; which of its views has one is known in its pictures alone. */
export function mayLook(session: XRSession): boolean {
  return session.enabledFeatures?.includes("camera-access") === true && "XRWebGLBinding" in globalThis;
}

/** What the camera sees in this picture of the session; null where none is handed over. */
export function look(
  session: XRSession,
  frame: XRFrame,
  space: XRReferenceSpace,
  gl: WebGL2RenderingContext,
): Look | null {
  const view = frame.getViewerPose(space)?.views.find((each) => (each as Seeing).camera);
  const camera = (view as Seeing | undefined)?.camera;
  if (!view || !camera || !mayLook(session)) return null;
  const texture = (new XRWebGLBinding(session, gl) as unknown as Binding).getCameraImage?.(camera);
  if (!texture) return null;
  const { width, height } = camera;
  const rgba = new Uint8Array(4 * width * height);
  const before = gl.getParameter(gl.FRAMEBUFFER_BINDING) as WebGLFramebuffer | null;
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, rgba);
  gl.bindFramebuffer(gl.FRAMEBUFFER, before);
  gl.deleteFramebuffer(framebuffer);
  const step = Math.ceil(Math.sqrt((width * height) / MOST_PIXELS));
  const across = Math.floor(width / step);
  const [fx, fy, cx, cy] = lensOf(view.projectionMatrix, width, height);
  return {
    grey: greyOf(rgba, width, height, step),
    width: across,
    // Corners are counted from the middle of the first pixel, not from its edge.
    lens: [fx / step, fy / step, cx / step - 0.5, cy / step - 0.5],
    pose: view.transform,
  };
}

/**
 * Corners of a board in a picture, as the server finds them.
 *
 * @returns Bytes for `Register.corners`, or why there are none.
 */
export async function cornersIn({ grey, width }: Look, board: string): Promise<Uint8Array | string> {
  const asked = new URLSearchParams({ board, width: String(width) });
  const answer = await fetch(`/board?${asked}`, { method: "POST", body: grey }).catch(() => null);
  if (!answer) return "the server does not answer";
  if (answer.status === 204) return "the board is not seen: show it whole and sharp";
  return answer.ok ? new Uint8Array(await answer.arrayBuffer()) : (await answer.text()).trim();
}
