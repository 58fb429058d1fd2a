// Views: from the sides, transparent, with traces of points and the distance of two.
const SIDES = { front: [1, 0, 0], side: [0, -1, 0], top: [0, 0, 1] };

/** Looks along an axis of the model, or as at the start. */
function lookFrom(side) { home(SIDES[side]); }

function seeThrough(on) {
  const materials = new Set(clickable.flatMap((mesh) => [mesh.material, mesh.userData.plain].filter(Boolean)));
  for (const material of materials) {
    Object.assign(material, { transparent: on, opacity: on ? 0.35 : 1, depthWrite: !on });
    material.needsUpdate = true;
  }
  redraw();
}

const traces = new Map();  // lines by the names of bodies

/** Shows or hides the path of a body's centre of mass through the run. */
function traceBody(body) {
  const drawn = traces.get(body);
  if (drawn) {
    scene.remove(drawn);
    traces.delete(body);
  } else if (action && nodes.has(body)) {
    const line = lineThrough(pathOf(body), new Color(colourOf(`--loop${traces.size % 6}`)));
    traces.set(body, line);
    scene.add(line);
  }
  redraw();
}

/** The positions of a body's centre of mass at its key times, in the scene's axes. */
function pathOf(body) {
  const node = nodes.get(body), track = action.getClip().tracks.find((each) => each.name === `${node.uuid}.position` || each.name === `${node.name}.position`);
  if (!track) return [node.getWorldPosition(new Vector3())];
  const { values } = track;
  return Array.from({ length: values.length / 3 }, (_, i) => node.parent.localToWorld(new Vector3(values[3 * i], values[3 * i + 1], values[3 * i + 2])));
}

function lineThrough(places, color) {
  const ends = places.slice(1).flatMap((place, i) => [...places[i].toArray(), ...place.toArray()]), geometry = new BufferGeometry();
  geometry.setAttribute('position', new Float32BufferAttribute(ends, 3));
  const line = new LineSegments(geometry, new LineBasicMaterial({ color, depthTest: false, transparent: true }));
  line.renderOrder = 3;
  line.frustumCulled = false;
  return line;
}

const measure = { ends: [], line: undefined };

/** Selects a point on a body; the distance of two is shown and updated. */
function takePoint(hit) {
  if (measure.ends.length === 2) measure.ends = [];
  if (hit) measure.ends.push({ object: hit.object, at: hit.object.worldToLocal(hit.point.clone()) });
  showMeasure();
}

function showMeasure() {
  if (measure.line) scene.remove(measure.line);
  const places = measure.ends.map(({ object, at }) => object.localToWorld(at.clone()));
  by('measured').hidden = !by('measuring').checked;
  by('measured').textContent = ['Click a point of a body', 'Click the other point'][places.length] ?? `${+places[0].distanceTo(places[1]).toPrecision(5)} m`;
  measure.line = places.length === 2 ? lineThrough(places, new Color(colourOf('--alarm'))) : undefined;
  if (measure.line) scene.add(measure.line);
  redraw();
}

by('look').addEventListener('change', (e) => lookFrom(e.target.value));
by('through').addEventListener('change', (e) => seeThrough(e.target.checked));
by('trace').addEventListener('click', () => traceBody(state.body));
by('measuring').addEventListener('change', (e) => { if (!e.target.checked) measure.ends = []; showMeasure(); });
