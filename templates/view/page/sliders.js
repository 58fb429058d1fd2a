// An editable pose: a slider for each tree joint coordinate; the others keep the loops closed.
const { sliders } = about;
const CLOSED = 1e-10, ROUNDS = 25, DAMPING = 1e-12, LONGEST_STEP = 0.05;

/** q (+) delta: scalars add, a quaternion is rotated by (1, theta/2). */
function retract(q, delta) {
  const moved = q.slice();
  for (const chart of sliders.charts) {
    for (let i = 0; i < chart.scalars; i++) moved[chart.q + i] += delta[chart.v + i];
    if (!chart.ball) continue;
    const at = chart.q + chart.scalars, [x, y, z] = [0, 1, 2].map((i) => delta[chart.v + chart.scalars + i] / 2), [a, b, c, d] = q.slice(at, at + 4);
    const e = [a - x * b - y * c - z * d, x * a + b - z * c + y * d, y * a + z * b + c - x * d, z * a - y * b + x * c + d];
    const size = Math.hypot(...e);
    e.forEach((value, i) => { moved[at + i] = value / size; });
  }
  return moved;
}

const speeds = () => Math.max(0, ...sliders.charts.map((c) => c.v + c.scalars + 3 * c.ball));

/** The columns of the residual's Jacobian by finite differences, zero for the fixed velocity. */
function jacobian(q, residual, fixed) {
  const n = speeds(), step = 1e-7;
  return Array.from({ length: n }, (_, k) => {
    if (k === fixed) return residual.map(() => 0);
    const delta = new Array(n).fill(0);
    delta[k] = step;
    return Mechanism.residual(retract(q, delta)).map((value, i) => (value - residual[i]) / step);
  });
}

/** x of (J^T J + damping) x = -J^T residual, by Cholesky's factors. */
function solve(columns, residual) {
  const n = columns.length, dot = (a, b) => a.reduce((sum, value, i) => sum + value * b[i], 0);
  const gram = columns.map((a) => columns.map((b) => dot(a, b)));
  const damping = DAMPING * Math.max(...gram.map((row, i) => row[i])) || 1;
  const L = gram.map((row) => row.map(() => 0)), x = columns.map((a) => -dot(a, residual));
  for (let i = 0; i < n; i++)
    for (let j = 0; j <= i; j++) {
      let sum = gram[i][j] + (i === j ? damping : 0);
      for (let k = 0; k < j; k++) sum -= L[i][k] * L[j][k];
      L[i][j] = i === j ? Math.sqrt(Math.max(sum, damping / 2)) : sum / L[j][j];
    }
  for (let i = 0; i < n; i++) {
    for (let k = 0; k < i; k++) x[i] -= L[i][k] * x[k];
    x[i] /= L[i][i];
  }
  for (let i = n - 1; i >= 0; i--) {
    for (let k = i + 1; k < n; k++) x[i] -= L[k][i] * x[k];
    x[i] /= L[i][i];
  }
  return x;
}

/** Coordinates near q that close the loops with one of them fixed; undefined if there are none. */
function closed(q, fixed) {
  let best = Infinity;
  for (let round = 0; round < ROUNDS; round++) {
    const residual = Mechanism.residual(q), error = Math.max(0, ...residual.map(Math.abs));
    if (!Number.isFinite(error)) return undefined;
    if (error === 0 || (error < CLOSED && error >= best / 2)) return q;
    best = Math.min(best, error);
    q = retract(q, solve(jacobian(q, residual, fixed), residual));
  }
  return best < 1e3 * CLOSED ? q : undefined;
}

/** Moves a coordinate to a value, or as far as the loops allow. */
function slide(slider, wanted) {
  const start = pose[slider.q], steps = Math.max(1, Math.ceil(Math.abs(wanted - start) / (LONGEST_STEP * (slider.high - slider.low))));
  for (let i = 1; i <= steps; i++) {
    const next = pose.slice();
    next[slider.q] = start + ((wanted - start) * i) / steps;
    const found = closed(next, slider.v);
    if (!found || found.some((value, k) => Math.abs(value - pose[k]) > 1)) break;
    pose = found;
  }
  showPose();
}

let pose = sliders ? Float64Array.from(sliders.q) : undefined;
const standing = [];

/** A drawn mechanism: its nodes by body and by element, and the frames of its bodies. */
const shown = { nodes, elements, frames: new Map() };

/** The position of a point of a body or of the ground. */
const pointAt = ({ body, point }, { frames }) => body ? new Vector3(...point).applyMatrix4(frames.get(body)) : new Vector3(...point);

function showPose() {
  const values = Mechanism.poses(pose);
  sliders.bodies.forEach(({ name, centre }, i) => {
    const [a, b, c, d, e, f, g, h, k, x, y, z] = values.slice(12 * i, 12 * i + 12), node = nodes.get(name);
    const frame = new Matrix4().set(a, b, c, x, d, e, f, y, g, h, k, z, 0, 0, 0, 1);
    shown.frames.set(name, frame);
    node.position.set(...centre).applyMatrix4(frame);
    node.quaternion.setFromRotationMatrix(frame);
  });
  for (const other of sliders.others) placeOther(other, shown);
  for (const { slider, input, output } of standing) {
    input.value = pose[slider.q];
    output.textContent = `${pose[slider.q].toFixed(3)} ${slider.unit}`;
  }
  model.updateMatrixWorld();
  redraw();
}

function placeOther(other, figure) {
  const node = figure.elements.get(other.name), { frames } = figure;
  if (!node) return;
  if (other.on) {
    const frame = other.on.body ? frames.get(other.on.body) : new Matrix4();
    node.userData.own ??= new Quaternion().setFromRotationMatrix(frame).invert().multiply(node.quaternion);
    node.position.copy(pointAt(other.on, figure));
    node.quaternion.setFromRotationMatrix(frame).multiply(node.userData.own);
    return;
  }
  const end = pointAt(other.to, figure), start = pointAt(other.from, figure), axis = new Vector3(...(other.axis ?? [0, 0, 1]));
  if (other.axis) {
    if (other.from.body) axis.transformDirection(frames.get(other.from.body));
    start.copy(end).addScaledVector(axis, -end.clone().sub(start).dot(axis));
  }
  const span = end.clone().sub(start), length = Math.max(span.length(), outlook.extent * 0.013);
  node.position.copy(start);
  node.quaternion.setFromUnitVectors(new Vector3(0, 0, 1), span.lengthSq() ? span.normalize() : axis);
  node.scale.set(1, 1, length);
}

function showSliders() {
  if (!sliders) return;
  by('sliders').hidden = false;
  document.body.classList.add('sliding');
  for (const slider of sliders.sliders) {
    const output = make('output'), input = make('input', { type: 'range', min: slider.low, max: slider.high, step: 'any', ariaLabel: slider.name });
    input.addEventListener('input', () => slide(slider, Number(input.value)));
    by('sliders').append(make('div', {}, make('label', { textContent: slider.name }), output, input));
    standing.push({ slider, input, output });
  }
  showPose();
  by('reset').addEventListener('click', () => { pose = Float64Array.from(sliders.q); showPose(); });
}
