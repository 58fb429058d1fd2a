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

/** For tests and the console: what the page shows, and where. */
window.cutjoint = {
  setTime, choose, play,
  /** The pixel of a body's centre of mass at a time, s. */
  project(body, time) { if (!about.live && !about.drive) setTime(time); camera.updateMatrixWorld(); return place(nodes.get(body)).slice(0, 2); },
  /** The pixel of the mark around the failed element. */
  mark() { camera.updateMatrixWorld(); return place(marks[0]).slice(0, 2); },
  /** The pixel of a body's ghost. */
  ghost(body, time) {
    setTime(time);
    scene.updateMatrixWorld();
    let found;
    ghost.scene.traverse((object) => { if (object.userData.body === body) found = object; });
    return place(found).slice(0, 2);
  },
  /** Both ends of an arrow, in the scene's axes (y is up). */
  arrow(name, time) {
    setTime(time);
    const node = arrows.find((a) => a.userData.arrow === name), at = node.localToWorld(new Vector3());
    return { at: at.toArray(), along: node.localToWorld(new Vector3(0, 0, 1)).sub(at).normalize().toArray(), newton: node.scale.x * node.userData.newton };
  },
  /** Position and target of the camera in the scene's axes (y is up), its field of view in degrees, and the picture's size in pixels. */
  eye() { return { from: camera.position.toArray(), to: orbit.target.toArray(), angle: camera.fov, size: [picture.clientWidth, picture.clientHeight] }; },
  motion: chooseMotion, tab: showTab, select, plotted() { return plot?.data; }, table: tableText,
  /** The points of a body's trace, in the scene's axes. */
  path(body) { return pathOf(body).map((place) => place.toArray()); },
  /** Moves a coordinate to a value as its slider does; returns all coordinates. */
  slide(name, value) { slide(sliders.sliders.find((s) => s.name === name), value); return [...pose]; },
  /** The number of poses received from a host. */
  received() { return received; },
  shown() { return { ...state, row: row() }; },
  frames() { return renderer.info.render.frame; },
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
