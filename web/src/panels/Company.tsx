// Who else looks at this twin: role, scale, what they hold; to follow them, and to ask them to follow.

import { calling, following, holders, others, ownName } from "../company";
import { said } from "../words";

export function Company() {
  const there = others.value;
  if (there.length === 0) return null;
  const caller = there.find(({ calls, id }) => calls && id !== following.value);
  return (
    <details class="company">
      <summary>
        <span aria-hidden="true">●</span> {said("{n} more here", { n: there.length })}
        {caller && (
          <span class="company-call"> · {said("{name} asks you to follow", { name: caller.name })}</span>
        )}
      </summary>
      <fieldset class="company-list" aria-label={said("Visitors")}>
        <ul>
          {there.map(({ id, name, color, role, scale, device, human, holds, recorded }) => (
            <li key={id}>
              <span aria-hidden="true" style={{ color }}>
                ●
              </span>
              <span class="company-name">
                {name}, {role}
                {human && ` as ${human}`}
                {device !== "desk" && ` (${device})`}
                {recorded && `, ${said("as recorded")}`}
                {scale !== 1 && ` ×${Number(scale.toPrecision(3))}`}
                {holds.length > 0 && `, ${said("holds {things}", { things: holds.join(", ") })}`}
              </span>
              <button
                type="button"
                aria-pressed={following.value === id}
                onClick={() => {
                  following.value = following.value === id ? null : id;
                }}
              >
                {following.value === id ? said("stop following") : said("follow")}
              </button>
            </li>
          ))}
        </ul>
        <label>
          {said("my name")}
          <input
            value={ownName.value}
            maxLength={40}
            onChange={(event) => {
              ownName.value = event.currentTarget.value.trim();
            }}
          />
        </label>
        <label>
          <input
            type="checkbox"
            checked={calling.value}
            onChange={(event) => {
              calling.value = event.currentTarget.checked;
            }}
          />
          {said("ask the others to follow me")}
        </label>
        {holders.value.size > 0 && <p>{said("What somebody holds, nobody else can change.")}</p>}
      </fieldset>
    </details>
  );
}
