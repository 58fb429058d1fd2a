// Choosing a body.
function choose(body) {
  state.body = body;
  by('body').value = body;
  const marked = new Map();
  for (const mesh of clickable) {
    mesh.userData.plain ??= mesh.material;
    const on = bodyOf(mesh) === body;
    if (on && !marked.has(mesh.userData.plain)) {
      const lit = mesh.userData.plain.clone();
      lit.emissive = new Color(0x6b5200);
      marked.set(mesh.userData.plain, lit);
    }
    mesh.material = on ? marked.get(mesh.userData.plain) : mesh.userData.plain;
  }
  listValues();
  const own = columnsOf(body);
  if (own.length && !own.some((c) => state.chosen.includes(c.name))) chooseColumns([own[0].name]);
  redraw();
}

const columnsOf = (body) => columns.filter((c) => !body || c.bodies.includes(body));

function hitAt(x, y) {
  const ray = new Raycaster();
  ray.setFromCamera(new Vector2((x / picture.clientWidth) * 2 - 1, 1 - (y / picture.clientHeight) * 2), camera);
  const [hit] = ray.intersectObjects(clickable, false);
  return hit;
}

let pressed;
renderer.domElement.addEventListener('pointerdown', (e) => { pressed = [e.offsetX, e.offsetY]; });
renderer.domElement.addEventListener('pointerup', (e) => {
  if (!pressed || Math.hypot(e.offsetX - pressed[0], e.offsetY - pressed[1]) >= 4) return;
  const hit = hitAt(e.offsetX, e.offsetY);
  if (by('measuring').checked) takePoint(hit);
  else choose(hit ? bodyOf(hit.object) : '');
});
