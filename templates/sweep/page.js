// The page of a sweep.
const about = JSON.parse(by('about').textContent);
const rows = about.shown, all = new Float64Array(rows).fill(0);
const table = new Float32Array(decoded(by('numbers').textContent));
const run = new Int32Array(table.buffer, 0, rows);
const withRange = (column, arrays) => {
  let low = Infinity, high = -Infinity;
  for (const values of arrays) for (const v of values) if (v === v) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(low < high)) { const half = Math.abs(low) * 0.05 || 0.5; low = (low === Infinity ? 0 : low) - half; high = low + 2 * half; }
  return {...column, low, high};
};
const columns = about.columns.map((column, i) => {
  const values = table.subarray((i + 1) * rows, (i + 2) * rows);
  return {...withRange(column, [values]), values};
});
const filters = new Map();  // from a column's index to its range
const curves = new Map(Object.entries(about.curves).map(([number, text]) => [+number, new Float32Array(decoded(text))]));
let kept = Array.from(all.keys()), marked = [];  // compared runs, in the order of their colours

const most = 6, markColour = (i) => colourOf(`--loop${i}`);  // of marked runs
const stops = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
const colour = (share, alpha) => {
  if (share !== share) return colourOf('--faint');  // of a run that failed
  const at = Math.max(0, Math.min(0.9999, share)) * 4, i = Math.floor(at), f = at - i;
  return `rgba(${stops[i].map((a, k) => Math.round(a + (stops[i + 1][k] - a) * f)).join(',')},${alpha})`;
};
const share = (column, v) => (v - column.low) / (column.high - column.low);
const text = (v) => (v !== v ? '–' : Math.abs(v) >= 1e5 || (v && Math.abs(v) < 1e-3) ? v.toExponential(2) : String(+v.toPrecision(4)));
const shown = (column, v) => (column.labels ? column.labels[Math.round(v)] : text(v));
const title = (column) => (column.unit ? `${column.name}, ${column.unit}` : column.name);
const canvas = (id) => {
  const c = by(id), ratio = window.devicePixelRatio || 1, box = c.parentElement.getBoundingClientRect();
  c.width = box.width * ratio; c.height = box.height * ratio;
  const g = c.getContext('2d');
  g.scale(ratio, ratio); g.clearRect(0, 0, box.width, box.height);
  return {g, width: box.width, height: box.height};
};

// All columns side by side.
const top = 66, bottom = 26;
const across = (i, width) => 70 + (columns.length > 1 ? i * (width - 140) / (columns.length - 1) : 0);
const drawLines = () => {
  const {g, width, height} = canvas('lines'), span = height - top - bottom, z = columns[+by('z').value];
  const isKept = new Uint8Array(rows);
  for (const r of kept) isKept[r] = 1;
  const line = (r) => {
    g.beginPath();
    let down = false;
    columns.forEach((c, i) => {
      const v = c.values[r];
      if (v !== v) { down = false; return; }
      const x = across(i, width), y = top + span * (1 - share(c, v));
      if (down) g.lineTo(x, y); else g.moveTo(x, y);
      down = true;
    });
    g.stroke();
  };
  g.lineWidth = 1; g.strokeStyle = colourOf('--line'); g.globalAlpha = Math.min(1, 600 / rows);
  if (kept.length < rows) for (let r = 0; r < rows; ++r) if (!isKept[r]) line(r);
  g.globalAlpha = Math.max(0.05, Math.min(0.8, 300 / Math.max(1, kept.length)));
  for (const r of kept) { g.strokeStyle = colour(share(z, z.values[r]), 1); line(r); }
  g.globalAlpha = 1;
  g.lineWidth = 3;
  marked.forEach((r, i) => { g.strokeStyle = markColour(i); line(r); });
  g.strokeStyle = colourOf('--faint'); g.lineWidth = 1;
  columns.forEach((_, i) => { const x = across(i, width); g.beginPath(); g.moveTo(x, top); g.lineTo(x, top + span); g.stroke(); });
};
by('wide').style.minWidth = `${112 * columns.length}px`;
const placeAxes = () => {
  const box = by('wide').getBoundingClientRect(), span = box.height - top - bottom;
  by('axes').replaceChildren(...columns.map((column, i) => {
    const name = make('b', {textContent: title(column).replaceAll('_', '_\u200b')});  // a long name may be broken here
    const ticks = column.labels ? column.labels.map((_, k) => k) : [column.high, column.low];
    const marks = ticks.map((v) => {
      const at = column.labels ? top + span * (1 - share(column, v)) - 8 : v === column.high ? top - 18 : top + span + 3;
      return make('i', {textContent: shown(column, v), style: `top: ${at}px`});
    });
    const axis = make('div', {className: `axis ${column.role}`, style: `left: ${across(i, box.width)}px`}, name, ...marks);
    axis.dataset.column = i;
    const [from, to] = (filters.get(i) ?? []).map((v) => top + span * (1 - share(column, v)));
    if (filters.has(i)) axis.append(make('u', {style: `top: ${to}px; height: ${Math.max(3, from - to)}px`}));
    return axis;
  }));
};
const valueAt = (column, y) => {
  const box = by('wide').getBoundingClientRect(), span = box.height - top - bottom;
  const part = 1 - (y - box.top - top) / span;
  return column.low + Math.max(-0.01, Math.min(1.01, part)) * (column.high - column.low);
};
let drag = null;
by('axes').addEventListener('pointerdown', (event) => {
  const axis = event.target.closest('.axis');
  if (!axis) return;
  drag = {i: +axis.dataset.column, from: event.clientY, moved: false};
  by('axes').setPointerCapture(event.pointerId);
});
by('axes').addEventListener('pointermove', (event) => {
  if (!drag || Math.abs(event.clientY - drag.from) < 3 && !drag.moved) return;
  drag.moved = true;
  const ends = [valueAt(columns[drag.i], drag.from), valueAt(columns[drag.i], event.clientY)];
  filters.set(drag.i, [Math.min(...ends), Math.max(...ends)]);
  refresh();
});
by('axes').addEventListener('pointerup', () => {
  if (drag && !drag.moved) { filters.delete(drag.i); refresh(); }
  drag = null;
});

// Two columns and a colour.
const margin = {left: 74, right: 96, top: 14, bottom: 46};
const better = (column, a, b) => (column.goal === 'larger' ? a > b : a < b);
const front = (x, y) => {
  const order = kept.filter((r) => x.values[r] === x.values[r] && y.values[r] === y.values[r]);
  order.sort((a, b) => (x.values[a] === x.values[b] ? (better(y, y.values[a], y.values[b]) ? -1 : 1) : better(x, x.values[a], x.values[b]) ? -1 : 1));
  const found = [];
  for (const r of order) if (!found.length || better(y, y.values[r], y.values[found[found.length - 1]])) found.push(r);
  return found;
};
const marks = (low, high) => {
  const raw = (high - low) / 5, power = 10 ** Math.floor(Math.log10(raw)), step = [1, 2, 5, 10].find((s) => s * power >= raw) * power;
  const list = [];
  for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-9; v += step) list.push(Math.abs(v) < step * 1e-9 ? 0 : v);
  return list;
};
/** Draws axes of two columns with their names; returns the scales. */
const drawPlane = ({g, width, height}, x, y) => {
  const w = width - margin.left - margin.right, h = height - margin.top - margin.bottom;
  const px = (v) => margin.left + w * (0.02 + 0.96 * share(x, v)), py = (v) => margin.top + h * (0.98 - 0.96 * share(y, v));
  g.font = '12px system-ui, sans-serif'; g.fillStyle = colourOf('--faint'); g.strokeStyle = colourOf('--line');
  g.textAlign = 'center';
  for (const v of x.labels ? x.labels.keys() : marks(x.low, x.high)) {
    g.beginPath(); g.moveTo(px(v), margin.top); g.lineTo(px(v), margin.top + h); g.stroke();
    g.fillText(shown(x, v), px(v), margin.top + h + 16);
  }
  g.textAlign = 'right';
  for (const v of y.labels ? y.labels.keys() : marks(y.low, y.high)) {
    g.beginPath(); g.moveTo(margin.left, py(v)); g.lineTo(margin.left + w, py(v)); g.stroke();
    g.fillText(shown(y, v), margin.left - 8, py(v) + 4);
  }
  g.fillStyle = colourOf('--ink'); g.textAlign = 'center';
  g.fillText(title(x), margin.left + w / 2, height - 10);
  g.save(); g.translate(16, margin.top + h / 2); g.rotate(-Math.PI / 2); g.fillText(title(y), 0, 0); g.restore();
  return {px, py, x, y};
};
let plane = null;
const drawPoints = () => {
  const on = canvas('points'), {g, width} = on;
  const [x, y, z] = ['x', 'y', 'z'].map((id) => columns[+by(id).value]);
  plane = drawPlane(on, x, y);
  const {px, py} = plane;
  for (const r of kept) {
    const a = x.values[r], b = y.values[r];
    if (a !== a || b !== b) continue;
    g.fillStyle = colour(share(z, z.values[r]), 0.75);
    g.beginPath(); g.arc(px(a), py(b), kept.length > 2000 ? 2 : 3, 0, 7); g.fill();
  }
  const hasFront = x.role === 'objective' && y.role === 'objective' && x !== y;
  by('with-front').hidden = !hasFront;
  if (hasFront && by('front').checked) drawFront(g, front(x, y), x, y, px, py);
  g.lineWidth = 2.5;
  marked.forEach((r, i) => {
    g.strokeStyle = markColour(i);
    g.beginPath(); g.arc(px(x.values[r]), py(y.values[r]), 7, 0, 7); g.stroke();
  });
  for (let i = 0; i < 100; ++i) { g.fillStyle = colour(i / 99, 1); g.fillRect(width - 62, margin.top + 40 + 1.4 * (99 - i), 12, 1.6); }
  g.fillStyle = colourOf('--ink'); g.textAlign = 'center';
  title(z).split(', ').forEach((word, i) => g.fillText(word.slice(0, 14), width - 50, margin.top + 12 + 14 * i));
  g.fillStyle = colourOf('--faint');
  g.textAlign = 'left'; g.fillText(shown(z, z.high), width - 46, margin.top + 50); g.fillText(shown(z, z.low), width - 46, margin.top + 178);
};
const drawFront = (g, found, x, y, px, py) => {
  g.strokeStyle = colourOf('--ink'); g.lineWidth = 1.5;
  g.beginPath();
  found.forEach((r, i) => {
    if (i) { g.lineTo(px(x.values[r]), py(y.values[found[i - 1]])); g.lineTo(px(x.values[r]), py(y.values[r])); }
    else g.moveTo(px(x.values[r]), py(y.values[r]));
  });
  g.stroke(); g.lineWidth = 1;
  g.fillStyle = colourOf('--ink');
  for (const r of found) { g.beginPath(); g.arc(px(x.values[r]), py(y.values[r]), 2.5, 0, 7); g.fill(); }
};
const nearest = (event) => {
  if (!plane) return -1;
  const box = by('points').getBoundingClientRect(), a = event.clientX - box.left, b = event.clientY - box.top;
  let best = -1, least = 14;
  for (const r of kept) {
    const away = Math.hypot(plane.px(plane.x.values[r]) - a, plane.py(plane.y.values[r]) - b);
    if (away < least) { least = away; best = r; }
  }
  return best;
};
by('plane').addEventListener('pointermove', (event) => {
  const r = nearest(event), tip = by('tip');
  tip.hidden = r < 0;
  if (r < 0) return;
  const box = by('plane').getBoundingClientRect();
  tip.textContent = `run ${run[r]}: ${shown(plane.x, plane.x.values[r])}, ${shown(plane.y, plane.y.values[r])}`;
  tip.style.left = `${Math.min(event.clientX - box.left + 12, box.width - 200)}px`; tip.style.top = `${event.clientY - box.top + 12}px`;
});
by('plane').addEventListener('pointerleave', () => { by('tip').hidden = true; });
by('plane').addEventListener('click', (event) => choose(nearest(event), event));

// An output of the marked runs over time, for those simulated again.
const curve = (number, output) => {
  const all = curves.get(number), size = all.length / (1 + about.outputs.length);
  return {t: all.subarray(0, size), values: all.subarray((output + 1) * size, (output + 2) * size)};
};
const drawCurves = () => {
  const on = canvas('curves'), output = +by('output').value, missing = marked.filter((r) => !curves.has(run[r])).map((r) => run[r]);
  const series = marked.flatMap((r, i) => (curves.has(run[r]) ? [{i, ...curve(run[r], output)}] : []));
  by('without').textContent = missing.length ? `without a curve: ${missing.join(', ')}` : '';
  if (!series.length) return;
  const [name, unit] = about.outputs[output];
  const {px, py} = drawPlane(on, withRange({name: 't', unit: 's'}, series.map((s) => s.t)), withRange({name, unit}, series.map((s) => s.values)));
  on.g.lineWidth = 2;
  for (const {i, t, values} of series) {
    on.g.strokeStyle = markColour(i);
    on.g.beginPath();
    t.forEach((time, k) => { if (values[k] === values[k]) on.g.lineTo(px(time), py(values[k])); });
    on.g.stroke();
  }
};

// Single runs.
const replayed = (number) => {
  const known = number in about.replays;
  return make('a', {textContent: 'Replay', target: '_blank', title: `Run ${number} in the viewer`, hidden: !known, ...(known ? {href: about.replays[number]} : {})});
};
/** Mark a run alone or in addition; unmark a marked one. */
const choose = (r, event) => {
  const joins = event.ctrlKey || event.metaKey || event.shiftKey || event.target.type === 'checkbox';
  if (r < 0 || !joins) mark(r < 0 ? [] : [r]);
  else mark(marked.includes(r) ? marked.filter((other) => other !== r) : [...marked, r]);
};
const mark = (list) => {
  marked = list.slice(-most);
  by('run').hidden = !marked.length;
  const head = tableLine(['', ...marked.map((r) => run[r])], 'th');
  marked.forEach((_, i) => { head.cells[i + 1].style.color = markColour(i); });
  by('comparison').tHead.replaceChildren(head);
  by('comparison').tBodies[0].replaceChildren(...columns.map((c) => tableLine([title(c), ...marked.map((r) => shown(c, c.values[r]))])));
  by('number').textContent = `${marked.length > 1 ? 'Runs' : 'Run'} ${marked.map((r) => run[r]).join(', ')}`;
  by('by-command').hidden = marked.every((r) => run[r] in about.replays);
  const over = (i) => (i ? ` --ghost ${about.pages}${run[marked[0]]}.html` : '');
  by('command').textContent = marked.map((r, i) => `${about.command} --replay ${run[r]}${over(i)}`).join('\n');
  draw();
};
const inOrder = (column, sign) => kept.filter((r) => column.values[r] === column.values[r]).sort((a, b) => (
  better(column, column.values[a], column.values[b]) ? -sign : better(column, column.values[b], column.values[a]) ? sign : run[a] - run[b]));
const listEnds = () => {
  const column = columns[+by('of').value];
  for (const [id, sign] of [['best', 1], ['worst', -1]]) {
    by(id).tHead.replaceChildren(tableLine([id, title(column), ''], 'th'));
    by(id).tBodies[0].replaceChildren(...inOrder(column, sign).slice(0, 6).map((r) => {
      const place = marked.indexOf(r), label = `Compare run ${run[r]}`, made = tableLine(['', shown(column, column.values[r]), '']);
      made.cells[0].append(make('input', {type: 'checkbox', checked: place >= 0, title: label, ariaLabel: label}), String(run[r]));
      made.cells[2].append(replayed(run[r]));
      made.className = place >= 0 ? 'chosen' : '';
      made.style.setProperty('--colour', place >= 0 ? markColour(place) : '');
      made.addEventListener('click', (event) => { if (!event.target.href) choose(r, event); });
      return made;
    }));
  }
};
const markEnds = () => {
  const column = columns[+by('of').value];
  mark([...new Set([1, -1].flatMap((sign) => inOrder(column, sign).slice(0, 1)))]);
};
/** The filtered runs, with the page's digits. */
const keptText = () => {
  const head = ['run', ...columns.map((c) => quoted(heading(c)))];
  const cell = (c, v) => (v !== v ? '' : c.labels ? quoted(String(shown(c, v))) : +v.toPrecision(7));
  return [head, ...kept.map((r) => [run[r], ...columns.map((c) => cell(c, c.values[r]))])].map((line) => `${line.join(',')}\n`).join('');
};
by('save').addEventListener('click', () => save(`${stem()}.csv`, new Blob([keptText()], {type: 'text/csv'})));
by('copy').addEventListener('click', () => navigator.clipboard?.writeText(by('command').textContent));

const draw = () => { placeAxes(); drawLines(); drawPoints(); if (curves.size) drawCurves(); listEnds(); };
const refresh = () => {
  kept = Array.from(all.keys()).filter((r) => [...filters].every(([i, [low, high]]) => columns[i].values[r] >= low && columns[i].values[r] <= high));
  by('left').textContent = filters.size ? `${kept.length} of ${rows} pass the filters` : '';
  by('reset').disabled = !filters.size;
  mark(marked.filter((r) => kept.includes(r)));
};
by('reset').addEventListener('click', () => { filters.clear(); refresh(); });
const objectives = columns.flatMap((c, i) => (c.role === 'objective' ? [i] : []));
const fill = (id, list, value) => {
  by(id).replaceChildren(...list.map((i) => new Option(columns[i].name, i)));
  by(id).value = value;
  by(id).addEventListener('change', draw);
};
const every = [...columns.keys()], [first, second] = [objectives[0] ?? 0, objectives[1] ?? 0];
fill('x', every, first); fill('y', every, objectives.length > 1 ? second : every[0]); fill('z', every, objectives[2] ?? every[0]);
fill('of', objectives.length ? objectives : every, first);
by('of').addEventListener('change', markEnds);
by('output').replaceChildren(...about.outputs.map(([name], i) => new Option(name, i)));
by('over-time').hidden = !curves.size;
for (const id of ['front', 'output']) by(id).addEventListener('change', draw);
by('title').textContent = about.title; by('subtitle').textContent = about.note;
by('failed').hidden = !about.failures.length;
by('failures').replaceChildren(...about.failures.map(({number, reason}) => make('li', {}, `${number}: ${reason} `, replayed(number))));
window.addEventListener('resize', draw);
window.matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
window.sweep = {
  marked: () => marked.map((r) => run[r]), curve: (number, name) => Array.from(curve(number, about.outputs.findIndex((o) => o[0] === name)).values),
  kept: () => kept.map((r) => run[r]), front: () => front(columns[+by('x').value], columns[+by('y').value]).map((r) => run[r]),
  point: (number) => { const r = run.indexOf(number), box = by('points').getBoundingClientRect(); return [box.left + plane.px(plane.x.values[r]), box.top + plane.py(plane.y.values[r])]; },
};
refresh();
markEnds();
document.body.dataset.ready = 'yes';
