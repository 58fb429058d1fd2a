// The topology: bodies and joints as a graph that can be panned and zoomed; a click shows an element's details.
const { graph } = about;
const SVG = 'http://www.w3.org/2000/svg';
const parts = new Map();  // of the graph, by the element's name
const eyeOfGraph = { x: 0, y: 0, scale: 1 };
let selected = '';

function shape(parent, kind, attributes, text) {
  const made = document.createElementNS(SVG, kind);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

/** The group of an element, which a click selects. */
function part(parent, name, kind) {
  const made = shape(parent, 'g', { class: kind, tabindex: 0, role: 'button', 'aria-label': name });
  made.addEventListener('click', () => select(name));
  made.addEventListener('keydown', (e) => { if (e.key === 'Enter') select(name); });
  parts.set(name, made);
  return made;
}

function drawGraph() {
  const bodies = new Map(graph.bodies.map((b) => [b.name, b])), svg = by('graph');
  const edges = shape(svg, 'g', {}), boxes = shape(svg, 'g', {});
  for (const link of graph.links.filter((l) => !l.cut)) drawTreeJoint(edges, link, bodies);
  for (const [i, link] of graph.links.filter((l) => l.cut).entries()) drawCut(edges, link, i, bodies);
  for (const body of graph.bodies) {
    const g = part(boxes, body.name, `body family${body.family < 0 ? '' : body.family % 6}${body.is_removed ? ' gone' : ''}`);
    shape(g, 'rect', { x: body.x, y: body.y - 13, width: body.width, height: 26, rx: 6 });
    shape(g, 'text', { x: body.x + body.width / 2, y: body.y + 4, 'text-anchor': 'middle' }, body.short);
  }
}

/** A joint as a path, with its name at a place. */
function drawJoint(parent, link, kind, d, place) {
  const g = part(parent, link.name, kind + (link.is_noted ? ' noted' : '') + (link.is_removed ? ' gone' : ''));
  shape(g, 'path', { d, class: 'reach' });
  shape(g, 'path', { d });
  const label = shape(g, 'text', place, link.short);
  if (link.is_noted) shape(label, 'tspan', { class: 'alarm' }, ' !');
}

function drawTreeJoint(parent, link, bodies) {
  const [a, b] = [bodies.get(link.base), bodies.get(link.follower)].sort((one, other) => one.x - other.x), from = a.x + a.width;
  drawJoint(parent, link, 'joint', `M ${from} ${a.y} H ${from + 12} V ${b.y} H ${b.x}`, { x: b.x - 8, y: b.y - 5, 'text-anchor': 'end' });
}

/** A path from a side of a body: straight to the right, or first up or down to a free position. */
const leave = (body, height) => Math.abs(height - body.y) < 12 ? `M ${body.x + body.width} ${height}`
  : `M ${body.x + body.width - 8} ${body.y + (height < body.y ? -13 : 13)} V ${height}`;

function drawCut(parent, link, number, bodies) {
  const a = bodies.get(link.base), b = bodies.get(link.follower), [from, to] = link.heights;
  const last = Math.max(...graph.links.filter((l) => l.cut).map((l) => l.lane));
  drawJoint(parent, link, `cut loop${number % 6}`, `${leave(a, from)} H ${link.lane} V ${to} ${leave(b, to)} H ${link.lane}`,
    { x: last + 12, y: placeOf((from + to) / 2) + 4 });
}

const taken = [];
/** A free height for a name near the wanted one. */
function placeOf(wanted) {
  let y = wanted;
  for (let step = 1; taken.some((other) => Math.abs(other - y) < 15); step++) y = wanted + (step % 2 ? 1 : -1) * Math.ceil(step / 2) * 15;
  taken.push(y);
  return y;
}

/** Shows an element's details and highlights it with its loop. */
function select(name) {
  selected = selected === name ? '' : name;
  const link = graph.links.find((l) => l.name === selected), body = graph.bodies.find((b) => b.name === selected);
  const lit = new Set([selected, ...(link?.members ?? []), ...(link ? [link.base, link.follower] : [])]);
  by('graph').classList.toggle('choosing', selected !== '');
  for (const [other, g] of parts) g.classList.toggle('lit', lit.has(other));
  const [place, line, ...notes] = (link ?? body)?.about ?? [];
  by('detail').hidden = !selected;
  by('element').textContent = selected;
  by('kind').textContent = link ? `${link.cut && link.kind !== 'gear' ? 'cut, ' : ''}${link.kind}, ${link.base} to ${link.follower}` : 'body';
  by('line').textContent = place === undefined ? 'the fixed world' : `${place}\n${line}`;
  by('notes').replaceChildren(...notes.map((textContent) => make('li', { textContent })));
  if (body && nodes.has(selected)) choose(selected);
}

function lookAtGraph() {
  const { clientWidth: width, clientHeight: height } = picture, { x, y, scale } = eyeOfGraph;
  by('graph').setAttribute('viewBox', `${x} ${y} ${width / scale} ${height / scale}`);
}

/** Fits the graph into view, without magnification. */
function fitGraph() {
  const { clientWidth: width, clientHeight: height } = picture;
  const scale = Math.min(width / graph.width, height / graph.height, 1.25);
  Object.assign(eyeOfGraph, { scale, x: (graph.width - width / scale) / 2, y: (graph.height - height / scale) / 2 });
  lookAtGraph();
}

function showTab(name) {
  document.body.classList.toggle('graphing', name === 'graph');
  for (const tab of ['picture', 'graph']) by(`tab-${tab}`).setAttribute('aria-selected', String(tab === name));
  if (name === 'graph') {
    play(false);
    fitGraph();
  }
}

function showGraph() {
  if (!graph) return;
  by('tabs').hidden = false;
  by('said').replaceChildren(...graph.facts.map((fact) => tableLine(fact)));
  by('families').replaceChildren(...graph.families.map((textContent, i) => make('li', { className: `family${i % 6}`, textContent })));
  drawGraph();
  by('tab-picture').addEventListener('click', () => showTab('picture'));
  by('tab-graph').addEventListener('click', () => showTab('graph'));
  const svg = by('graph');
  svg.addEventListener('wheel', (e) => {
    e.preventDefault();
    const scale = Math.min(Math.max(eyeOfGraph.scale * Math.exp(-e.deltaY / 500), 0.1), 5);
    eyeOfGraph.x += e.offsetX * (1 / eyeOfGraph.scale - 1 / scale);
    eyeOfGraph.y += e.offsetY * (1 / eyeOfGraph.scale - 1 / scale);
    eyeOfGraph.scale = scale;
    lookAtGraph();
  }, { passive: false });
  svg.addEventListener('pointermove', (e) => {
    if (!(e.buttons & 1)) return;
    eyeOfGraph.x -= e.movementX / eyeOfGraph.scale;
    eyeOfGraph.y -= e.movementY / eyeOfGraph.scale;
    lookAtGraph();
  });
}
