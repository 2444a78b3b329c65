// Under the tools of the room, while one looks through a camera: how well the twin lies over its picture.

import { figure, withUnit } from "../figures";
import { camera, device, devices, pictureMistake } from "../view/camera";
import { said } from "../words";

export function CameraNote() {
  const shown = camera.value;
  if (!shown) return null;
  const { name, mistake, error, tool, error_px, fetched } = shown;
  const why = mistake || pictureMistake.value;
  return (
    <output class="measure-note camera-note">
      <strong>{name}</strong>
      {why ? (
        <span class="camera-mistake">
          {said("the twin is not drawn over it")}: {why}
        </span>
      ) : (
        <span>
          {said("95 % of its error at {tool}: within {error}", {
            tool,
            error: withUnit(figure(error ?? Number.NaN, "m"), "m"),
          })}
          {error_px !== null && ` (${error_px.toFixed(2)} px)`}
        </span>
      )}
      <span>{said("older than the twin by what its camera takes")}</span>
      {!fetched && devices.value.length > 1 && (
        <select
          aria-label={said("Camera of this device")}
          value={device.value}
          onChange={(event) => {
            device.value = event.currentTarget.value;
          }}
        >
          {devices.value.map(({ id, label }) => (
            <option key={id} value={id}>
              {label}
            </option>
          ))}
        </select>
      )}
    </output>
  );
}
