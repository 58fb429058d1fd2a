// The picture: the scene of the .glb file, light, ground and camera.
const picture = by('picture');
const renderer = new WebGLRenderer({ antialias: true });
picture.prepend(renderer.domElement);
const scene = new Scene();
const camera = new PerspectiveCamera(35, 1, outlook.extent / 100, outlook.extent * 200);
const orbit = new OrbitControls(camera, renderer.domElement);
orbit.addEventListener('change', redraw);
scene.add(new HemisphereLight(0xffffff, 0x8a8f99, 1.7), new AmbientLight(0xffffff, 0.35));
const sun = new DirectionalLight(0xffffff, 1.9);
scene.add(sun);
const nodes = new Map();  // of bodies, by name
const marks = [];  // marks around failed elements
const elements = new Map();  // nodes of springs, rods and wheels, by name
const arrows = [];  // of forces and reactions
const clickable = [], tarmac = new Map();  // of the road's materials the colours by day
let model, clips, mixer, action, grid, cell = 1, due = false;

function load(gltf) {
  model = gltf.scene;
  scene.add(model);
  const materials = new Map();
  model.traverse((object) => {
    if (object.userData.body !== undefined) nodes.set(object.userData.body, object);
    if (object.userData.element !== undefined) elements.set(object.userData.element, object);
    if (!object.isMesh) return;
    if (object.userData.mark !== undefined) return dressOver(object, marks, MeshBasicMaterial, 0.45, 1);
    if (object.userData.arrow !== undefined) return dressOver(object, arrows, MeshLambertMaterial, 0.85, 2);
    if (!materials.has(object.material)) materials.set(object.material, new MeshLambertMaterial({ color: object.material.color, fog: isRoad(object) }));
    if (isRoad(object)) tarmac.set(materials.get(object.material), object.material.color.clone());
    object.material = materials.get(object.material);  // cheaper than the glTF materials in software rendering
    if (bodyOf(object) !== undefined) clickable.push(object);
  });
  clips = gltf.animations;
  if (clips.length) [mixer, action] = animated(model, clips[0]);
  by('forceful').hidden = !arrows.length;
  showArrows(false);
  setTime(first);
  new ResizeObserver(resize).observe(picture);
  resize();
  home();
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', dress);
  dress();
}

function animated(object, clip) {
  const own = new AnimationMixer(object);
  return [own, own.clipAction(clip).play()];
}

/** Arrows and marks are visible through bodies. */
function dressOver(object, list, Material, opacity, renderOrder) {
  list.push(object);
  Object.assign(object, { renderOrder, material: new Material({ color: object.material.color, transparent: true, opacity, depthTest: false }) });
}

function showArrows(on) {
  for (const arrow of arrows) arrow.visible = on;
  redraw();
}

/** What an object, or else the nearest that holds it, says of itself. */
function inherited(object, key) {
  for (let at = object; at; at = at.parent) if (at.userData[key] !== undefined) return at.userData[key];
  return undefined;
}

/** The name of the body of an object. */
const bodyOf = (object) => inherited(object, 'body');
const isRoad = (object) => Boolean(inherited(object, 'road'));

/** A vector of the model's axes in those of the scene. */
const turned = (vector) => new Vector3(...vector).applyQuaternion(model.children[0].quaternion);

/** Frames the whole mechanism, at all times if no body is followed. */
function home(direction = outlook.direction) {
  const box = new Box3(), { time } = state;
  for (const at of state.follow || !action ? [time] : Array.from({ length: 17 }, (_, i) => first + ((last - first) * i) / 16)) {
    setTime(at);
    model.traverse((o) => { if (o.isMesh && !isRoad(o) && o.userData.arrow === undefined) box.expandByObject(o); });
  }
  setTime(time);
  const centre = box.getCenter(new Vector3()), half = box.getSize(new Vector3()).multiplyScalar(0.5);
  const back = turned(direction).normalize(), level = Math.abs(back.y) < 0.999 ? new Vector3(0, 1, 0) : turned([1, 0, 0]), right = level.cross(back).normalize(), up = back.clone().cross(right);
  const slope = Math.tan((camera.fov * Math.PI) / 360);
  let distance = outlook.extent / 2;
  for (let k = 0; k < 8; k++) {  // all corners are visible
    const corner = half.clone().multiply(new Vector3(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1));
    const across = Math.max(Math.abs(corner.dot(up)), Math.abs(corner.dot(right)) / camera.aspect) / slope;
    distance = Math.max(distance, corner.dot(back) + 1.12 * across);
  }
  camera.position.copy(centre).addScaledVector(back, distance);
  orbit.target.copy(centre);
  orbit.update();
  redraw();
}

function dress() {
  const style = getComputedStyle(document.documentElement);
  scene.background = new Color(style.getPropertyValue('--sky'));
  scene.fog = new Fog(scene.background, 1, 2);
  ghost.material?.color.set(style.getPropertyValue('--ghost'));
  const night = matchMedia('(prefers-color-scheme: dark)').matches;
  if (about.drive?.ground) { scene.background.set(style.getPropertyValue('--air')); scene.fog.color.copy(scene.background); if (ground.light) ground.light.value = night ? 0.3 : 0.72; }
  for (const [material, colour] of tarmac) material.color.copy(colour).multiplyScalar(night ? 0.3 : 1);
  if (grid) scene.remove(grid);
  grid = undefined;
  if (!outlook.road && !about.drive?.ground) {
    const about10 = 10 ** Math.floor(Math.log10(outlook.extent / 4)), share = outlook.extent / 4 / about10;
    cell = about10 * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
    grid = floor(new Color(style.getPropertyValue('--floor')));
    scene.add(grid);
  }
  by('scale').textContent = about.drive?.ground ? 'squares: 10 m, lines: 1 m of height' : outlook.road ? 'strips of the road: 1 m' : `grid: ${+cell.toPrecision(3)} m`;
  if (plot) drawPlot();
  redraw();
}

/** Lines a cell apart, in pieces of a cell. */
function floor(color) {
  const ends = [], half = 20;
  for (let i = -half; i <= half; i++)
    for (let k = -half; k < half; k++) ends.push(i, 0, k, i, 0, k + 1, k, 0, i, k + 1, 0, i);
  const lines = new BufferGeometry();
  lines.setAttribute('position', new Float32BufferAttribute(ends.map((end) => end * cell), 3));
  return new LineSegments(lines, new LineBasicMaterial({ color }));
}

function resize() {
  const { clientWidth: width, clientHeight: height } = picture;
  if (!width || !height) return;
  renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  renderer.setSize(width, height);
  camera.aspect = width / height;
  camera.updateProjectionMatrix();
  if (document.body.classList.contains('graphing')) lookAtGraph();
  if (plot) {
    plot.setSize(plotSize());
    cursor();
  }
  redraw();
}

function redraw() {
  if (due) return;
  due = true;
  requestAnimationFrame(() => { due = false; render(); });
}

function render() {
  if (!about.drive?.ground) sun.position.copy(camera.position).add(new Vector3(0, outlook.extent, 0));
  if (grid) grid.position.set(cell * Math.round(orbit.target.x / cell), outlook.floor, cell * Math.round(orbit.target.z / cell));
  const far = camera.position.distanceTo(orbit.target);
  [scene.fog.near, scene.fog.far] = about.drive?.ground ? [60, 235] : outlook.road ? [4 * far, 14 * far] : [far, 2.2 * far + 4 * cell];
  renderer.render(scene, camera);
  label();
}
