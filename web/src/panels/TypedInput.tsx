// A field that keeps what is being typed, and what was typed last until the server has answered: an answer about
// another field comes in between.

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { asking } from "../editing/draft";

interface Props {
  id?: string | undefined;
  type?: "number";
  step?: number;
  list?: string | undefined;
  title?: string | undefined;
  placeholder?: string | undefined;
  inputMode?: "decimal" | undefined;
  "aria-label"?: string | undefined;
  "aria-invalid"?: true;
  /** What the file has. */
  value: string;
  /** Told when somebody has ended typing; the input is given too, with those beside it. */
  onEntered(text: string, input: HTMLInputElement): void;
}

export function TypedInput({ value, onEntered, ...others }: Props) {
  const typed = useSignal<string | null>(null);
  const entered = useSignal(false);
  const idle = !asking.value;
  useEffect(() => {
    if (!entered.value || !idle) return;
    entered.value = false;
    typed.value = null;
  }, [value, idle, entered.value]);
  return (
    <input
      type="text"
      {...others}
      value={typed.value ?? value}
      onInput={(event) => {
        typed.value = event.currentTarget.value;
        entered.value = false;
      }}
      onChange={(event) => {
        onEntered(event.currentTarget.value, event.currentTarget);
        entered.value = true;
      }}
    />
  );
}
