// Vectors are arrays of three, quaternions (w, x, y, z), rotations three rows world_from_camera.
const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
const mix = (a, b, w) => a.map((value, i) => value + (b[i] - value) * w);
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
const column = (rows, i) => [rows[0][i], rows[1][i], rows[2][i]];
const fromColumns = (x, y, z) => [0, 1, 2].map((i) => [x[i], y[i], z[i]]);
const apply = (rows, v) => rows.map((row) => dot(row, v));

// Rodrigues' formula.
function turned(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(scaled(v, c), scaled(cross(axis, v), s)), scaled(axis, dot(axis, v) * (1 - c)));
}

// Columns stay unit and at right angles: x from y and z, then y again.
function orthonormal(rows) {
  const z = unit(column(rows, 2)), x = unit(cross(column(rows, 1), z));
  return fromColumns(x, cross(z, x), z);
}
