// Values of outputs at the present time, and the plot.
let cells = [];
function listValues() {
  const own = columnsOf(state.body), lines = by('values').tBodies[0];
  cells = own.map((column) => {
    const title = `${column.name} in the plot`, line = make('tr'), name = line.insertCell(), tick = make('input', { type: 'checkbox', title, ariaLabel: title });
    tick.addEventListener('click', (e) => e.stopPropagation());
    tick.addEventListener('change', () => toggleColumn(column.name));
    name.append(tick, column.name);
    line.addEventListener('click', (e) => (e.ctrlKey || e.metaKey || e.shiftKey ? toggleColumn(column.name) : chooseColumns([column.name])));
    return { column, line, tick, cell: line.insertCell(), other: ghost.columns.has(column.name) ? line.insertCell() : undefined };
  });
  lines.replaceChildren(...cells.map((c) => c.line));
  if (!own.length && !motions.length) {
    const line = lines.insertRow();
    line.className = 'note';
    line.insertCell().textContent = columns.length ? `The scene has no output of ${state.body}.` : 'The scene has no outputs.';
  }
  markChosen();
  showValues();
}

/** Lines of the list have the colours of their curves in the plot. */
function markChosen() {
  for (const { column, line, tick } of cells) {
    const place = state.chosen.indexOf(column.name);
    line.className = place < 0 ? '' : 'chosen';
    line.style.setProperty('--colour', place < 0 ? '' : curveColour(place));
    tick.checked = place >= 0;
  }
}

function showValues() {
  const now = row();
  for (const { column, cell, other } of cells) {
    cell.textContent = `${+column.values[now].toFixed(column.decimals)} ${column.unit}`;
    if (other) other.textContent = +ghostValue(column.name).toFixed(column.decimals);
  }
}

function chooseColumns(names) {
  state.chosen = names;
  by('column').value = names[0] ?? '';
  markChosen();
  drawPlot();
}

/** Chooses a column, or by `#` and its number a plot of the scene. */
function choosePlot(value) {
  const named = value.startsWith('#') ? about.plots[Number(value.slice(1))] : undefined;
  if (named) by('abscissa').value = state.over = named.x === 't' ? '' : named.x;
  chooseColumns(named ? named.y : [value]);
  by('column').value = value;
}

function toggleColumn(name) {
  chooseColumns(state.chosen.includes(name) ? state.chosen.filter((other) => other !== name) : [...state.chosen, name]);
}

let plot, now;
const plotSize = () => ({ width: by('plot').clientWidth || 300, height: 220 });

/** Tick labels of an axis, with as many decimals as distinguish them. */
function markTexts(marks, step) {
  let decimals = 0;
  while (decimals < 12 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6 * step * 10 ** decimals) ++decimals;
  return marks.map((mark) => (Math.abs(mark) < 1e6 ? mark.toFixed(decimals) : String(+mark.toPrecision(6))));
}

const curveColour = (place) => colourOf(place ? `--loop${place % 6}` : '--accent');

/** The chosen curves, over the time or over another column; those of an earlier run are dashed. */
function drawPlot() {
  const chosen = state.chosen.map((name) => columns.find((c) => c.name === name)).filter(Boolean);
  const over = columns.find((c) => c.name === state.over);
  if (plot) plot.destroy();
  plot = undefined;
  if (!chosen.length || t.length < 2) return;
  const curves = chosen.flatMap((column, i) => {
    const own = { column, stroke: curveColour(i), values: column.values, x: over ? over.values : t };
    const earlier = ghost.columns.get(column.name), x = over ? ghost.columns.get(over.name) : ghost.t;
    return earlier && x ? [{ ...own, stroke: chosen.length > 1 ? own.stroke : colourOf('--ghost'), dash: [6, 4], values: earlier, x }, own] : [own];
  });
  const units = [...new Set(chosen.map((c) => c.unit))];
  const axis = { stroke: colourOf('--faint'), grid: { stroke: colourOf('--line'), width: 1 }, ticks: { stroke: colourOf('--line'), width: 1 } };
  const upright = (unit, i) => ({
    ...axis, scale: `y${i}`, side: i ? 1 : 3, size: 58, label: unit, labelSize: 18, grid: i ? { show: false } : axis.grid,
    values: (_, marks, k, space, step) => markTexts(marks, step),
  });
  const options = {
    ...plotSize(), legend: { show: false }, hooks: { setScale: [() => cursor()] }, mode: over ? 2 : 1, cursor: { drag: { setScale: true, x: true, y: Boolean(over) }, y: false, points: { show: false } },
    scales: { x: { time: false }, ...Object.fromEntries(units.map((_, i) => [`y${i}`, {}])) },
    axes: [{ ...axis, label: over ? `${over.name} in ${over.unit || '1'}` : 't in s', labelSize: 20, size: 34,
      values: (_, marks, k, space, step) => markTexts(marks, step) }, ...units.slice(0, 2).map(upright)],
    series: [over ? null : {}, ...curves.map(({ column, stroke, dash }) => {
      const scale = `y${units.indexOf(column.unit)}`;
      return { scale, stroke, dash, width: 1.5, points: { show: false }, ...(over ? { facets: [{ scale: 'x', auto: true }, { scale, auto: true }], paths: through } : {}) };
    })],
  };
  const data = over ? [null, ...curves.map(({ x, values }) => [x, values])] : joined(curves);
  plot = new Plot(options, data, by('plot'));
  let pressedAt = 0;
  plot.over.addEventListener('mousedown', (e) => { pressedAt = e.offsetX; });
  plot.over.addEventListener('click', (e) => {
    if (over || about.drive || Math.abs(e.offsetX - pressedAt) > 3) return;  // a dragged range is zoomed to
    play(false);
    setTime(plot.posToVal(e.offsetX, 'x'));
  });
  now = plot.over.appendChild(make('div', { className: over ? 'now dot' : 'now', style: over ? `background: ${curves.at(-1).stroke}` : '' }));
  cursor();
}

/** Joins curves with different times as uPlot needs them. */
function joined(curves) {
  const times = [...new Set(curves.map((curve) => curve.x))], of = (x) => curves.filter((curve) => curve.x === x);
  const order = times.flatMap(of), found = Plot.join(times.map((x) => [x, ...of(x).map((curve) => curve.values)]));
  return [found[0], ...curves.map((curve) => found[1 + order.indexOf(curve)])];
}

/** The path of a curve over another column, from row to row. */
function through(self, series) {
  const [xs, ys] = self.data[series], stroke = new Path2D(), { facets } = self.series[series];
  let drawn = false;
  for (let i = 0; i < xs.length; i++) {
    const known = Number.isFinite(xs[i]) && Number.isFinite(ys[i]);
    if (known) stroke[drawn ? 'lineTo' : 'moveTo'](self.valToPos(xs[i], facets[0].scale, true), self.valToPos(ys[i], facets[1].scale, true));
    drawn = known;
  }
  return { stroke };
}

/** Moves the cursor in the plot to the present time. */
function cursor() {
  if (!now || !plot) return;
  const over = columns.find((c) => c.name === state.over), scale = plot.series.at(-1).scale, { clientWidth: width, clientHeight: height } = plot.over;
  const x = plot.valToPos(over ? over.values[row()] : state.time, 'x');
  const y = over ? plot.valToPos(columns.find((c) => c.name === state.chosen.at(-1)).values[row()], scale) : 0;
  now.hidden = !(x >= 0 && x <= width && y >= 0 && y <= height);
  now.style.transform = `translate(${x}px, ${y}px)`;
}
