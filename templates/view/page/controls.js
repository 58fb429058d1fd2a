// Keys and buttons, and the start of the page.
function fill(select, entries, chosen) {
  select.replaceChildren(...entries.map(([value, text]) => new Option(text, value, false, value === chosen)));
}

by('title').textContent = about.title;
by('subtitle').textContent = [about.scene, about.note].filter(Boolean).join(', ');
fill(by('body'), [['', 'all'], ...about.bodies.map((b) => [b, b])], '');
fill(by('follow'), [['', 'nothing'], ...about.bodies.map((b) => [b, b])], state.follow);
fill(by('column'), [...about.plots.map((plot, i) => [`#${i}`, plot.name]), ...columns.map((c) => [c.name, c.name])], state.chosen[0]);
fill(by('abscissa'), [['', 't'], ...columns.map((c) => [c.name, c.name])], '');
fill(by('speed'), [0.05, 0.1, 0.25, 0.5, 1, 2, 5].map((s) => [String(s), `${s} x`]), '1');
document.body.classList.toggle('still', !(last > first));
document.body.classList.toggle('bare', !columns.length && !motions.length && !sliders && !graph);
by('choice').hidden = columns.length === 0 || t.length < 2;
by('body').addEventListener('change', (e) => choose(e.target.value));
by('follow').addEventListener('change', (e) => { state.follow = e.target.value; });
by('column').addEventListener('change', (e) => choosePlot(e.target.value));
by('abscissa').addEventListener('change', (e) => { state.over = e.target.value; drawPlot(); });
by('names').addEventListener('change', redraw);
by('forces').addEventListener('change', (e) => showArrows(e.target.checked));
by('home').addEventListener('click', () => { by('look').value = ''; home(); });
by('video').hidden = !(last > first) || typeof MediaRecorder === 'undefined';
if (!about.drive) {
  by('play').addEventListener('click', () => play(!state.playing));
  by('time').addEventListener('input', (e) => { play(false); setTime(first + Number(e.target.value) * (last - first)); });
}
addEventListener('keydown', (e) => {
  if (about.drive || /^(select|input|button)$/i.test(e.target.tagName)) return;
  if (e.key === ' ') { e.preventDefault(); play(!state.playing); }
  if (e.key === 'ArrowRight' || e.key === 'ArrowLeft') setTime(t[Math.min(Math.max(row() + (e.key === 'ArrowRight' ? 1 : -1), 0), t.length - 1)]);
});

/** For the console: the parts of the page. */
window.cutjoint = {
  about, setTime, choose, play, chooseMotion, showTab, select, slide, place, pathOf, tableText, row, state, sliders, nodes, marks, arrows, ghost, scene, camera, orbit, picture, renderer, Vector3,
  get plot() { return plot; }, get pose() { return pose; }, get received() { return received; },
};

const read = (id) => new GLTFLoader().parseAsync(bytes(id), '');

async function begin() {
  load(await read('glb'));
  if (over) loadGhost(await read('over-glb'), over.name);
  listValues();
  if (about.plots.length) choosePlot('#0');
  else drawPlot();
  showFailure();
  showMotions();
  showGraph();
  if (!about.live && !about.drive) showSliders();
  showLive();
  if (about.drive) await showDrive();
  document.body.dataset.ready = 'yes';
}

begin();
