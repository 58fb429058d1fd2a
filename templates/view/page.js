// The page's own script: shows the scene of the .glb file, moves it over time, and plots the columns of its run.
'use strict';
(() => {
  const { AmbientLight, AnimationMixer, Box3, BufferGeometry, Color, DirectionalLight, Float32BufferAttribute, Fog, GLTFLoader, HemisphereLight,
    LineBasicMaterial, LineSegments, MeshLambertMaterial, OrbitControls, PerspectiveCamera, Plot, Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
  } = Libraries;
  const by = (id) => document.getElementById(id);
  const bytes = (id) => Uint8Array.from(atob(by(id).textContent), (c) => c.charCodeAt(0)).buffer;
  const about = JSON.parse(by('about').textContent);
  const numbers = new Float32Array(bytes('table'));
  const t = numbers.subarray(0, about.rows);
  const columns = about.columns.map((c, i) => measured({ ...c, values: numbers.subarray((i + 1) * about.rows, (i + 2) * about.rows) }));
  const { outlook } = about;
  const [first, last] = [t[0], t[t.length - 1]];
  const state = { time: first, playing: false, body: '', column: columns[0]?.name ?? '', follow: outlook.follow };

  /** A column with as many decimals as five digits of its largest value have. */
  function measured(column) {
    const largest = column.values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    return { ...column, decimals: largest > 0 ? Math.min(Math.max(4 - Math.floor(Math.log10(largest)), 0), 9) : 0 };
  }

  // The picture
  const picture = by('picture');
  const renderer = new WebGLRenderer({ antialias: true });
  picture.prepend(renderer.domElement);
  const scene = new Scene();
  const camera = new PerspectiveCamera(35, 1, outlook.extent / 100, outlook.extent * 200);
  const orbit = new OrbitControls(camera, renderer.domElement);
  orbit.addEventListener('change', redraw);
  scene.add(new HemisphereLight(0xffffff, 0x8a8f99, 1.7), new AmbientLight(0xffffff, 0.35));
  const sun = new DirectionalLight(0xffffff, 1.9);
  scene.add(sun);
  const nodes = new Map();  // of bodies, by name
  const clickable = [], tarmac = new Map();  // of the road's materials the colours by day
  let model, mixer, action, grid, cell = 1, due = false;

  function load(gltf) {
    model = gltf.scene;
    scene.add(model);
    const materials = new Map();
    model.traverse((object) => {
      if (object.userData.body !== undefined) nodes.set(object.userData.body, object);
      if (!object.isMesh) return;
      if (!materials.has(object.material)) materials.set(object.material, new MeshLambertMaterial({ color: object.material.color, fog: isRoad(object) }));
      if (isRoad(object)) tarmac.set(materials.get(object.material), object.material.color.clone());
      object.material = materials.get(object.material);  // cheaper than what glTF describes, where a processor draws
      if (bodyOf(object) !== undefined) clickable.push(object);
    });
    if (gltf.animations.length) {
      mixer = new AnimationMixer(model);
      action = mixer.clipAction(gltf.animations[0]);
      action.play();
    }
    setTime(first);
    new ResizeObserver(resize).observe(picture);
    resize();
    home();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', dress);
    dress();
    document.body.dataset.ready = 'yes';
  }

  /** The name of the body that an object is a part of. */
  function bodyOf(object) {
    for (let at = object; at; at = at.parent) if (at.userData.body !== undefined) return at.userData.body;
    return undefined;
  }

  /** A vector of the model's axes in those of the scene. */
  const turned = (vector) => new Vector3(...vector).applyQuaternion(model.children[0].quaternion);

  /** Looks at the mechanism so that all of it is seen, at all times where nothing is followed. */
  function home() {
    const box = new Box3(), { time } = state;
    for (const at of state.follow || !action ? [time] : Array.from({ length: 17 }, (_, i) => first + ((last - first) * i) / 16)) {
      setTime(at);
      model.traverse((o) => { if (o.isMesh && !isRoad(o)) box.expandByObject(o); });
    }
    setTime(time);
    const centre = box.getCenter(new Vector3()), half = box.getSize(new Vector3()).multiplyScalar(0.5);
    const back = turned(outlook.direction).normalize(), right = new Vector3(0, 1, 0).cross(back).normalize(), up = back.clone().cross(right);
    const slope = Math.tan((camera.fov * Math.PI) / 360);
    let distance = outlook.extent / 2;
    for (let k = 0; k < 8; k++) {  // each corner is seen
      const corner = half.clone().multiply(new Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
      const across = Math.max(Math.abs(corner.dot(up)), Math.abs(corner.dot(right)) / camera.aspect) / slope;
      distance = Math.max(distance, corner.dot(back) + 1.12 * across);
    }
    camera.position.copy(centre).addScaledVector(back, distance);
    orbit.target.copy(centre);
    orbit.update();
    redraw();
  }

  function isRoad(object) {
    for (let at = object; at; at = at.parent) if (at.userData.road) return true;
    return false;
  }

  function dress() {
    const style = getComputedStyle(document.documentElement);
    scene.background = new Color(style.getPropertyValue('--sky'));
    scene.fog = new Fog(scene.background, 1, 2);
    const night = matchMedia('(prefers-color-scheme: dark)').matches;
    for (const [material, colour] of tarmac) material.color.copy(colour).multiplyScalar(night ? 0.3 : 1);
    if (grid) scene.remove(grid);
    grid = undefined;
    if (!outlook.road) {
      const about10 = 10 ** Math.floor(Math.log10(outlook.extent / 4)), share = outlook.extent / 4 / about10;
      cell = about10 * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
      grid = floor(new Color(style.getPropertyValue('--floor')));
      scene.add(grid);
    }
    by('scale').textContent = outlook.road ? 'strips of the road: 1 m' : `grid: ${+cell.toPrecision(3)} m`;
    if (plot) drawPlot();
    redraw();
  }

  /** Lines a cell apart, in pieces of a cell. */
  function floor(color) {
    const ends = [], half = 20;
    for (let i = -half; i <= half; i++)
      for (let k = -half; k < half; k++) ends.push(i, 0, k, i, 0, k + 1, k, 0, i, k + 1, 0, i);
    const lines = new BufferGeometry();
    lines.setAttribute('position', new Float32BufferAttribute(ends.map((end) => end * cell), 3));
    return new LineSegments(lines, new LineBasicMaterial({ color }));
  }

  function resize() {
    const { clientWidth: width, clientHeight: height } = picture;
    if (!width || !height) return;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    renderer.setSize(width, height);
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    if (plot) {
      plot.setSize(plotSize());
      cursor();
    }
    redraw();
  }

  function redraw() {
    if (due) return;
    due = true;
    requestAnimationFrame(() => { due = false; render(); });
  }

  function render() {
    sun.position.copy(camera.position).add(new Vector3(0, outlook.extent, 0));
    if (grid) grid.position.set(cell * Math.round(orbit.target.x / cell), outlook.floor, cell * Math.round(orbit.target.z / cell));
    const far = camera.position.distanceTo(orbit.target);
    [scene.fog.near, scene.fog.far] = outlook.road ? [4 * far, 14 * far] : [far, 2.2 * far + 4 * cell];
    renderer.render(scene, camera);
    label();
  }

  // Time
  function setTime(time) {
    const before = state.follow && nodes.get(state.follow)?.getWorldPosition(new Vector3());
    state.time = Math.min(Math.max(time, first), last);
    if (action) {
      action.time = state.time;
      mixer.update(0);
    }
    model.updateMatrixWorld();
    if (before) {
      const way = nodes.get(state.follow).getWorldPosition(new Vector3()).sub(before);
      camera.position.add(way);
      orbit.target.add(way);
      orbit.update();
    }
    by('time').value = last > first ? (state.time - first) / (last - first) : 0;
    by('clock').textContent = `${state.time.toFixed(last - first < 1 ? 4 : 2)} s`;
    showValues();
    if (plot) cursor();
    redraw();
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
    setTime(state.time + ((now - frame) / 1000) * Number(by('speed').value));
    frame = now;
    if (state.time >= last) play(false);
    else requestAnimationFrame(tick);
  }

  /** The number of the last row up to the present time. */
  function row() {
    let low = 0, high = t.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (t[middle] <= state.time + 1e-6) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // Names
  function place(name) {
    const at = nodes.get(name).getWorldPosition(new Vector3()).project(camera);
    return [((at.x + 1) / 2) * picture.clientWidth, ((1 - at.y) / 2) * picture.clientHeight, at.z];
  }

  /** The chosen body's name, and those of others where they overlap none that is nearer to the eye. */
  function label() {
    const shown = by('names').checked ? [...nodes.keys()] : state.body ? [state.body] : [];
    const places = shown.map((name) => ({ name, at: place(name) })).filter(({ at }) => at[2] < 1);
    places.sort((a, b) => (b.name === state.body) - (a.name === state.body) || a.at[2] - b.at[2]);
    const taken = [], labels = by('labels');
    labels.replaceChildren();
    for (const { name, at: [x, y] } of places) {
      const span = document.createElement('span');
      span.textContent = name;
      if (name === state.body) span.className = 'chosen';
      labels.append(span);
      const left = Math.round(x + 10), top = Math.round(y - 26), box = [left, top, left + span.offsetWidth, top + span.offsetHeight];
      if (taken.some((b) => box[0] < b[2] + 2 && b[0] < box[2] + 2 && box[1] < b[3] + 2 && b[1] < box[3] + 2)) { span.remove(); continue; }
      taken.push(box);
      span.style.transform = `translate(${left}px, ${top}px)`;
    }
  }

  // Choosing a body
  function choose(body) {
    state.body = body;
    by('body').value = body;
    const marked = new Map();
    for (const mesh of clickable) {
      mesh.userData.plain ??= mesh.material;
      const on = bodyOf(mesh) === body;
      if (on && !marked.has(mesh.userData.plain)) {
        const lit = mesh.userData.plain.clone();
        lit.emissive = new Color(0x6b5200);
        marked.set(mesh.userData.plain, lit);
      }
      mesh.material = on ? marked.get(mesh.userData.plain) : mesh.userData.plain;
    }
    listValues();
    const own = ownColumns();
    if (own.length && !own.some((c) => c.name === state.column)) chooseColumn(own[0].name);
    redraw();
  }

  const ownColumns = () => columns.filter((c) => !state.body || c.bodies.includes(state.body));

  function bodyAt(x, y) {
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2((x / picture.clientWidth) * 2 - 1, 1 - (y / picture.clientHeight) * 2), camera);
    const [hit] = ray.intersectObjects(clickable, false);
    return hit ? bodyOf(hit.object) : '';
  }

  let pressed;
  renderer.domElement.addEventListener('pointerdown', (e) => { pressed = [e.offsetX, e.offsetY]; });
  renderer.domElement.addEventListener('pointerup', (e) => {
    if (pressed && Math.hypot(e.offsetX - pressed[0], e.offsetY - pressed[1]) < 4) choose(bodyAt(e.offsetX, e.offsetY));
  });

  // Values and the plot
  let cells = [];
  function listValues() {
    const own = ownColumns(), lines = by('values').tBodies[0];
    cells = own.map((column) => {
      const line = lines.ownerDocument.createElement('tr');
      line.insertCell().textContent = column.name;
      line.className = column.name === state.column ? 'chosen' : '';
      line.addEventListener('click', () => chooseColumn(column.name));
      return { column, line, cell: line.insertCell() };
    });
    lines.replaceChildren(...cells.map((c) => c.line));
    if (!own.length) {
      const line = lines.insertRow();
      line.className = 'note';
      line.insertCell().textContent = columns.length ? `The scene has no output of ${state.body}.` : 'The scene has no outputs.';
    }
    showValues();
  }

  function showValues() {
    const now = row();
    for (const { column, cell } of cells) cell.textContent = `${+column.values[now].toFixed(column.decimals)} ${column.unit}`;
  }

  function chooseColumn(name) {
    state.column = name;
    by('column').value = name;
    for (const { column, line } of cells) line.className = column.name === name ? 'chosen' : '';
    drawPlot();
  }

  let plot, now;
  const plotSize = () => ({ width: by('plot').clientWidth || 300, height: 220 });

  function drawPlot() {
    const column = columns.find((c) => c.name === state.column);
    if (plot) plot.destroy();
    plot = undefined;
    if (!column || t.length < 2) return;
    const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim();
    const axis = { stroke: colour('--faint'), grid: { stroke: colour('--line'), width: 1 }, ticks: { stroke: colour('--line'), width: 1 } };
    const options = {
      ...plotSize(), legend: { show: false }, cursor: { drag: { setScale: false, x: false, y: false }, y: false, points: { show: false } },
      scales: { x: { time: false } }, axes: [{ ...axis, label: 't in s', labelSize: 20, size: 34 }, { ...axis, size: 58, label: column.unit, labelSize: 18 }],
      series: [{}, { stroke: colour('--accent'), width: 1.5, points: { show: false } }],
    };
    plot = new Plot(options, [t, column.values], by('plot'));
    plot.over.addEventListener('click', (e) => { play(false); setTime(plot.posToVal(e.offsetX, 'x')); });
    now = document.createElement('div');
    now.className = 'now';
    plot.over.append(now);
    cursor();
  }

  /** The line in the plot goes to the present time. */
  function cursor() {
    now.style.transform = `translateX(${plot.valToPos(state.time, 'x')}px)`;
  }

  // Controls
  function fill(select, entries, chosen) {
    select.replaceChildren(...entries.map(([value, text]) => new Option(text, value, false, value === chosen)));
  }

  by('title').textContent = about.title;
  by('subtitle').textContent = about.scene;
  fill(by('body'), [['', 'all'], ...about.bodies.map((b) => [b, b])], '');
  fill(by('follow'), [['', 'nothing'], ...about.bodies.map((b) => [b, b])], state.follow);
  fill(by('column'), columns.map((c) => [c.name, c.name]), state.column);
  fill(by('speed'), [0.05, 0.1, 0.25, 0.5, 1, 2, 5].map((s) => [String(s), `${s} x`]), '1');
  document.body.classList.toggle('still', !(last > first));
  document.body.classList.toggle('bare', !columns.length);
  by('choice').hidden = columns.length === 0 || t.length < 2;
  by('body').addEventListener('change', (e) => choose(e.target.value));
  by('follow').addEventListener('change', (e) => { state.follow = e.target.value; });
  by('column').addEventListener('change', (e) => chooseColumn(e.target.value));
  by('names').addEventListener('change', redraw);
  by('home').addEventListener('click', home);
  by('play').addEventListener('click', () => play(!state.playing));
  by('time').addEventListener('input', (e) => { play(false); setTime(first + Number(e.target.value) * (last - first)); });
  addEventListener('keydown', (e) => {
    if (/^(select|input|button)$/i.test(e.target.tagName)) return;
    if (e.key === ' ') { e.preventDefault(); play(!state.playing); }
    if (e.key === 'ArrowRight' || e.key === 'ArrowLeft') setTime(t[Math.min(Math.max(row() + (e.key === 'ArrowRight' ? 1 : -1), 0), t.length - 1)]);
  });

  /** For tests and for a console: what the page shows where. */
  window.cutjoint = {
    setTime, choose, play,
    /** The pixel in the picture at which a body's centre of mass is at a time, s. */
    project(body, time) { setTime(time); camera.updateMatrixWorld(); return place(body).slice(0, 2); },
    /** Where the eye is and what it looks at, in the scene's axes (y is up), its angle of view in degrees, and the picture's size in pixels. */
    eye() { return { from: camera.position.toArray(), to: orbit.target.toArray(), angle: camera.fov, size: [picture.clientWidth, picture.clientHeight] }; },
    shown() { return { ...state, row: row() }; },
    frames() { return renderer.info.render.frame; },
  };

  new GLTFLoader().parse(bytes('glb'), '', (gltf) => { load(gltf); listValues(); drawPlot(); }, (error) => { throw error; });
})();
