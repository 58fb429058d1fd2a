// An earlier run under this one: its mechanism as a translucent ghost, its columns beside those of this run.
const { over } = about;
const ghost = { scene: undefined, mixer: undefined, action: undefined, t: undefined, columns: new Map() };

if (over) {
  const values = new Float32Array(bytes('over-table')), rows = over.rows;
  ghost.t = values.subarray(0, rows);
  over.columns.forEach((name, i) => ghost.columns.set(name, values.subarray((i + 1) * rows, (i + 2) * rows)));
}

const hidden = (object) => object.userData.road || object.userData.mark !== undefined;

function loadGhost(gltf, name) {
  ghost.scene = gltf.scene;
  ghost.material = new MeshLambertMaterial({ transparent: true, opacity: 0.38, depthWrite: false });
  gltf.scene.traverse((object) => {
    if (hidden(object)) object.visible = false;
    if (object.isMesh) object.material = ghost.material;
  });
  scene.add(gltf.scene);
  if (gltf.animations.length) [ghost.mixer, ghost.action] = animated(gltf.scene, gltf.animations[0]);
  by('over').hidden = by('ghostly').hidden = false;
  by('over').textContent = `over ${name}`;
  by('ghost').addEventListener('change', (e) => { ghost.scene.visible = e.target.checked; redraw(); });
  dress();
  moveGhost();
}

/** Moves the ghost to the present time, or to the end of its own run. */
function moveGhost() {
  if (!ghost.action) return;
  ghost.action.time = Math.min(Math.max(state.time, ghost.t[0]), ghost.t[ghost.t.length - 1]);
  ghost.mixer.update(0);
}

/** The ghost's value of a column at the present time, or undefined. */
function ghostValue(name) {
  const values = ghost.columns.get(name);
  return values && values[rowOf(ghost.t)];
}
