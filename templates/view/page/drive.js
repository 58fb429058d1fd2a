// A simulation that runs in the page: clock, keys and sliders for its inputs, recording and rewinding.
const { drive } = about;

/** Seconds: for steps in a frame, caught up in a frame at most, and between snapshots, curves and lines of values. */
const BUDGET = 0.03, MOST = 0.1, BETWEEN = 1, CURVES = 0.4, FIGURES = 0.25;
const RPM = 30 / Math.PI;
/** Rows of the curves, and snapshots before every other one of the older half is dropped. */
const SHOWN = 3000, KEPT = 1200;
/** Rates of keys in full travels per second: away from rest, and back if self-centring. */
const PACE = { steer: [1.6, 3.5], throttle: [2, 5], brake: [4, 8], '': [0.5, 0] };
/** The speed, m/s, at which keys turn a car's steering wheel by half of its travel: roughly the grip of tyres at any speed. */
const EASY = 8;
const TURNED = { steer: 0, throttle: 7, brake: 6 };  // of a gamepad in the standard mapping: an axis, and buttons

/** A growing array of numbers. */
class Growing {
  constructor() { [this.room, this.length] = [new Float64Array(256), 0]; }
  push(value) {
    if (this.length === this.room.length) { const more = new Float64Array(2 * this.length); more.set(this.room); this.room = more; }
    this.room[this.length++] = value;
  }
  last(count) { return this.room.subarray(Math.max(0, this.length - count), this.length); }
}

const run = {
  sim: undefined, core: undefined, module: undefined, road: undefined, initialValues: {}, script: undefined, busy: false, axes: [], step: 0, rest: 0, keys: new Set(), events: [], snapshots: [], rows: [], times: new Growing(),
  late: 0, physics: 0, simulated: 0, wall: 0, fault: undefined, speed: 0, camera: drive?.car ? 'chase' : 'orbit', heading: undefined, pad: undefined, drawn: 0, reportedAt: 0, frames: 0,
};

/** An input or a parameter moved by keys, a slider, touch or a gamepad: `place` is from -1 to 1, with 0 at rest. */
class Axis {
  constructor(about) { Object.assign(this, about, { place: 0, wanted: 0, touched: about.role !== '', sent: undefined }); }
  get value() {
    const end = this.place < 0 ? this.low : this.high;
    return this.rest + Math.abs(this.place) * (end - this.rest);
  }
  placeOf(value) {
    const offset = value - this.rest, reach = Math.sign(offset) === Math.sign(this.low - this.rest) ? this.rest - this.low : this.high - this.rest;
    return reach ? Math.min(Math.max(offset / reach, -1), 1) : 0;
  }
  /** The direction of the keys that are down. */
  get keyed() {
    const down = (keys) => Number(keys.some((key) => run.keys.has(key)));
    return down(this.plus) - (this.low === this.rest ? 0 : down(this.minus));
  }
  /** The fraction of the travel that keys reach: for a car's wheel less at higher speeds. */
  get reach() { return drive.car && this.role === 'steer' ? 1 / (1 + (run.speed / EASY) ** 2) : 1; }
  /** The direction of keys, or else of a gamepad's axis or button. */
  get pushed() { return this.keyed * this.reach || (run.pad ? this.of(run.pad) : 0); }
  of(pad) {
    if (this.role === 'steer') { const at = pad.axes[TURNED.steer] ?? 0; return Math.abs(at) < 0.08 ? 0 : at; }
    return this.role ? pad.buttons[TURNED[this.role]]?.value ?? 0 : 0;
  }
  /** One step of dt towards that direction, or back to rest. */
  move(dt) {
    const pushed = this.pushed, [away, back] = PACE[this.role];
    if (pushed && !this.touched) this.place = this.placeOf(run.sim.input(this.name));
    if (pushed) { this.touched = true; this.wanted = away && !this.role ? this.place + Math.sign(pushed) : pushed; this.fixed = false; }
    else if (back && !this.fixed) this.wanted = 0;
    else if (!this.fixed) this.wanted = this.place;
    const most = (pushed && Math.sign(pushed) === Math.sign(pushed - this.place) ? away * (this.keyed ? this.reach : 1) : Math.max(back, away)) * dt;
    const change = this.wanted - this.place;
    this.place = Math.min(Math.max(this.fixed ? this.wanted : this.place + Math.min(Math.max(change, -most), most), -1), 1);
  }
  /** Sets the slider's position, which stays until a key is pressed. */
  put(place) { [this.wanted, this.fixed, this.touched] = [place, true, true]; }
  /** Passes the value to the simulation if it has changed. */
  send() {
    if (!this.touched || this.value === this.sent) return;
    this.sent = this.value;
    run.events.push([run.step, this.name, this.value]);
    give(run.core, run.sim, this.name, this.value);
  }
  /** Takes the value of a replayed drive. */
  take(value) { [this.place, this.wanted, this.touched, this.fixed, this.sent] = [this.placeOf(value), this.placeOf(value), true, !this.role, value]; }
  get state() { return [this.place, this.wanted, this.touched, this.fixed, this.sent]; }
  set state(state) { [this.place, this.wanted, this.touched, this.fixed, this.sent] = state; }
}

/** The inputs of a saved drive, by steps. */
class Script {
  constructor({ events }) { [this.events, this.next] = [events, 0]; }
  /** The remaining events up to a step. */
  *upTo(step) { while (this.next < this.events.length && this.events[this.next][0] <= step) yield this.events[this.next++]; }
}

const give = (core, sim, name, value) => sim[core.inputs.some((input) => input.name === name) ? 'setInput' : 'setParameter'](name, value);

/** One step with the present inputs; a fault ends the drive with the core's message. */
function advance() {
  if (run.script) for (const event of run.script.upTo(run.step)) {
    run.events.push(event);
    give(run.core, run.sim, event[1], event[2]);
    run.axes.find((axis) => axis.name === event[1])?.take(event[2]);
  }
  else for (const axis of run.axes) { axis.move(drive.dt); axis.send(); }
  run.sim.step();
  run.step++;
  if (run.step % drive.every === 0) takeRow();
  if (run.step % Math.round(BETWEEN / drive.dt) === 0) keep();
}

function takeRow() {
  const outputs = run.sim.outputs;
  run.times.push(run.sim.time);
  run.core.outputs.forEach((_, i) => run.rows[i].push(outputs[i]));
  run.axes.forEach((axis, i) => run.rows[run.core.outputs.length + i].push(axis.kind === 'input' ? run.sim.input(axis.name) : axis.value));
}

function keep() {
  run.snapshots.push({ bytes: run.sim.save(), time: run.sim.time, step: run.step, rows: run.times.length, events: run.events.length, axes: run.axes.map((axis) => axis.state) });
  if (run.snapshots.length > KEPT) run.snapshots = run.snapshots.filter((_, i) => i % 2 === 0 || i > KEPT / 2);
}

/** The speed of the driven body, m/s. */
function speedOf(poses) {
  const at = 16 * about.bodies.indexOf(drive.body);
  return Math.hypot(...poses.subarray(at + 7, at + 10));
}

/** Takes steps; false if the drive has ended. */
function takeSteps(count) {
  try {
    for (let i = 0; i < count; i++) advance();
    const { poses } = run.sim;
    if (!poses.every(Number.isFinite)) throw new Error('a place is no finite number');
    run.speed = speedOf(poses);
    return true;
  } catch (error) {
    stop(error);
    return false;
  }
}

function stop(error) {
  run.fault = error;
  playDrive(false);
  sayStopped(error.message, `at ${run.sim.time.toFixed(3)} s`, 'The drive so far is kept: save it as CSV, go back by the slider of the time, or reset.');
  by('slowly').hidden = true;
  by('rescue').hidden = false;
  storeDrive();
}

/** Returns to the last snapshot at or before a time and discards what came later. */
function rewind(time) {
  playDrive(false);
  const at = Math.max(0, run.snapshots.findLastIndex((each) => each.time <= time + 1e-9)), to = run.snapshots[at];
  run.snapshots.length = at + 1;
  run.sim.restore(to.bytes);
  run.axes.forEach((axis, i) => { axis.state = to.axes[i]; });
  run.events.length = to.events;
  for (const row of [run.times, ...run.rows]) row.length = to.rows;
  Object.assign(run, { step: to.step, rest: 0, fault: undefined, speed: speedOf(run.sim.poses), heading: undefined });
  by('failure').hidden = true;
  showDriven(true);
}

/** A simulation at the start of the scene, with initial values of inputs and parameters. */
function startSimulation(core, initialValues) {
  const sim = core.create();
  sim.setStep(drive.dt);
  for (const [name, value] of Object.entries(initialValues)) give(core, sim, name, value);
  sim.start();
  return sim;
}

/** The start of the scene on the present road; cached, since an equilibrium takes long to find. */
function restart(initialValues = drive.initialValues) {
  const shownBy = run.axes.map(({ input, output, bar }) => ({ input, output, bar }));
  if (run.sim && initialValues === run.initialValues) run.sim.restore(run.snapshots[0].bytes);
  else {
    run.sim?.free();
    run.sim = startSimulation(run.core, initialValues);
  }
  run.axes = drive.axes.map((each, i) => Object.assign(new Axis(each), shownBy[i]));
  Object.assign(run, { initialValues, script: undefined, step: 0, rest: 0, events: [], snapshots: [], times: new Growing(), late: 0, frames: 0, physics: 0, simulated: 0, wall: 0, fault: undefined, speed: speedOf(run.sim.poses), heading: undefined });
  run.rows = [...run.core.outputs, ...run.axes].map(() => new Growing());
  by('failure').hidden = true;
  for (const axis of run.axes) if (!axis.touched && axis.kind === 'input') axis.rest = run.sim.input(axis.name);
  takeRow();
  keep();
}

/** Sets a road with its own memory and restarts the drive. */
async function takeRoad(name, seed, initialValues) {
  const before = [run.core, run.sim, run.road], core = await instantiate(run.module), road = drive.ground ? makeRoad(name, seed) : undefined;
  if (road) layRoad(core, road);
  Object.assign(run, { core, sim: undefined, road });
  try {
    restart(initialValues);
  } catch (error) {
    [run.core, run.sim, run.road] = before;
    if (!run.sim) throw error;
    say(`${name || 'the road of the scene'}: no start there (${error.message})`);
  }
  if (!drive.ground) return;
  [by('road').value, by('seed').value] = [run.road.name, run.road.seed];
  by('seed').hidden = !run.road.field || !run.road.lines;
  drawGround(run.road);
}

function playDrive(on) {
  state.playing = on && !run.fault && !run.busy;
  by('play').textContent = state.playing ? 'Pause' : 'Drive';
  run.before = undefined;
  run.keys.clear();
  by('kept').hidden ||= state.playing;
  if (state.playing) requestAnimationFrame(driveFrame);
  else { showFigures(); storeDrive(); }
}

/** Takes equal steps to keep up with the clock; what a frame cannot take delays the drive. */
function driveFrame(now) {
  if (!state.playing) return;
  const elapsed = Math.min((now - (run.before ?? now)) / 1000, MOST), speed = Number(by('speed').value), began = performance.now(), { dt } = drive;
  run.before = now;
  run.rest += elapsed * speed;
  run.wall += elapsed;
  run.pad = [...(navigator.getGamepads?.() ?? [])].find((pad) => pad?.connected && pad.mapping === 'standard');
  let isRunning = true;
  while (isRunning && run.rest >= dt && performance.now() - began < 1000 * BUDGET) {
    const count = Math.min(8, Math.floor(run.rest / dt));
    isRunning = takeSteps(count);
    run.rest -= count * dt;
    run.simulated += count * dt;
  }
  run.physics += (performance.now() - began) / 1000;
  run.frames++;
  if (run.rest >= dt) { run.late++; run.rest = 0; }
  showDriven(now - run.drawn > 1000 * CURVES);
  if (now - run.reportedAt > 1000 * FIGURES) { run.reportedAt = now; showFigures(); }
  if (now - kept.at > kept.every) storeDrive();
  if (isRunning && state.playing) requestAnimationFrame(driveFrame);
}

/** Draws bodies, camera, sliders and clock; curves too if requested. */
function showDriven(curves) {
  const { poses } = run.sim, [from] = [nodes.get(drive.body)?.getWorldPosition(new Vector3())];
  const rows = about.bodies.map((_, i) => poses.subarray(16 * i, 16 * i + 7)), at = 16 * about.bodies.indexOf(drive.body);
  moveGround(poses[at], poses[at + 1]);
  follow(run.sim.time, ...rows);
  showGhostDrive(run.sim.time);
  last = Math.max(run.sim.time, 1e-9);
  by('time').value = 1;
  look(from);
  for (const axis of run.axes) showAxis(axis);
  if (drive.car) showDials(speedOf(poses));
  if (!curves) return;
  run.drawn = performance.now();
  t = Float32Array.from(run.times.last(SHOWN));
  columns.forEach((column, i) => Object.assign(column, measured({ ...column, values: Float32Array.from(run.rows[i].last(SHOWN)) })));
  showValues();
  if (plot && !state.over && !ghost.columns.size) plot.setData([t, ...state.chosen.map((name) => columns.find((c) => c.name === name)).filter(Boolean).map((c) => c.values)]);
  else drawPlot();
  cursor();
}

function showAxis(axis) {
  const value = axis.touched || axis.kind === 'parameter' ? axis.value : run.sim.input(axis.name);
  axis.output.textContent = `${+value.toPrecision(4)} ${axis.unit}`;
  if (document.activeElement !== axis.input || !axis.fixed) axis.input.value = axis.touched ? axis.place : 0;
  if (axis.bar) axis.bar.style.setProperty('--place', axis.place);
}

/** Speed, gear and engine, and for each wheel its load, friction circle and force. */
function showDials(speed) {
  const { outputs } = run.sim, value = (index) => (index === undefined ? 0 : outputs[index]), [gear, engine] = [/gear|selected/, /engine.*speed/].map((name) => run.core.outputs.findIndex((o) => name.test(o.name)));
  by('fast').textContent = (3.6 * speed).toFixed(0);
  by('gear').textContent = [gear < 0 ? '' : `gear ${outputs[gear].toFixed(0)}`, engine < 0 ? '' : `${(RPM * outputs[engine] / 10).toFixed(0)}0 rpm`].filter(Boolean).join(', ');
  const loads = drive.wheels.map(({ of }) => value(of.Fz));
  run.usual ??= loads.reduce((sum, load) => sum + load, 0) / loads.length;
  drive.wheels.forEach(({ of }, i) => {
    const [circle, line, dot, text] = run.wheels[i], most = loads[i] * (of.road_friction === undefined ? 1 : value(of.road_friction)), [size, scale] = [run.gauge, Math.min(run.gauge / run.usual, run.widest / Math.max(most, 1e-9))];
    const [x, y] = [-value(of.Fy), -value(of.Fx)].map((force) => Math.min(Math.max(scale * force, -1.75 * size), 1.75 * size));
    circle.setAttribute('r', Math.max(scale * most, 0));
    for (const [element, names] of [[line, ['x2', 'y2']], [dot, ['cx', 'cy']]]) names.forEach((name, k) => element.setAttribute(name, [x, y][k]));
    circle.parentNode.classList.toggle('slides', Math.hypot(value(of.Fx), value(of.Fy)) > 0.95 * most && most > 0);
    text.textContent = (loads[i] / 1000).toFixed(1);
  });
}

/** A drawing of each wheel at its position, forward is up. */
function layWheels() {
  const [xs, ys] = [0, 1].map((axis) => drive.wheels.map(({ at }) => at[axis]).sort((a, b) => a - b)), middle = (ys[0] + ys.at(-1)) / 2;
  const axles = xs.filter((x, i) => i === 0 || x - xs[i - 1] > 0.5), across = Math.max(ys.at(-1) - middle, 1e-9), last = axles.length - 1; [run.gauge, run.widest] = [[17, 28], [27, 29]].map(([most, all]) => Math.min(most, all / Math.max(last, 1)));
  run.wheels = drive.wheels.map(({ at, name }) => {
    const group = shape(by('wheels'), 'g', { transform: `translate(${88 - 34 * (at[1] - middle) / across} ${58 + 30 * (last ? 1 - 2 * axles.findLastIndex((x) => x <= at[0]) / last : 0)})` });
    shape(group, 'title', {}, `${name}: load in kN, the circle of its friction, its force`);
    return ['circle', 'line', 'circle', 'text'].map((kind, i) => shape(group, kind, [{}, {}, { r: 3, class: 'dot' }, { x: at[1] > middle ? -30 : 30, y: 4, 'text-anchor': at[1] > middle ? 'end' : 'start' }][i]));
  });
}

function showFigures() {
  const share = run.wall > 0 ? run.simulated / run.wall : 0, speed = Number(by('speed').value);
  const core = run.physics > 0 ? `; the core ${(run.simulated / run.physics).toPrecision(2)} times real time, ${(1000 * run.physics / Math.max(run.frames, 1)).toFixed(2)} ms a frame` : '';
  by('pace').hidden = !run.wall;
  by('pace').textContent = `${(share / speed).toFixed(2)} of the clock, ${run.late} late${core}`;
}

/** The camera behind a car, at the driver's seat, or where it was moved; sun and shadow follow the car. */
function look(from) {
  const node = nodes.get(drive.body), size = outlook.extent;
  if (!node) return;
  const at = node.getWorldPosition(new Vector3());
  if (ground.road) { sun.position.copy(at).add(new Vector3(-4, 9, 5).multiplyScalar(size)); sun.target.position.copy(at); }
  if (run.camera === 'orbit') return;
  const rotation = node.getWorldQuaternion(new Quaternion()), ahead = new Vector3(1, 0, 0).applyQuaternion(rotation), up = new Vector3(0, 1, 0);
  if (run.camera === 'driver') {
    camera.position.copy(at).addScaledVector(up, 0.22 * size);
    orbit.target.copy(camera.position).addScaledVector(ahead, 4 * size);
  } else {
    const level = ahead.setY(0).normalize(), [back, high] = camera.aspect < 1 ? [-3, 1.25] : [-2.1, 0.75];
    run.heading = run.heading && from && at.distanceTo(from) < size ? run.heading.lerp(level, 0.08).normalize() : level.clone();
    camera.position.copy(at).addScaledVector(run.heading, back * size).addScaledVector(up, high * size);
    orbit.target.copy(at).addScaledVector(run.heading, 0.8 * size);
    if (ground.road) camera.position.y = Math.max(camera.position.y, heightAt(camera.position.x, -camera.position.z) + 0.3 * size);
  }
  camera.lookAt(orbit.target);
  redraw();
}

function chooseCamera(name) {
  run.camera = by('camera').value = name;
  orbit.enabled = name === 'orbit';
  document.body.classList.toggle('chasing', !orbit.enabled);
  camera.fov = name === 'driver' ? 60 : 35;
  camera.updateProjectionMatrix();
  if (name === 'orbit') { state.follow = drive.car ? drive.body : outlook.follow; home(); }
  else state.follow = '';
  look();
}

/** The recording in full precision: rows of outputs, then of inputs. */
function driveTable() {
  const heads = [{ name: 't', unit: 's' }, ...run.core.outputs, ...run.axes].map(heading);
  const lines = Array.from({ length: run.times.length }, (_, i) => [run.times, ...run.rows].map((column) => column.room[i]).join(','));
  return [heads.join(','), ...lines].join('\n') + '\n';
}

/** The data of a replay: steps, and the changes of inputs before them. */
const driveLog = () => JSON.stringify({ cutjoint: 'drive', mark: run.core.facts.mark, model: about.title, scene: about.scene, dt: drive.dt, initial_values: run.initialValues, ...(run.road?.lines ? { road: run.road.name, seed: run.road.seed } : {}), steps: run.step, every: drive.every, events: run.events });

const saveDrive = () => save(`${stem()}.csv`, new Blob([driveTable()], { type: 'text/csv' }));

const keyName = (key) => ({ ArrowLeft: '←', ArrowRight: '→', ArrowUp: '↑', ArrowDown: '↓' })[key] ?? key.replace(/^Key|^Digit/, '');

/** The names of the keys that move an axis. */
const keysOf = (axis) => [axis.low === axis.rest ? '' : axis.minus[0], axis.plus[0]].filter(Boolean).map(keyName);

/** The keys, shown over the picture. */
function layKeys() {
  const own = run.axes.filter((axis) => axis.plus.length).map((axis) => [keysOf(axis), axis.name]);
  for (const [keys, text] of [...own, [['space'], 'drive, pause'], [['⌫'], 'back 3 s'], [['R'], 'reset'], [['C'], 'camera'], [['H'], 'hide this']]) {
    by('keys').append(make('div', {}, ...keys.map((textContent) => make('kbd', { textContent })), ` ${text}`));
  }
}

/** A line with a slider for each axis, with its keys, and for a car bars over the picture. */
function layAxes() {
  for (const axis of run.axes) {
    const hint = keysOf(axis).join(' ');
    axis.output = make('output');
    axis.input = make('input', { type: 'range', min: axis.low === axis.rest ? 0 : -1, max: 1, step: 'any', value: 0, ariaLabel: axis.name });
    axis.input.addEventListener('input', () => { const { name } = axis; run.axes.find((each) => each.name === name).put(Number(axis.input.value)); if (!state.playing) showAxis(run.axes.find((each) => each.name === name)); });
    const label = make('label', {}, axis.name, ...(hint ? [' ', make('kbd', { textContent: hint })] : []));
    by(axis.role || (axis.kind === 'input' && !drive.car) ? 'inputs' : 'tunable').append(make('div', {}, label, axis.output, axis.input));
    if (axis.role) by('bars').append(make('span', { textContent: axis.name }));
    axis.bar = axis.role ? by('bars').appendChild(make('i', { className: axis.role, title: axis.name })) : undefined;
    for (const [side, keys] of [['minus', axis.low === axis.rest ? [] : axis.minus], ['plus', axis.plus]]) if (keys.length && hasPads(axis)) layPad(axis, side, keys[0], keyName(keys[0]));
  }
  by('tuning').open = !drive.car;
  if (!drive.car) by('tuning').querySelector('summary').textContent = 'Parameters';
  if (!run.axes.length) by('inputs').append(make('p', {}, 'Nothing moves it from outside: the model has no input and no tunable parameter. ', make('kbd', { textContent: 'cutjoint drive --tunable NAME' }), ' makes numbers of its file such.'));
  by('tuning').hidden = !by('tunable').childElementCount;
}

/** Touch screens have four buttons: those of a car's pedals and wheel, or of the first two inputs. */
const hasPads = (axis) => run.axes.some((each) => each.role) ? axis.role : run.axes.indexOf(axis) < 2;

/** A touch button, pressed like a key. */
function layPad(axis, side, key, text) {
  const pad = make('button', { type: 'button', textContent: axis.role === 'steer' ? (side === 'minus' ? '◀' : '▶') : axis.role ? axis.role : text, ariaLabel: `${axis.name}, ${side}` });
  if (!axis.role) pad.append(make('small', { textContent: axis.name }));
  pad.className = axis.role === 'steer' ? 'left' : 'right';
  for (const [event, on] of [['pointerdown', true], ['pointerup', false], ['pointercancel', false], ['pointerleave', false]])
    pad.addEventListener(event, (e) => { e.preventDefault(); run.keys[on ? 'add' : 'delete'](key); if (on && !state.playing && !run.fault) { playDrive(true); run.keys.add(key); } });
  pad.addEventListener('contextmenu', (e) => e.preventDefault());
  by('pads').append(pad);
}

const inField = (e) => /^(select|textarea)$/i.test(e.target.tagName) || (e.target.tagName === 'INPUT' && e.target.type !== 'range');
const drives = (key) => run.axes.some((axis) => [...axis.minus, ...axis.plus].includes(key));

function listen() {
  addEventListener('keydown', (e) => {
    if (inField(e) || e.ctrlKey || e.metaKey || e.altKey) return;
    if (drives(e.code)) {
      e.preventDefault();
      if (!state.playing && !run.fault && !e.repeat) playDrive(true);
      run.keys.add(e.code);
    } else if (e.code === 'Space' && e.target.tagName !== 'BUTTON') { e.preventDefault(); playDrive(!state.playing); }
    else if (e.code === 'KeyR') resetDrive();
    else if (e.code === 'KeyC') chooseCamera({ chase: 'driver', driver: 'orbit', orbit: 'chase' }[run.camera]);
    else if (e.code === 'KeyH') by('keys').hidden = !by('keys').hidden;
    else if (e.code === 'Backspace') { e.preventDefault(); rewind(run.sim.time - 3); }
  });
  addEventListener('keyup', (e) => run.keys.delete(e.code));
  addEventListener('blur', () => run.keys.clear());
  addEventListener('pagehide', storeDrive);
  document.addEventListener('visibilitychange', () => { if (document.hidden && state.playing) { playDrive(false); say('Paused while the page was hidden.'); } });
  addEventListener('gamepaddisconnected', () => { if (!run.pad) return; run.pad = undefined; playDrive(false); say('The gamepad is gone: paused. Plug it in, or go on with the keys.'); });
  by('play').addEventListener('click', () => playDrive(!state.playing));
  by('again').addEventListener('click', () => resetDrive());
  by('back').addEventListener('click', () => rewind(run.sim.time - 3));
  by('time').addEventListener('input', (e) => { playDrive(false); by('clock').textContent = `back to ${(Number(e.target.value) * last).toFixed(1)} s`; });
  by('time').addEventListener('change', (e) => rewind(Number(e.target.value) * last));
  by('camera').addEventListener('change', (e) => chooseCamera(e.target.value));
  by('rescue').addEventListener('click', saveDrive);
}

function resetDrive() {
  playDrive(false);
  if (run.busy) return;
  restart();
  chooseCamera(run.camera);
  showDriven(true);
}

/** Another road, from the start. */
async function changeRoad(name, seed) {
  const text = 'Looking for the start on this road: a moment.';
  playDrive(false);
  say(text);
  await new Promise((drawn) => setTimeout(drawn, 50));
  await takeRoad(name, seed);
  if (by('saying').textContent === text) by('saying').hidden = true;
  chooseCamera(run.camera);
  showDriven(true);
}

async function showDrive() {
  document.body.classList.add('driving');
  document.body.classList.remove('still', 'bare');
  run.module = await WebAssembly.compile(bytes('module'));
  if (drive.ground) {
    renderer.shadowMap.enabled = sun.castShadow = true;
    Object.assign(sun.shadow.camera, { left: -4, right: 4, top: 4, bottom: -4, near: 0.1, far: 30 * outlook.extent });
    sun.shadow.mapSize.set(1024, 1024);
    scene.add(sun.target);
    model.traverse((object) => { object.castShadow = object.isMesh; });
    fill(by('road'), [['', 'of the scene'], ...Object.keys(drive.roads).map((name) => [name, name])], '');
    for (const id of ['road', 'seed']) by(id).addEventListener('change', () => changeRoad(by('road').value, Math.max(0, Math.floor(Number(by('seed').value)))));
  }
  by('laying').hidden = !drive.ground;
  await takeRoad(drive.road ?? '', 1);
  if (drive.car) layWheels();
  layAxes();
  layKeys();
  listen();
  findKept();
  window.cutjoint.drive = { run, rival, kept, takeSteps, showDriven, changeRoad, continueDrive, raceGhost, storeDrive, heightAt, rewind, resetDrive, driveTable, driveLog, chooseCamera };
  columns.push(...[...run.core.outputs, ...run.axes].map(({ name, unit }) => ({ name, unit, bodies: drive.of[name] ?? [], values: new Float32Array(1), decimals: 3 })));
  fill(by('column'), columns.map((c) => [c.name, c.name]), columns[0]?.name);
  by('choice').hidden = !columns.length;
  state.chosen = [(run.core.outputs.find((o) => drive.car && (o.unit === 'm/s' || /motion.*speed/.test(o.name))) ?? columns[0])?.name].filter(Boolean);
  by('column').value = state.chosen[0] ?? '';
  listValues();
  by('play').textContent = 'Drive';
  by('hud').hidden = !drive.car;
  dress();
  chooseCamera(run.camera);
  showDriven(true);
  showFigures();
}
