// One chart of all measured points: choose a scene and an accuracy, read what to take, filter the lines, point at a point.
'use strict';
(() => {
  const { cases, targets } = JSON.parse(document.getElementById('points').textContent);
  const by = (id) => document.getElementById(id);
  const SVG = 'http://www.w3.org/2000/svg', SIZE = { width: 1040, height: 460, left: 62, right: 16, top: 12, bottom: 46 };
  const COLOURS = ['#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#999933', '#882255', '#117733', '#AA4499', '#8C564B', '#888888'];
  const FACETS = ['kind', 'method', 'integrator'];
  const VIEWS = {
    outputs: { words: "time over error of the scene's outputs", x: 4, y: 1, xTitle: "error of the scene's outputs, m or rad", reverse: true },
    position: { words: 'time over error of position', x: 2, y: 1, xTitle: 'error of position, m', reverse: true },
    velocity: { words: 'time over error of velocity', x: 3, y: 1, xTitle: 'error of velocity, m/s', reverse: true },
    step: { words: 'error of position over step', x: 0, y: 2, xTitle: 'step, s (equal steps alone)', reverse: false },
  };
  const off = new Set();  // facets that are left out, as "facet value"
  const NEAR = 2, MANY = 12;  // lines that are near the frontier: within so many times the shortest time somewhere
  const state = { near: false, scene: 0, target: 1e-4, view: 'outputs', lit: '' };

  const chosen = () => cases[state.scene];
  const allowed = () => chosen().lines.filter((line) => FACETS.every((facet) => !off.has(`${facet} ${line[facet]}`)));
  const shown = () => (state.near ? nearFrontier(allowed()) : allowed());
  const milliseconds = (seconds) => `${+(1e3 * seconds).toPrecision(3)} ms`;

  function make(kind, attributes, parent, text) {
    const made = document.createElementNS(SVG, kind);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    if (text !== undefined) made.textContent = text;
    parent.append(made);
    return made;
  }

  const hasOutputs = () => chosen().lines.some((line) => line.points.some((p) => p[4] > 0));
  /** The error that an accuracy is of: that of the outputs where a chart shows it, else that of position. */
  const measure = () => (state.view === 'outputs' ? 4 : 2);
  const unit = () => (state.view === 'outputs' ? 'm or rad' : 'm');
  const isDrawn = (p, view) => p[view.x] > 0 && p[view.y] > 0;

  /** The lines with a point that takes at most NEAR times the shortest time at its error. */
  function nearFrontier(lines) {
    const error = measure(), points = lines.flatMap((line) => line.points).filter((p) => p[error] > 0);
    const least = (e) => Math.min(...points.filter((p) => p[error] <= e).map((p) => p[1]));
    return lines.filter((line) => line.points.some((p) => p[error] > 0 && p[1] <= NEAR * least(p[error])));
  }

  /** Of each line that is accurate enough somewhere its fastest such point, the fastest first. */
  function ranking() {
    const best = shown().flatMap((line) => {
      const good = line.points.filter((p) => p[measure()] !== null && p[measure()] <= state.target).sort((a, b) => a[1] - b[1]);
      return good.length ? [{ line, point: good[0] }] : [];
    });
    return best.sort((a, b) => a.point[1] - b.point[1]);
  }

  function answer() {
    const found = ranking(), { end } = chosen();
    if (!found.length) {
      by('answer').textContent = `Nothing that is shown comes to ${state.target} ${unit()}.`;
      by('others').textContent = '';
      return;
    }
    const [{ line, point }] = found;
    by('answer').textContent = `Take ${line.label}, ${point[5]}: ${milliseconds(point[1])} for ${end} s of motion, error ${point[measure()].toExponential(1)} ${unit()}.`;
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
    SIZE.width = Math.min(1040, Math.max(320, Math.round(svg.clientWidth)));  // so that letters keep their size on narrow screens
    svg.setAttribute('viewBox', `0 0 ${SIZE.width} ${SIZE.height}`);
    svg.replaceChildren();
    const points = all.flatMap((line) => line.points).filter((p) => isDrawn(p, view));
    if (!points.length) return;
    const { width, height, left, right, top, bottom } = SIZE, ends = [left + 10, width - right - 10];
    const x = scale(points.map((p) => p[view.x]), ...(view.reverse ? [...ends].reverse() : ends));
    const y = scale(points.map((p) => p[view.y]), height - bottom - 8, top + 8);
    const frame = make('g', { class: 'frame' }, svg);
    const apart = Math.ceil((x.ticks.length * 44) / (width - left - right));
    for (const [i, tick] of x.ticks.entries()) {
      if (i % apart) continue;
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
    if (view.y === 1 && state.view !== 'velocity') make('line', { x1: x.place(state.target), x2: x.place(state.target), y1: top, y2: height - bottom, class: 'target' }, svg);
    if (view.y === 1) frontier(svg, lines.flatMap((line) => line.points).filter((p) => isDrawn(p, view)), view, x, y);
    for (const line of lines) {
      const own = line.points.filter((p) => isDrawn(p, view)).map((p) => [x.place(p[view.x]), y.place(p[view.y]), p]);
      if (!own.length) continue;
      const colour = COLOURS[all.indexOf(line) % COLOURS.length], g = make('g', { class: state.lit === line.label ? 'line lit' : 'line' }, svg);
      make('polyline', { points: own.map(([px, py]) => `${px},${py}`).join(' '), stroke: colour, 'stroke-dasharray': dashes(line, all) }, g);
      for (const [px, py, p] of own) {
        const dot = make('circle', { cx: px, cy: py, r: p[6] === line.own ? 6 : 4, stroke: colour, fill: p[6] === line.own ? 'none' : colour, tabindex: 0 }, g);
        for (const event of ['pointerenter', 'focus']) dot.addEventListener(event, () => tell(line, p, px, py));
        dot.addEventListener('pointerleave', () => { by('tip').hidden = true; });
      }
    }
    legend(lines, all);
  }

  /** The staircase below which no point that is shown lies: the shortest time at each error. */
  function frontier(svg, points, view, x, y) {
    const sorted = [...points].sort((a, b) => a[view.x] - b[view.x] || a[1] - b[1]), stairs = [];
    let least = Infinity;
    for (const p of sorted) {
      if (p[1] >= least) continue;
      if (stairs.length) stairs.push(`${x.place(p[view.x])},${y.place(least)}`);
      least = p[1];
      stairs.push(`${x.place(p[view.x])},${y.place(least)}`);
    }
    make('polyline', { points: stairs.join(' '), class: 'frontier' }, svg);
  }

  /** Beyond the last colour they begin again, with other dashes. */
  const dashes = (line, all) => (line.kind === 'peer' ? '7 4' : ['none', '2 3', '10 3 2 3'][Math.floor(all.indexOf(line) / COLOURS.length) % 3]);

  function tell(line, [, seconds, position, velocity, outputs, setting], px, py) {
    const tip = by('tip'), ratio = by('chart').clientWidth / SIZE.width;
    const errors = [[position, 'm'], [velocity, 'm/s']].filter(([e]) => e > 0).map(([e, of]) => `${e.toExponential(1)} ${of}`);
    if (errors.length) errors[0] = `error ${errors[0]}`;
    if (outputs > 0) errors.push(`of outputs ${outputs.toExponential(1)} m or rad`);
    tip.hidden = false;
    tip.textContent = `${line.label}\n${setting}, time ${milliseconds(seconds)}\n${errors.join(', ')}`;
    const left = Math.min(px * ratio + 14, by('chart').clientWidth - tip.offsetWidth);
    tip.style.transform = `translate(${Math.max(0, left)}px, ${Math.max(0, py * ratio - tip.offsetHeight - 10)}px)`;
  }

  function legend(lines, all) {
    by('legend').replaceChildren(...lines.map((line) => {
      const item = document.createElement('li'), mark = document.createElement('i');
      mark.style.borderTopColor = COLOURS[all.indexOf(line) % COLOURS.length];
      mark.style.borderTopStyle = dashes(line, all) === 'none' ? 'solid' : line.kind === 'peer' ? 'dashed' : 'dotted';
      item.append(mark, line.label);
      item.addEventListener('pointerenter', () => light(line.label));
      item.addEventListener('pointerleave', () => light(''));
      return item;
    }));
  }

  function light(label) {
    state.lit = label;
    const lines = shown().filter((line) => line.points.some((p) => isDrawn(p, VIEWS[state.view])));
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
  by('accuracy').replaceChildren(...targets.map((t) => new Option(t.toExponential(0), String(t), false, t === state.target)));
  /** Of many lines those are shown first that matter. */
  function thin() {
    state.near = chosen().lines.length > MANY;
    by('lines').value = state.near ? 'near' : 'all';
  }

  /** The charts of a scene; that of its outputs first, where their errors are known. */
  function views() {
    if (!hasOutputs() && state.view === 'outputs') state.view = 'position';
    const known = Object.entries(VIEWS).filter(([name]) => name !== 'outputs' || hasOutputs());
    by('view').replaceChildren(...known.map(([name, v]) => new Option(v.words, name, false, name === state.view)));
  }
  by('lines').addEventListener('change', (e) => { state.near = e.target.value === 'near'; show(); });
  by('scene').addEventListener('change', (e) => { state.scene = Number(e.target.value); thin(); views(); filters(); show(); });
  by('accuracy').addEventListener('change', (e) => { state.target = Number(e.target.value); show(); });
  by('view').addEventListener('change', (e) => { state.view = e.target.value; show(); });
  thin();
  views();
  filters();
  show();
  window.addEventListener('resize', draw);
  document.body.dataset.ready = 'yes';
})();
