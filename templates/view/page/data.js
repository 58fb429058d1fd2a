// Data of the page: facts, the run's table, and the selection.
const { AmbientLight, AnimationMixer, Box3, BufferGeometry, Color, DirectionalLight, Float32BufferAttribute, Fog, GLTFLoader, HemisphereLight,
  LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshBasicMaterial, MeshLambertMaterial, OrbitControls, PerspectiveCamera, Plot, Quaternion, Raycaster,
  Scene, Vector2, Vector3, Vector4, WebGLRenderer,
} = Libraries;
const bytes = (id) => decoded(textOf(id));
const remainders = Uint32Array.from({ length: 256 }, (_, byte) => {
  for (let bit = 0; bit < 8; bit++) byte = (byte >>> 1) ^ (byte & 1 && 0xedb88320);
  return byte;
});
const about = JSON.parse(textOf('about'));
const numbers = new Float32Array(bytes('table'));
let t = numbers.subarray(0, about.rows);
const columns = about.columns.map((c, i) => measured({ ...c, values: numbers.subarray((i + 1) * about.rows, (i + 2) * about.rows) }));
const { outlook } = about;
let [first, last] = about.motions.length ? [0, about.period] : [t[0], t[t.length - 1]];
const state = { time: first, playing: false, body: '', chosen: columns.slice(0, 1).map((c) => c.name), over: '', follow: outlook.follow };

/** The text of an element, verified by its CRC-32 (ISO/IEC 13239). */
function textOf(id) {
  const element = by(id), text = element?.textContent ?? '';
  let crc = -1;
  for (let i = 0; i < text.length; i++) crc = (crc >>> 8) ^ remainders[(crc ^ text.charCodeAt(i)) & 255];
  if (!element || ~crc >>> 0 !== Number(element.dataset.crc)) throw new Error(`its file is damaged, in '${id}'`);
  return text;
}

/** A column with the decimals of five digits of its largest value. */
function measured(column) {
  const largest = column.values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
  return { ...column, decimals: largest > 0 ? Math.min(Math.max(4 - Math.floor(Math.log10(largest)), 0), 9) : 0 };
}
