// The pinhole camera (CAM-1 to CAM-3).

import { add, cross, normalize, scale, subtract } from "./vectors.mjs";

// CAM-1
export function cameraBasis(camera) {
  const forward = normalize(subtract(camera.look_at, camera.position));
  const right = normalize(cross(forward, camera.up));
  const up = cross(right, forward);
  const tanHalfFov = Math.tan((camera.vertical_fov_deg * Math.PI) / 180 / 2);
  return { position: camera.position, forward, right, up, tanHalfFov };
}

// CAM-2, CAM-3: the ray through the place (u, v) of the pixel (x, y).
export function cameraRay(basis, width, height, x, y, u, v) {
  const across = ((2 * (x + u) - width) / height) * basis.tanHalfFov;
  const upwards = ((height - 2 * (y + v)) / height) * basis.tanHalfFov;
  const sideways = add(basis.forward, scale(basis.right, across));
  return { origin: basis.position, direction: normalize(add(sideways, scale(basis.up, upwards))) };
}
