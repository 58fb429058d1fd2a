// Saved drives: stored while driving, resumed, and shown as a ghost.
const kept = { at: 0, every: 2000, silent: false, earlier: undefined };
const rival = { figure: undefined, rows: undefined, step: 0 };
const slot = (name) => `cutjoint drive ${run.core.facts.mark} ${name}`;

/** A message that disappears by itself. */
function say(text) {
  by('saying').textContent = text;
  by('saying').hidden = false;
  clearTimeout(say.timer);
  say.timer = setTimeout(() => { by('saying').hidden = true; }, 8000);
}

/** Stores the drive so far in the browser, as often as is cheap. */
function storeDrive() {
  const began = performance.now();
  kept.at = began;
  if (!run.step) return;
  try {
    localStorage.setItem(slot('now'), driveLog());
  } catch (error) {
    if (!kept.silent) say(`This browser keeps no drive (${error.name}): save it as JSON or CSV before you close the page.`);
    kept.silent = true;
  }
  kept.every = Math.max(2000, 50 * (performance.now() - began));
}

/** The stored drive from before the page was closed, if there is one. */
function findKept() {
  try {
    const text = localStorage.getItem(slot('now'));
    if (text) { localStorage.setItem(slot('earlier'), text); localStorage.removeItem(slot('now')); }
    kept.earlier = JSON.parse(localStorage.getItem(slot('earlier')) ?? 'null') ?? undefined;
  } catch { kept.earlier = undefined; }
  by('kept').hidden = !(kept.earlier?.steps > 0);
  const lasted = kept.earlier ? kept.earlier.steps * kept.earlier.dt : 0;
  by('lasted').textContent = kept.earlier ? `A drive of ${lasted.toFixed(lasted < 1 ? 1 : 0)} s is kept from before this page was closed.` : '';
  by('continue').addEventListener('click', () => continueDrive(kept.earlier));
  by('race').addEventListener('click', () => raceGhost(kept.earlier));
  by('forget').addEventListener('click', () => { by('kept').hidden = true; });
  by('rival').addEventListener('change', async (e) => {
    const of = { now: () => JSON.parse(driveLog()), earlier: () => kept.earlier, file: readDrive }[e.target.value];
    raceGhost(await of?.());
  });
  by('rival').querySelector('[value=earlier]').hidden = !kept.earlier;
}

/** Asks for a file with a saved drive. */
const readDrive = () => new Promise((found) => {
  const input = make('input', { type: 'file', accept: '.json' });
  input.addEventListener('change', async () => { try { found(JSON.parse(await input.files[0].text())); } catch { found({}); } });
  input.addEventListener('cancel', () => found(undefined));
  input.click();
});

/** Whether this page can replay a drive. */
function fits(log) {
  if (log.mark === run.core.facts.mark && log.dt === drive.dt && Array.isArray(log.events)) return true;
  say('That is no drive of this page: a drive is a JSON file that a page of the same model, scene and version has saved.');
  return false;
}

/** Makes calls in slices, so that the page stays responsive, until one returns false. */
async function inSlices(count, call, what) {
  run.busy = true;
  by('pace').hidden = false;
  for (let i = 0, began = performance.now(); i < count && call(); i++) {
    if (performance.now() - began < 40) continue;
    by('pace').textContent = `${what}: ${((100 * i) / count).toFixed(0)} %`;
    await new Promise((done) => setTimeout(done));
    began = performance.now();
  }
  run.busy = false;
}

/** Initial values of inputs and parameters of a saved drive; earlier versions named them `given`. */
const initialValues = (log) => log.initial_values ?? log.given;

/** Resumes a saved drive from its end, bit by bit. */
async function continueDrive(log) {
  playDrive(false);
  by('kept').hidden = true;
  if (run.busy || !fits(log)) return;
  await takeRoad(log.road ?? '', log.seed ?? 1, initialValues(log));
  run.script = new Script(log);
  await inSlices(log.steps, () => takeSteps(1), 'taking up the drive');
  run.script = undefined;
  chooseCamera(run.camera);
  showDriven(true);
  showFigures();
}

/** Shows a saved drive as a ghost, or none: its poses and outputs are computed first. */
async function raceGhost(log) {
  playDrive(false);
  by('kept').hidden = true;
  if (run.busy || (log && !fits(log))) return;
  rival.rows = undefined;
  ghost.columns.clear();
  if (log) {
    const core = await instantiate(run.module), road = drive.ground && makeRoad(log.road ?? '', log.seed ?? 1), script = new Script(log);
    if (road) layRoad(core, road);
    const sim = startSimulation(core, initialValues(log)), rows = [], times = [];
    const note = () => { times.push(sim.time); rows.push({ poses: about.bodies.map((_, i) => Array.from(sim.poses.subarray(16 * i, 16 * i + 7))), outputs: Float32Array.from(sim.outputs) }); };
    note();
    let step = 0;
    await inSlices(log.steps, () => {
      for (const [, name, value] of script.upTo(step)) give(core, sim, name, value);
      try { sim.step(); } catch { return false; }
      if (++step % log.every === 0) note();
      return true;
    }, 'the ghost drives');
    if (!ghost.scene) {
      loadGhost(await read('glb'), 'an earlier drive');
      rival.figure = { nodes: new Map(), elements: new Map(), frames: new Map() };
      ghost.scene.traverse((object) => { const { body, element } = object.userData; if (body !== undefined) rival.figure.nodes.set(body, object); if (element !== undefined) rival.figure.elements.set(element, object); });
    }
    Object.assign(rival, { rows, step: log.every * log.dt });
    ghost.t = Float32Array.from(times);
    core.outputs.forEach(({ name }, i) => ghost.columns.set(name, Float32Array.from(rows, (each) => each.outputs[i])));
  }
  if (ghost.scene) { ghost.scene.visible = Boolean(log); by('over').hidden = by('ghostly').hidden = !log; }
  listValues();
  showDriven(true);
  drawPlot();
  showFigures();
}

/** Moves the ghost to a time, or to the end of its drive. */
function showGhostDrive(time) {
  if (!rival.rows) return;
  const place = Math.min(time / rival.step, rival.rows.length - 1), i = Math.floor(place), share = place - i, now = rival.rows[i].poses, next = rival.rows[Math.min(i + 1, rival.rows.length - 1)].poses;
  stand(rival.figure, now.map((pose, body) => pose.map((value, k) => (k < 3 ? value + share * (next[body][k] - value) : value))));
  ghost.scene.updateMatrixWorld();
}
