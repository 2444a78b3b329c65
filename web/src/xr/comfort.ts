// How a visitor stands and turns in the room; kept in this browser for the next time.

import { remembered } from "../remembered";

const CHOICES = ["off", "on"] as const;

/** Turning goes on while the stick is pushed, instead of by 30°. */
export const smooth = remembered("xr.smooth", CHOICES, "off");
/** Sight is narrowed while one turns or goes. */
export const vignette = remembered("xr.vignette", CHOICES, "on");
/** Eyes are put to a standing person's height. */
export const seated = remembered("xr.seated", CHOICES, "off");
/** Board and menu are at the right wrist, and the left hand points. */
export const leftHanded = remembered("xr.left_handed", CHOICES, "off");
/** A tone when a limit is crossed. */
export const sound = remembered("xr.sound", CHOICES, "off");

export const isOn = (choice: typeof smooth): boolean => choice.value === "on";

export function turnOver(choice: typeof smooth): void {
  choice.value = isOn(choice) ? "off" : "on";
}

/** A short tone: two of them, falling, so that it is no other device's. */
export function tone(): void {
  const audio = new AudioContext();
  const volume = audio.createGain();
  volume.gain.value = 0.15;
  volume.connect(audio.destination);
  [880, 660].forEach((hertz, k) => {
    const voice = audio.createOscillator();
    voice.frequency.value = hertz;
    voice.connect(volume);
    voice.start(audio.currentTime + 0.12 * k);
    voice.stop(audio.currentTime + 0.12 * (k + 1));
    if (k === 1) voice.onended = () => void audio.close();
  });
}
