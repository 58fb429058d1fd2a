// Time: what moves, and the row of the table that belongs to it.
function setTime(time) {
  const before = state.follow && nodes.get(state.follow)?.getWorldPosition(new Vector3());
  state.time = Math.min(Math.max(time, first), last);
  if (action) {
    action.time = state.time;
    mixer.update(0);
  }
  moveGhost();
  model.updateMatrixWorld();
  if (before) keepInMiddle(before);
  by('time').value = last > first ? (state.time - first) / (last - first) : 0;
  by('clock').textContent = `${state.time.toFixed(last - first < 1 ? 4 : 2)} s`;
  showValues();
  if (measure.ends.length === 2) showMeasure();
  if (plot) cursor();
  redraw();
}

/** Moves the camera with the followed body. */
function keepInMiddle(before) {
  const shift = nodes.get(state.follow).getWorldPosition(new Vector3()).sub(before);
  camera.position.add(shift);
  orbit.target.add(shift);
  orbit.update();
}

let frame = 0;
function play(on) {
  state.playing = on && last > first;
  by('play').textContent = state.playing ? 'Pause' : 'Play';
  if (!state.playing) return;
  if (state.time >= last) setTime(first);
  frame = performance.now();
  requestAnimationFrame(tick);
}

function tick(now) {
  if (!state.playing) return;
  const next = state.time + ((now - frame) / 1000) * Number(by('speed').value);
  setTime(motions.length ? next % last : next);
  frame = now;
  if (state.time >= last && !motions.length) play(false);
  else requestAnimationFrame(tick);
}

/** The index of the last of some ascending times up to the present one. */
function rowOf(times) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= state.time + 1e-6) low = middle;
    else high = middle - 1;
  }
  return low;
}

const row = () => rowOf(t);
