// The room as a real camera sees it: its picture behind the twin, which is drawn through the same lens.
//
// The picture is straightened where it is drawn: each pixel of the screen is a ray of a camera without distortion
// (fx, fy, cx, cy), which the distortion of Brown and Conrady, as OpenCV has it, leads to a pixel of the picture.
// So nothing has to be inverted, and bodies need no distortion of their own. OpenCV's pixel (0, 0) is the middle
// of the first one.

import {
  BufferAttribute,
  BufferGeometry,
  LinearFilter,
  Matrix4,
  Mesh,
  ShaderMaterial,
  SRGBColorSpace,
  Texture,
  Vector2,
  Vector3,
  Vector4,
} from "three";
import { overReality } from "../page_state";
import { pictureMistake } from "../view/camera";
import type { CameraInfo } from "../wire";
import type { Bodies } from "./bodies";
import { type Pictures, picturesOf } from "./camera_pictures";
import type { Stage } from "./stage";

/** Before everything else: bodies that only hide what is behind them come next. */
const FIRST = -2;
const OUTSIDE = 0x10151c;

const VERTEX = `
void main() { gl_Position = vec4(position.xy, 1.0, 1.0); }`;
const FRAGMENT = `
uniform sampler2D picture;
uniform vec2 size, screen, corner;
uniform vec4 pinhole;
uniform vec3 radial;
uniform vec2 tangential;
uniform float scale, farthest, faded;
uniform vec3 outside;
void main() {
  // Pixel of a picture without distortion, v down.
  vec2 at = (vec2(gl_FragCoord.x, screen.y - gl_FragCoord.y) - corner) / scale - 0.5;
  vec2 p = (at - pinhole.zw) / pinhole.xy;
  float r = dot(p, p);
  float k = 1.0 + r * (radial.x + r * (radial.y + r * radial.z));
  vec2 d = p * k + vec2(
    2.0 * tangential.x * p.x * p.y + tangential.y * (r + 2.0 * p.x * p.x),
    tangential.x * (r + 2.0 * p.y * p.y) + 2.0 * tangential.y * p.x * p.y);
  vec2 uv = (d * pinhole.xy + pinhole.zw + 0.5) / size;
  bool there = r < farthest && all(greaterThanEqual(uv, vec2(0.0))) && all(lessThanEqual(uv, vec2(1.0)));
  gl_FragColor = vec4(there ? texture2D(picture, vec2(uv.x, 1.0 - uv.y)).rgb * faded : outside, 1.0);
  #include <colorspace_fragment>
}`;

/** Square of the radius up to which the distortion grows with it: beyond, two rays would come to one pixel. */
export function farthest([, , , , k1, k2, , , k3]: CameraInfo["lens"]): number {
  for (let r = 0; r < 16; r += 0.01) if (1 + r * (3 * k1 + r * (5 * k2 + r * 7 * k3)) <= 0) return r;
  return 16;
}

export class CameraView {
  private readonly pictures: Pictures;
  private readonly texture = new Texture();
  private readonly material: ShaderMaterial;
  private readonly wall: Mesh;
  private readonly before: () => void;
  private readonly fromPlace = new Matrix4();
  private readonly pose = new Matrix4();
  private readonly scaled = new Vector3();

  constructor(
    private readonly stage: Stage,
    private readonly bodies: Bodies,
    readonly info: CameraInfo,
    number: number,
  ) {
    const [fx, fy, cx, cy, k1, k2, p1, p2, k3] = info.lens;
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.minFilter = this.texture.magFilter = LinearFilter;
    this.texture.generateMipmaps = false;
    this.material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      depthTest: false,
      depthWrite: false,
      toneMapped: false,
      uniforms: {
        picture: { value: this.texture },
        size: { value: new Vector2(...info.size) },
        screen: { value: new Vector2(1, 1) },
        corner: { value: new Vector2() },
        scale: { value: 1 },
        pinhole: { value: new Vector4(fx, fy, cx, cy) },
        radial: { value: new Vector3(k1, k2, k3) },
        tangential: { value: new Vector2(p1, p2) },
        farthest: { value: farthest(info.lens) },
        faded: { value: 0 },
        outside: { value: [16, 8, 0].map((bits) => (((OUTSIDE >> bits) & 255) / 255) ** 2.2) },
      },
    });
    const all = new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3);
    this.wall = new Mesh(new BufferGeometry().setAttribute("position", all), this.material);
    this.wall.renderOrder = FIRST;
    this.wall.frustumCulled = false;
    this.wall.raycast = () => {};
    stage.scene.add(this.wall);
    this.before = this.remember();
    this.pictures = picturesOf(info, number, () => stage.invalidate());
    stage.resize();
  }

  /** Once per display frame, before drawing. */
  tick(): void {
    const picture = this.pictures.take();
    const { mistake } = this.pictures;
    if (picture) {
      this.texture.image = picture;
      // A bitmap was turned over when it was decoded; a video is when it is handed to the graphics card.
      this.texture.flipY = picture instanceof HTMLVideoElement;
      this.texture.needsUpdate = true;
    }
    const { uniforms } = this.material;
    // What is not of the present looks so.
    const faded = !this.texture.image ? 0 : mistake ? 0.35 : 1;
    if (uniforms["faded"]!.value !== faded) {
      uniforms["faded"]!.value = faded;
      this.stage.invalidate();
    }
    pictureMistake.value = mistake;
    const { place } = this.info;
    // A twin that may be anywhere, or over the past, is not drawn.
    this.stage.world.visible = place != null && this.info.mistake === "" && mistake === "";
    if (!place) return;
    const { camera, world } = this.stage;
    const [w, x, y, z] = place.wxyz ?? [1, 0, 0, 0];
    camera.quaternion.set(x, y, z, w);
    this.fromPlace.compose(this.scaled.fromArray(place.position), camera.quaternion, ONE);
    const node = place.node ? this.bodies.byName.get(place.node)?.group : undefined;
    const carrier = node ?? world;
    carrier.updateWorldMatrix(true, false);
    // OpenCV looks along z with y down, three.js along −z with y up.
    this.pose.copy(carrier.matrixWorld).multiply(this.fromPlace).multiply(TURNED);
    this.pose.decompose(camera.position, camera.quaternion, this.scaled);
  }

  end(): void {
    this.pictures.close();
    this.stage.scene.remove(this.wall);
    this.wall.geometry.dispose();
    this.material.dispose();
    this.texture.dispose();
    pictureMistake.value = "";
    this.before();
    this.stage.resize();
  }

  /** The projection of the lens without its distortion, with all of the picture's frame on the screen. */
  private project(): void {
    const { camera, renderer, element } = this.stage;
    const [fx, fy, cx, cy] = this.info.lens;
    const [w, h] = this.info.size;
    const { clientWidth: W, clientHeight: H } = element;
    const s = Math.min(W / w, H / h);
    const [left, top] = [(W - s * w) / 2, (H - s * h) / 2];
    const { near, far } = camera;
    camera.fov = (360 / Math.PI) * Math.atan(H / (2 * s * fy));
    camera.projectionMatrix.set(
      (2 * s * fx) / W,
      0,
      1 - (2 * (s * (cx + 0.5) + left)) / W,
      0,
      0,
      (2 * s * fy) / H,
      (2 * (s * (cy + 0.5) + top)) / H - 1,
      0,
      0,
      0,
      (near + far) / (near - far),
      (2 * near * far) / (near - far),
      0,
      0,
      -1,
      0,
    );
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
    this.wall.onBeforeRender = () => {
      // Pixels of the screen are larger where drawing takes long.
      const ratio = renderer.getPixelRatio();
      const { uniforms } = this.material;
      renderer.getDrawingBufferSize(uniforms["screen"]!.value);
      uniforms["corner"]!.value.set(left * ratio, top * ratio);
      uniforms["scale"]!.value = s * ratio;
    };
  }

  private remember(): () => void {
    const { stage } = this;
    const { camera, scene } = stage;
    const { fov } = camera;
    const [position, turn] = [camera.position.clone(), camera.quaternion.clone()];
    const { fog } = scene;
    const over = overReality.peek();
    scene.fog = null;
    overReality.value = true;
    stage.project = () => this.project();
    return () => {
      scene.fog = fog;
      overReality.value = over;
      stage.project = null;
      stage.world.visible = true;
      camera.fov = fov;
      camera.position.copy(position);
      camera.quaternion.copy(turn);
    };
  }
}

const ONE = new Vector3(1, 1, 1);
const TURNED = new Matrix4().makeScale(1, -1, -1);
