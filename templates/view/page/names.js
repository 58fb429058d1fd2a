// Names of bodies in the picture.
function place(node, ahead = 0) {
  const at = node.localToWorld(new Vector3(0, 0, ahead)).project(camera);
  return [((at.x + 1) / 2) * picture.clientWidth, ((1 - at.y) / 2) * picture.clientHeight, at.z];
}

/** An arrow with its name and size. */
function named(node) {
  return { text: `${node.userData.arrow} ${+(node.scale.x * node.userData.newton).toPrecision(3)} N`, node, kind: 'force' };
}

/** Named objects in the picture: text, node and kind, the most important first. */
function nameable() {
  const shown = by('names').checked ? [...nodes.keys()] : state.body ? [state.body] : [];
  const marked = marks.slice(0, 1).map((node) => ({ text: failure.row, node, kind: 'failed' }));
  const bodies = shown.map((name) => ({ text: name, node: nodes.get(name), kind: name === state.body ? 'chosen' : '' }));
  const forces = by('names').checked ? arrows.filter((arrow) => arrow.visible).map(named) : [];
  const placed = [...marked, ...bodies, ...forces].map((each) => ({ ...each, at: place(each.node, each.node.userData.length) })).filter(({ at }) => at[2] < 1);
  const rank = ({ kind }) => ['failed', 'chosen', '', 'force'].indexOf(kind);
  return placed.sort((a, b) => rank(a) - rank(b) || a.at[2] - b.at[2]);
}

/** Places the names, except those that would overlap an earlier one. */
function label() {
  const taken = [], labels = by('labels');
  labels.replaceChildren();
  for (const { text, kind, at: [x, y] } of nameable()) {
    const span = labels.appendChild(make('span', { textContent: text, className: kind }));
    const left = Math.round(x + 10), top = Math.round(y - 26), box = [left, top, left + span.offsetWidth, top + span.offsetHeight];
    if (taken.some((b) => box[0] < b[2] + 2 && b[0] < box[2] + 2 && box[1] < b[3] + 2 && b[1] < box[3] + 2)) { span.remove(); continue; }
    taken.push(box);
    span.style.transform = `translate(${left}px, ${top}px)`;
  }
}
