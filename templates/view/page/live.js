// A host that runs elsewhere: poses of bodies arrive as events.
let received = 0;

/** Applies the positions of bodies' centres of mass and their attitudes w, x, y, z to a drawn mechanism. */
function stand(figure, poses) {
  about.bodies.forEach((name, i) => {
    const [x, y, z, a, b, c, d] = poses[i], node = figure.nodes.get(name);
    node.position.set(x, y, z);
    node.quaternion.set(b, c, d, a);
    const centre = sliders?.bodies.find((body) => body.name === name)?.centre ?? [0, 0, 0];
    const back = new Matrix4().makeTranslation(...centre.map((value) => -value));
    figure.frames.set(name, new Matrix4().compose(node.position, node.quaternion, new Vector3(1, 1, 1)).multiply(back));
  });
  for (const other of sliders?.others ?? []) placeOther(other, figure);
}

/** Shows a pose at a time. */
function follow(time, ...poses) {
  received++;
  const before = state.follow && nodes.get(state.follow)?.getWorldPosition(new Vector3());
  stand(shown, poses);
  state.time = time;
  by('clock').textContent = `${time.toFixed(2)} s`;
  model.updateMatrixWorld();
  if (before) keepInMiddle(before);
  redraw();
}

function showLive() {
  if (!about.live) return;
  document.body.classList.add('bare');
  by('clock').textContent = 'waiting for a host';
  const events = new EventSource('poses');
  events.onmessage = (event) => follow(...JSON.parse(event.data));
}
