// A WebXR session that offers what the headset sees; whoever shows the twin inside it does so beside this.

import type { Tracking } from "../wire";
import { sight } from "./sight";

const WANTED: XRSessionInit = {
  requiredFeatures: ["local-floor"],
  optionalFeatures: ["hand-tracking", "body-tracking"],
};

/** The kind of session that this browser can begin: through the glasses if it can; null for none. */
export async function sessionMode(): Promise<XRSessionMode | null> {
  if (!navigator.xr) return null;
  for (const mode of ["immersive-ar", "immersive-vr"] as const)
    if (await navigator.xr.isSessionSupported(mode).catch(() => false)) return mode;
  return null;
}

export class Offering {
  private handle = 0;

  private constructor(
    readonly session: XRSession,
    private readonly space: XRReferenceSpace,
    private readonly human: string,
    private readonly send: (tracking: Tracking) => void,
  ) {
    this.handle = session.requestAnimationFrame(this.picture);
    session.addEventListener("end", () => session.cancelAnimationFrame(this.handle));
  }

  /** Begin a session; only a press of the user may. */
  static async begin(human: string, send: (tracking: Tracking) => void): Promise<Offering> {
    const mode = await sessionMode();
    if (!mode || !navigator.xr) throw new Error("this browser has no headset");
    const session = await navigator.xr.requestSession(mode, WANTED);
    return Offering.during(session, human, send);
  }

  /** Offer what a session that runs already sees. */
  static async during(
    session: XRSession,
    human: string,
    send: (tracking: Tracking) => void,
  ): Promise<Offering> {
    return new Offering(session, await session.requestReferenceSpace("local-floor"), human, send);
  }

  private readonly picture = (t: number, frame: XRFrame): void => {
    this.handle = this.session.requestAnimationFrame(this.picture);
    const seen = sight(frame, this.space, this.session.inputSources, this.human, t);
    if (seen) this.send(seen);
  };
}
