// Values of outputs at the present time, and the plot.
let cells = [];
function listValues() {
  const own = columnsOf(state.body), lines = by('values').tBodies[0];
  cells = own.map((column) => {
    const line = lines.ownerDocument.createElement('tr');
    line.insertCell().textContent = column.name;
    line.className = column.name === state.column ? 'chosen' : '';
    line.addEventListener('click', () => chooseColumn(column.name));
    return { column, line, cell: line.insertCell(), other: ghost.columns.has(column.name) ? line.insertCell() : undefined };
  });
  lines.replaceChildren(...cells.map((c) => c.line));
  if (!own.length && !motions.length) {
    const line = lines.insertRow();
    line.className = 'note';
    line.insertCell().textContent = columns.length ? `The scene has no output of ${state.body}.` : 'The scene has no outputs.';
  }
  showValues();
}

function showValues() {
  const now = row();
  for (const { column, cell, other } of cells) {
    cell.textContent = `${+column.values[now].toFixed(column.decimals)} ${column.unit}`;
    if (other) other.textContent = +ghostValue(column.name).toFixed(column.decimals);
  }
}

function chooseColumn(name) {
  state.column = name;
  by('column').value = name;
  for (const { column, line } of cells) line.className = column.name === name ? 'chosen' : '';
  drawPlot();
}

let plot, now;
const plotSize = () => ({ width: by('plot').clientWidth || 300, height: 220 });

/** Texts of an axis, with as many decimals as tell its marks apart. */
function markTexts(marks, step) {
  let decimals = 0;
  while (decimals < 12 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-6 * step * 10 ** decimals) ++decimals;
  return marks.map((mark) => (Math.abs(mark) < 1e6 ? mark.toFixed(decimals) : String(+mark.toPrecision(6))));
}

function drawPlot() {
  const column = columns.find((c) => c.name === state.column), other = ghost.columns.get(state.column);
  if (plot) plot.destroy();
  plot = undefined;
  if (!column || t.length < 2) return;
  const style = getComputedStyle(document.documentElement), colour = (name) => style.getPropertyValue(name).trim();
  const axis = { stroke: colour('--faint'), grid: { stroke: colour('--line'), width: 1 }, ticks: { stroke: colour('--line'), width: 1 } };
  const options = {
    ...plotSize(), legend: { show: false }, cursor: { drag: { setScale: false, x: false, y: false }, y: false, points: { show: false } },
    scales: { x: { time: false } }, axes: [{ ...axis, label: 't in s', labelSize: 20, size: 34 }, { ...axis, size: 58, label: column.unit, labelSize: 18, values: (_, marks, i, space, step) => markTexts(marks, step) }],
    series: [{}, ...(other ? [{ stroke: colour('--ghost'), width: 1.5, dash: [6, 4], points: { show: false } }] : []),
      { stroke: colour('--accent'), width: 1.5, points: { show: false } }],
  };
  const own = [t, column.values];
  plot = new Plot(options, other ? Plot.join([[ghost.t, other], own]) : own, by('plot'));
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
