// What the panels may ask for beyond the signals: time and viewpoint.

import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Preset } from "../scene/viewpoint";
import type { TimeControl } from "../time_control";
import type { EndFilm } from "../view/film";
import type { SavedView } from "../view/kept";
import type { Taught } from "../wire";
import type { Mode } from "../xr/visit";

export interface Actions {
  time: TimeControl;
  /** Go to a viewpoint. */
  look(preset: Preset): void;
  /** Enter the room with a headset: as a person of the twin, or to look (null). */
  enter(mode: Mode, human: string | null): Promise<XRSession>;
  /** Save where one looks from. */
  keepView(): void;
  goTo(view: SavedView): void;
  picture(): Promise<Blob>;
  /** Film the room until the answer is called; null where this browser cannot. */
  film(): Promise<EndFilm | null>;
  /** Where the tool point of a robot is, as the file writes a place of it; null where it is not shown. */
  toolPoint(of: Taught): { position: number[]; rpy_deg: number[] } | null;
  /** Fill the view with the selection, or with everything. */
  frameSelection(): void;
}

export const ActionsContext = createContext<Actions | null>(null);

export function useActions(): Actions {
  const actions = useContext(ActionsContext);
  if (!actions) throw new Error("panel outside of the page");
  return actions;
}
