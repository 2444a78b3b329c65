// What the file's checks say, beside what it is about.

import type { Mistake } from "../wire";

export function MistakeList({ mistakes, keys = false }: { mistakes: readonly Mistake[]; keys?: boolean }) {
  return (
    <>
      {mistakes.map(({ key, what, remedy }) => (
        <p class="mistake" key={`${key} ${what}`}>
          {keys && key !== "" && <code>{key}</code>} {what}
          {remedy !== "" && <span class="remedy">; {remedy}</span>}
        </p>
      ))}
    </>
  );
}
