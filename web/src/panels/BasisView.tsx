// Why a number is what it is: enough to defend it line by line.

import { formatNumber } from "../format";
import type { Basis, Input } from "../wire";
import { said } from "../words";

export function BasisView({ basis }: { basis: Basis }) {
  return (
    <div class="basis">
      <h3>{said("Basis")}</h3>
      <p class="formula">{basis.formula}</p>
      <p class="cited">{basis.source}</p>
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
              <li key={text}>{text}</li>
            ))}
          </ul>
        </>
      )}
    </div>
  );
}

function InputRow({ input }: { input: Input }) {
  const value = typeof input.value === "number" ? formatNumber(input.value) : (input.value ?? "–");
  return (
    <tr>
      <th scope="row">{input.name}</th>
      <td class="number">
        {value} <span class="unit">{input.unit}</span>
      </td>
      <td>
        <span class={`origin origin-${input.origin}`}>{input.origin}</span>
        {input.source !== "" && <span class="reason">{input.source}</span>}
      </td>
    </tr>
  );
}
