// 4 x 4 matrices in column-major order for WebGL.

export function product(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column += 1) {
    for (let row = 0; row < 4; row += 1) {
      let sum = 0;
      for (let k = 0; k < 4; k += 1) sum += a[4 * k + row] * b[4 * column + k];
      out[4 * column + row] = sum;
    }
  }
  return out;
}

/** Perspective projection from the tangents of half the field of view. */
export function perspective(tanX, tanY, near, far) {
  const out = new Float32Array(16);
  out[0] = 1 / tanX;
  out[5] = 1 / tanY;
  out[10] = (far + near) / (near - far);
  out[11] = -1;
  out[14] = (2 * far * near) / (near - far);
  return out;
}

/** View matrix from `eye` towards `target`, +z up. */
export function looking(eye, target) {
  const back = unit(minus(eye, target));
  const right = unit(cross([0, 0, 1], back));
  return rigid(right, cross(back, right), back, eye);
}

/** View matrix of a camera (x right, y down, z forward); `pose` is sandbox_from_camera, 16 numbers, row-major. */
export function throughCamera(pose) {
  const axis = (column, sign) => [0, 1, 2].map((row) => sign * pose[4 * row + column]);
  return rigid(axis(0, 1), axis(1, -1), axis(2, -1), [pose[3], pose[7], pose[11]]);
}

function rigid(x, y, z, eye) {
  return Float32Array.from([x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, -dot(x, eye), -dot(y, eye), -dot(z, eye), 1]);
}

/** Normalised device coordinates of a point and w, which is positive in front of the camera. */
export function project(matrix, [x, y, z]) {
  const at = (row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] * z + matrix[12 + row];
  const w = at(3);
  return [at(0) / w, at(1) / w, at(2) / w, w];
}

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const minus = (a, b) => a.map((value, k) => value - b[k]);
export const plus = (a, b, scale = 1) => a.map((value, k) => value + scale * b[k]);
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export function unit(a) {
  const length = Math.hypot(...a) || 1;
  return a.map((value) => value / length);
}
