// Why a number is what it is: enough to defend it line by line.

import { formatNumber } from "../format";
import { spoken } from "../units";
import type { Basis, Input } from "../wire";
import { said, word } from "../words";

export const ORIGINS: Record<string, string> = {
  measured: word("measured"),
  stated: word("stated"),
  given: word("given"),
  computed: word("computed"),
  estimated: word("estimated"),
  choice: word("choice"),
  assumed: word("assumed"),
  missing: word("missing"),
};

export function BasisView({ basis }: { basis: Basis }) {
  return (
    <div class="basis">
      <h3>{said("Basis")}</h3>
      <p class="formula">{spoken(basis.formula)}</p>
      <p class="cited">{spoken(basis.source)}</p>
      {basis.inputs.length > 0 && (
        <table class="inputs">
          <caption>{said("Inputs")}</caption>
          <tbody>
            {basis.inputs.map((input, i) => (
              <InputRow key={i} input={input} />
            ))}
          </tbody>
        </table>
      )}
      {basis.not_modelled.length > 0 && (
        <>
          <h3>{said("Not modelled")}</h3>
          <ul class="not-modelled">
            {basis.not_modelled.map((text) => (
              <li key={text}>{spoken(text)}</li>
            ))}
          </ul>
        </>
      )}
    </div>
  );
}

/** A word may be told otherwise beside its name than alone. */
function pair(name: string, text: string): readonly [string, string] {
  const [whole, both] = [`${name}: ${text}`, said(`${name}: ${text}`)];
  const end = both.lastIndexOf(": ");
  return both === whole ? [label(name), spoken(text)] : [both.slice(0, end), both.slice(end + 2)];
}

/** What an input is called: never by a name of the file alone, so that a single word can be told. */
const label = (name: string) => (said(name) === name ? spoken(name) : said(name));

function InputRow({ input }: { input: Input }) {
  const [name, value] =
    typeof input.value === "number"
      ? [label(input.name), formatNumber(input.value)]
      : pair(input.name, input.value ?? "");
  return (
    <tr>
      <th scope="row">{name}</th>
      <td class="number">
        {value || "–"} <span class="unit">{input.unit}</span>
      </td>
      <td>
        <span class={`origin origin-${input.origin}`}>{said(ORIGINS[input.origin] ?? input.origin)}</span>
        {input.source !== "" && <span class="reason">{spoken(input.source)}</span>}
      </td>
    </tr>
  );
}
