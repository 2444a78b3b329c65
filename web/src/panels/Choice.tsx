// One of few, in a list that opens.

interface ChoiceProps<T extends string> {
  name: string;
  choices: readonly T[];
  chosen: { value: T };
  title?: (one: T) => string;
}

export function Choice<T extends string>({ name, choices, chosen, title = (one) => one }: ChoiceProps<T>) {
  return (
    <label>
      {name}{" "}
      <select
        value={chosen.value}
        onChange={(event) => {
          chosen.value = choices.find((one) => one === event.currentTarget.value) ?? chosen.value;
        }}
      >
        {choices.map((one) => (
          <option key={one} value={one}>
            {title(one)}
          </option>
        ))}
      </select>
    </label>
  );
}
