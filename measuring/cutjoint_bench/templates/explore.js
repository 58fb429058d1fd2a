// One chart of all measured points: choose a scene and an accuracy, read what to take, filter the lines, point at a point.
'use strict';
(() => {
  const { cases, targets } = JSON.parse(document.getElementById('points').textContent);
  const by = (id) => document.getElementById(id);
  const SVG = 'http://www.w3.org/2000/svg', SIZE = { width: 1040, height: 460, left: 72, right: 16, top: 12, bottom: 46 };
  const COLOURS = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#999933', '#882255', '#117733', '#AA4499', '#8C564B', '#888888'];
  const FACETS = ['kind', 'method', 'integrator'];
  const VIEWS = {
    position: { words: 'time over error of position', x: 2, y: 1, xTitle: 'error of position, m', reverse: true },
    velocity: { words: 'time over error of velocity', x: 3, y: 1, xTitle: 'error of velocity, m/s', reverse: true },
    step: { words: 'error of position over step', x: 0, y: 2, xTitle: 'step, s', reverse: false },
  };
  const off = new Set();  // facets that are left out, as "facet value"
  const state = { scene: 0, target: 1e-4, view: 'position', lit: '' };

  const chosen = () => cases[state.scene];
  const shown = () => chosen().lines.filter((line) => FACETS.every((facet) => !off.has(`${facet} ${line[facet]}`)));
  const milliseconds = (seconds) => `${+(1e3 * seconds).toPrecision(3)} ms`;

  function make(kind, attributes, parent, text) {
    const made = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    parent.append(made);
    return made;
  }

  /** Of each line that is accurate enough somewhere its fastest such point, the fastest first. */
  function ranking() {
    const best = shown().flatMap((line) => {
      const good = line.points.filter((p) => p[2] <= state.target).sort((a, b) => a[1] - b[1]);
      return good.length ? [{ line, point: good[0] }] : [];
    });
    return best.sort((a, b) => a.point[1] - b.point[1]);
  }

  function answer() {
    const found = ranking(), { end } = chosen();
    if (!found.length) {
      by('answer').textContent = `Nothing that is shown comes to ${state.target} m.`;
      by('others').textContent = '';
      return;
    }
    const [{ line, point }] = found;
    by('answer').textContent = `Take ${line.label} with a step of ${milliseconds(point[0])}: ${milliseconds(point[1])} for ${end} s of motion, error ${point[2].toExponential(1)} m.`;
    const next = found.slice(1, 5).map((f) => `${f.line.label} (${+(f.point[1] / point[1]).toPrecision(2)} times as long)`);
    by('others').textContent = next.length ? `Then: ${next.join("; ")}.` : '';
  }

  function scale(values, from, to) {
    const logs = values.map(Math.log10), low = Math.floor(Math.min(...logs) * 5) / 5, high = Math.ceil(Math.max(...logs) * 5) / 5 || low + 1;
    const span = high > low ? high - low : 1;
    const place = (value) => from + ((Math.log10(value) - low) / span) * (to - from);
    const ticks = [];
    for (let power = Math.ceil(low); power <= high; power++) ticks.push(10 ** power);
    return { place, ticks };
  }

  function draw() {
    const svg = by('chart'), view = VIEWS[state.view], lines = shown(), all = chosen().lines;
    svg.replaceChildren();
    const points = all.flatMap((line) => line.points).filter((p) => p[view.x] > 0 && p[view.y] > 0);
    if (!points.length) return;
    const { width, height, left, right, top, bottom } = SIZE, ends = [left + 10, width - right - 10];
    const x = scale(points.map((p) => p[view.x]), ...(view.reverse ? [...ends].reverse() : ends));
    const y = scale(points.map((p) => p[view.y]), height - bottom - 8, top + 8);
    const frame = make('g', { class: 'frame' }, svg);
    for (const tick of x.ticks) {
      make('line', { x1: x.place(tick), x2: x.place(tick), y1: top, y2: height - bottom }, frame);
      make('text', { x: x.place(tick), y: height - bottom + 18, 'text-anchor': 'middle' }, frame, tick.toExponential(0));
    }
    for (const tick of y.ticks) {
      make('line', { x1: left, x2: width - right, y1: y.place(tick), y2: y.place(tick) }, frame);
      make('text', { x: left - 8, y: y.place(tick) + 4, 'text-anchor': 'end' }, frame, tick.toExponential(0));
    }
    make('text', { x: (left + width - right) / 2, y: height - 8, 'text-anchor': 'middle', class: 'title' }, frame, view.xTitle);
    const yTitle = view.y === 1 ? `time for ${chosen().end} s of motion, s` : 'error of position, m';
    make('text', { x: 14, y: (top + height - bottom) / 2, transform: `rotate(-90 14 ${(top + height - bottom) / 2})`, 'text-anchor': 'middle', class: 'title' }, frame, yTitle);
    if (state.view === 'position') make('line', { x1: x.place(state.target), x2: x.place(state.target), y1: top, y2: height - bottom, class: 'target' }, svg);
    for (const line of lines) {
      const own = line.points.filter((p) => p[view.x] > 0 && p[view.y] > 0).map((p) => [x.place(p[view.x]), y.place(p[view.y]), p]);
      if (!own.length) continue;
      const colour = COLOURS[all.indexOf(line) % COLOURS.length], g = make('g', { class: state.lit === line.label ? 'line lit' : 'line' }, svg);
      make('polyline', { points: own.map(([px, py]) => `${px},${py}`).join(' '), stroke: colour, 'stroke-dasharray': line.kind === 'peer' ? '7 4' : 'none' }, g);
      for (const [px, py, p] of own) {
        const dot = make('circle', { cx: px, cy: py, r: p[0] === line.own ? 6 : 4, stroke: colour, fill: p[0] === line.own ? 'none' : colour, tabindex: 0 }, g);
        for (const event of ['pointerenter', 'focus']) dot.addEventListener(event, () => tell(line, p, px, py));
        dot.addEventListener('pointerleave', () => { by('tip').hidden = true; });
      }
    }
    legend(lines, all);
  }

  function tell(line, [dt, seconds, position, velocity], px, py) {
    const tip = by('tip'), ratio = by('chart').clientWidth / SIZE.width;
    tip.hidden = false;
    tip.textContent = `${line.label}\nstep ${milliseconds(dt)}, time ${milliseconds(seconds)}\nerror ${position.toExponential(1)} m${velocity > 0 ? `, ${velocity.toExponential(1)} m/s` : ''}`;
    const left = Math.min(px * ratio + 14, by('chart').clientWidth - tip.offsetWidth);
    tip.style.transform = `translate(${Math.max(0, left)}px, ${Math.max(0, py * ratio - tip.offsetHeight - 10)}px)`;
  }

  function legend(lines, all) {
    by('legend').replaceChildren(...lines.map((line) => {
      const item = document.createElement('li'), mark = document.createElement('i');
      mark.style.borderTopColor = COLOURS[all.indexOf(line) % COLOURS.length];
      mark.style.borderTopStyle = line.kind === 'peer' ? 'dashed' : 'solid';
      item.append(mark, line.label);
      item.addEventListener('pointerenter', () => light(line.label));
      item.addEventListener('pointerleave', () => light(''));
      return item;
    }));
  }

  function light(label) {
    state.lit = label;
    const lines = shown().filter((line) => line.points.some((p) => p[VIEWS[state.view].x] > 0 && p[VIEWS[state.view].y] > 0));
    by('chart').querySelectorAll('.line').forEach((g, i) => g.classList.toggle('lit', lines[i]?.label === label));
    by('chart').classList.toggle('lighting', label !== '');
  }

  function filters() {
    by('filters').replaceChildren(...FACETS.map((facet) => {
      const group = document.createElement('fieldset'), title = document.createElement('legend');
      title.textContent = facet;
      group.append(title);
      for (const value of new Set(chosen().lines.map((line) => line[facet]))) {
        const label = document.createElement('label'), box = document.createElement('input'), key = `${facet} ${value}`;
        Object.assign(box, { type: 'checkbox', checked: !off.has(key), value });
        box.addEventListener('change', () => {
          if (box.checked) off.delete(key);
          else off.add(key);
          show();
        });
        label.append(box, value);
        group.append(label);
      }
      return group;
    }));
  }

  function show() {
    by('tip').hidden = true;
    answer();
    draw();
  }

  by('scene').replaceChildren(...cases.map((c, i) => new Option(c.name, String(i))));
  by('accuracy').replaceChildren(...targets.map((t) => new Option(`${t.toExponential(0)} m`, String(t), false, t === state.target)));
  by('view').replaceChildren(...Object.entries(VIEWS).map(([name, v]) => new Option(v.words, name)));
  by('scene').addEventListener('change', (e) => { state.scene = Number(e.target.value); filters(); show(); });
  by('accuracy').addEventListener('change', (e) => { state.target = Number(e.target.value); show(); });
  by('view').addEventListener('change', (e) => { state.view = e.target.value; show(); });
  filters();
  show();
  document.body.dataset.ready = 'yes';
})();
