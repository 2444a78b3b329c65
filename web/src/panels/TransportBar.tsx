// Play, pause, step, speed; or, while live, hold and follow.

import { formatTime } from "../format";
import { isLive, lookingAt, mayControl, now, reach, scene, stale, transport } from "../page_state";
import { SPEEDS } from "../time_control";
import { useActions } from "./app_context";
import { Icon, type IconName } from "./Icon";

export function TransportBar() {
  const { time } = useActions();
  const { playing, speed, loop } = transport.value;
  const moving = isLive.value ? lookingAt.value === null : playing;
  return (
    <div class="transport" role="toolbar" aria-label="Time">
      <TransportButton icon="previous" title="Previous violation ([)" act={() => time.violation(false)} />
      <TransportButton icon="back" title="One step back (←)" act={() => time.step(-1)} />
      <TransportButton
        icon={moving ? "pause" : "play"}
        title={`${moving ? "Pause" : "Play"} (space)`}
        act={() => time.toggle()}
        strong
      />
      <TransportButton icon="ahead" title="One step ahead (→)" act={() => time.step(1)} />
      <TransportButton icon="next" title="Next violation (])" act={() => time.violation(true)} />
      <span class="clock">
        <strong>{formatTime(now.value)}</strong>
        {!isLive.value && <span> / {formatTime(reach.value.end)}</span>}
      </span>
      {isLive.value ? (
        <button
          type="button"
          class={`live-button ${lookingAt.value === null && !stale.value ? "on" : ""}`}
          aria-pressed={lookingAt.value === null}
          title="Follow the newest (L)"
          onClick={() => time.follow()}
        >
          <span class="dot" aria-hidden="true" /> LIVE
        </button>
      ) : (
        <>
          <select
            aria-label="Speed"
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
            aria-label="Loop"
            disabled={!mayControl.value}
            title="Start again at the end"
            onClick={() => time.loop(!loop)}
          >
            <Icon name="loop" />
          </button>
        </>
      )}
      {!mayControl.value && <span class="only-look">looks on: whoever may control it plays</span>}
      {lookingAt.value !== null && (
        <span class="behind">{formatTime(reach.value.end - lookingAt.value)} behind live</span>
      )}
      {scene.value && <span class="tick">tick {Math.round(scene.value.period * 1e5) / 100} ms</span>}
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
