// Play, pause, step, speed; or, while live, hold and follow.

import { formatTime } from "../format";
import { clock, isLive, lookingAt, mayControl, reach, scene, stale, transport } from "../page_state";
import { SPEEDS } from "../time_control";
import { said, word } from "../words";
import { useActions } from "./app_context";
import { Icon, type IconName } from "./Icon";

export function TransportBar() {
  const { time } = useActions();
  const { playing, speed, loop } = transport.value;
  const moving = isLive.value ? lookingAt.value === null : playing;
  return (
    <div class="transport" role="toolbar" aria-label={said("Time")}>
      <TransportButton
        icon="previous"
        title={said("Previous violation ([)")}
        act={() => time.violation(false)}
      />
      <TransportButton icon="back" title={said("One step back (←)")} act={() => time.step(-1)} />
      <TransportButton
        icon={moving ? "pause" : "play"}
        title={said(moving ? word("Pause (space)") : word("Play (space)"))}
        act={() => time.toggle()}
        strong
      />
      <TransportButton icon="ahead" title={said("One step ahead (→)")} act={() => time.step(1)} />
      <TransportButton icon="next" title={said("Next violation (])")} act={() => time.violation(true)} />
      <span class="clock">
        <strong>{formatTime(clock.value)}</strong>
        {!isLive.value && <span> / {formatTime(reach.value.end)}</span>}
      </span>
      {isLive.value ? (
        <button
          type="button"
          class={`live-button ${lookingAt.value === null && !stale.value ? "on" : ""}`}
          aria-pressed={lookingAt.value === null}
          title={said("Follow the newest (L)")}
          onClick={() => time.follow()}
        >
          <span class="dot" aria-hidden="true" /> LIVE
        </button>
      ) : (
        <>
          <select
            aria-label={said("Speed")}
            disabled={!mayControl.value}
            value={String(speed)}
            onChange={(event) => time.speed(Number(event.currentTarget.value))}
          >
            {speedsWith(speed).map((factor) => (
              <option key={factor} value={String(factor)}>
                {factor}×
              </option>
            ))}
          </select>
          <button
            type="button"
            class={loop ? "on" : ""}
            aria-pressed={loop}
            aria-label={said("Loop")}
            disabled={!mayControl.value}
            title={said("Start again at the end")}
            onClick={() => time.loop(!loop)}
          >
            <Icon name="loop" />
          </button>
        </>
      )}
      {!mayControl.value && <span class="only-look">{said("looks on: whoever may control it plays")}</span>}
      {lookingAt.value !== null && (
        <span class="behind">
          {said("{time} behind live", { time: formatTime(reach.value.end - lookingAt.value) })}
        </span>
      )}
      {scene.value && (
        <span class="tick">{said("tick {ms} ms", { ms: Math.round(scene.value.period * 1e5) / 100 })}</span>
      )}
    </div>
  );
}

function TransportButton(props: { icon: IconName; title: string; act: () => void; strong?: boolean }) {
  return (
    <button
      type="button"
      class={props.strong ? "strong" : ""}
      title={props.title}
      aria-label={props.title}
      disabled={!mayControl.value}
      onClick={props.act}
    >
      <Icon name={props.icon} />
    </button>
  );
}

function speedsWith(speed: number): readonly number[] {
  return (SPEEDS as readonly number[]).includes(speed) ? SPEEDS : [...SPEEDS, speed].sort((a, b) => a - b);
}
