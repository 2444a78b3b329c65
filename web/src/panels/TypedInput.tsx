// A field that keeps what is being typed, what was typed last until the server has answered, and what was not taken
// as long as something beside it says why.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { asking } from "../editing/draft";

interface Look {
  id?: string | undefined;
  type?: "number";
  step?: number;
  list?: string | undefined;
  title?: string | undefined;
  placeholder?: string | undefined;
  inputMode?: "decimal" | undefined;
  "aria-label"?: string | undefined;
}

interface Props extends Look {
  /** Whether something beside it says what is wrong with it. */
  bad?: boolean;
  /** What the file has. */
  value: string;
  /** Told when somebody has ended typing. */
  onEntered(text: string, input: HTMLInputElement): void;
}

export function TypedInput({ value, bad = false, onEntered, ...look }: Props) {
  return (
    <TypedInputs
      values={[value]}
      looks={[look]}
      bad={bad}
      onEntered={([text], input) => onEntered(text!, input)}
    />
  );
}

interface Several {
  values: readonly string[];
  looks: readonly Look[];
  bad: boolean;
  /** Told what stands in all of them when somebody has ended typing in one. */
  onEntered(texts: string[], input: HTMLInputElement): void;
}

/** What becomes of what is typed: still typed, waits for the server, or neither. */
type Phase = "typing" | "waits" | "rests";

/** Fields of one value, side by side. */
export function TypedInputs({ values, looks, bad, onEntered }: Several) {
  const typed = useSignal<readonly (string | undefined)[]>([]);
  const phase = useSignal<Phase>("rests");
  /** How it was before somebody began to type. */
  const before = useSignal<{ typed: readonly (string | undefined)[]; phase: Phase } | null>(null);
  const idle = !asking.value;
  const file = JSON.stringify(values);
  // Effects come later than what they were made for: somebody may be typing again by then.
  const shown = phase.value;
  useEffect(() => {
    if (phase.value !== shown) return;
    if (shown === "waits" && idle) phase.value = "rests";
    if (shown === "rests" && !bad) typed.value = [];
  }, [file, idle, bad, shown]);
  useEffect(() => {
    if (shown === "rests" && phase.value === "rests") typed.value = [];
  }, [file]);
  const texts = values.map((value, k) => typed.value[k] ?? value);
  return (
    <>
      {texts.map((text, k) => (
        <input
          key={k}
          type="text"
          {...looks[k]}
          {...(bad && { "aria-invalid": true as const })}
          value={text}
          onInput={(event) => {
            if (phase.value !== "typing") before.value = { typed: typed.value, phase: phase.value };
            phase.value = "typing";
            typed.value = values.map((_, i) => (i === k ? event.currentTarget.value : typed.value[i]));
          }}
          onChange={(event) => {
            phase.value = "waits";
            before.value = null;
            const all = texts.map((one, i) => (i === k ? event.currentTarget.value : one));
            onEntered(all, event.currentTarget);
          }}
          onBlur={() => {
            // Typed and taken away again: the browser tells of no change.
            if (phase.value !== "typing" || !before.value) return;
            typed.value = before.value.typed;
            phase.value = before.value.phase;
          }}
        />
      ))}
    </>
  );
}
