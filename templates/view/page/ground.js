// The ground of a drive: the road, for the core and drawn.
const FINE = { cell: 0.25, half: 72, below: 0 }, COARSE = { cell: 5, half: 48, below: 0.04 }, AWAY = 5;  // m, cells to each side, m, m between new drawings
const WAVES = 32, TERMS = 8, FEWEST = 4;  // as in run/road_field.py
const ground = { parts: [], at: undefined, posts: undefined };

/** Cosine and sine of an angle in turns, by sums and products alone: identical bits on all machines. */
function circle(turns) {
  const quarter = Math.floor(4 * turns + 0.5), r = (turns - quarter / 4) * (2 * Math.PI);
  let cosine = 1, sine = 1;
  for (let k = TERMS - 1; k >= 0; k--) {
    cosine = 1 - ((r * r) / ((2 * k + 1) * (2 * k + 2))) * cosine;
    sine = 1 - ((r * r) / ((2 * k + 2) * (2 * k + 3))) * sine;
  }
  sine *= r;
  return [[cosine, sine], [-sine, cosine], [-cosine, -sine], [sine, -cosine]][((quarter % 4) + 4) % 4];
}

/** The first numbers of SplitMix64 for a seed, from 0 to 1. */
function uniform(seed, count) {
  const word = (x) => BigInt.asUintN(64, x);
  return Float64Array.from({ length: count }, (_, i) => {
    let z = word(BigInt(seed) + BigInt(i + 1) * 0x9e3779b97f4a7c15n);
    z = word((z ^ (z >> 30n)) * 0xbf58476d1ce4e5b9n);
    z = word((z ^ (z >> 27n)) * 0x94d049bb133111ebn);
    return Number((z ^ (z >> 31n)) >> 11n) * 2 ** -53;
  });
}

/** The real parts of sums over k of c_k e^(2 pi i k j / n), from numbers at every `stride`-th place. */
function summed(real, imaginary, at, stride, turns) {
  const n = real.length / stride;
  if (n === 1) return [Float64Array.of(real[at]), Float64Array.of(imaginary[at])];
  const [a, b] = summed(real, imaginary, at, 2 * stride, turns), [c, d] = summed(real, imaginary, at + stride, 2 * stride, turns);
  const [x, y] = [new Float64Array(n), new Float64Array(n)];
  for (let i = 0; i < n / 2; i++) {
    const [cosine, sine] = turns[i * stride], u = c[i] * cosine - d[i] * sine, v = c[i] * sine + d[i] * cosine;
    [x[i], y[i], x[i + n / 2], y[i + n / 2]] = [a[i] + u, b[i] + v, a[i] - u, b[i] - v];
  }
  return [x, y];
}

/** Heights on a grid, bit by bit those of rough_field in run/road_field.py. */
function roughField({ roughness, width, band, step, length, level }, seed) {
  const finest = 1 / (FEWEST * step), half = Math.ceil(width / 2 / step), across = 2 * half + 1, heights = new Float64Array(length * across);
  const cycles = Array.from({ length: length / 2 - 1 }, (_, i) => (i + 1) / (length * step)).filter((n) => n >= band[0] && n <= band[1]);
  const random = uniform(seed, 2 * cycles.length * WAVES), first = Math.round(cycles[0] * length * step);
  const size = cycles.map((n) => Math.sqrt((((2 * roughness * (0.1 / n)) * (0.1 / n)) / (length * step)) / WAVES));
  const waves = cycles.map((n, i) => Array.from({ length: WAVES }, (_, wave) => {
    const sine = Math.sqrt(1 - (n / finest) * (n / finest)) * ((2 * (wave + random[i * WAVES + wave])) / WAVES - 1);
    return (n * sine) / Math.sqrt(1 - sine * sine);
  }));
  const turns = Array.from({ length: length / 2 }, (_, i) => circle(i / length));
  for (let row = 0; row < across; row++) {
    const y = (row - half) * step, real = new Float64Array(length), imaginary = new Float64Array(length);
    for (let wave = 0; wave < WAVES; wave++) cycles.forEach((_, i) => {
      const [cosine, sine] = circle(y * waves[i][wave] + random[(cycles.length + i) * WAVES + wave]);
      real[first + i] += size[i] * cosine;
      imaginary[first + i] += size[i] * sine;
    });
    const [sums] = summed(real, imaginary, 0, 1, turns);
    for (let i = 0; i < length; i++) {
      const x = Math.min(i, length - i) * step, share = level ? Math.min(Math.max((x * x + y * y - level * level) / (15 * level * level), 0), 1) : 1;
      heights[i * across + row] = level ? sums[i] * (share * share * (3 - 2 * share)) : sums[i];
    }
  }
  return { start: [0, -half * step], step: [step, step], counts: [length, across], wraps: true, heights };
}

/** A road of the page, or the scene's own if unnamed: the data for the core, and for drawing. */
function makeRoad(name, seed) {
  const { lines, ...waves } = drive.roads[name] ?? {}, own = lines ? { patches: [] } : drive.ground;
  const sides = lines ? [lines, lines].map((side) => side.map(([x, z, slope]) => ['line', x, z, slope, 0])) : [own.left, own.right];
  const spec = lines ? waves : own.waves;
  return { name, seed, lines, sides, patches: own.patches, field: spec?.roughness ? roughField(spec, lines ? seed : own.seed) : own.field ?? undefined };
}

/** Sets the core's road for all simulations. */
function layRoad(core, { lines, field }) {
  if (!lines) return;
  const numbers = [...lines.flat(), ...(field ? [...field.start, ...field.step] : [0, 0, 0, 0])], heights = field?.heights ?? [];
  const at = core.take(8 * (numbers.length + heights.length)), above = at + 8 * numbers.length;
  core.doubles(at, numbers.length).set(numbers);
  core.doubles(above, heights.length).set(heights);
  core.call('set_road', at, lines.length, above - 32, above, ...(field?.counts ?? [0, 0]));
}

function profile(road, x, y) {
  const side = road.sides[y > 0 ? 0 : 1], [kind, start, a, b, c] = side[Math.max(0, side.findLastIndex((piece) => piece[1] <= x))];
  return kind === 'cosine' ? a + b * (1 - Math.cos(c * (x - start))) : a + b * (x - start);
}

/** The height of a surface: cubics with central differences as slopes, level beyond edges. */
function surfaceAt({ start, step, counts, wraps, heights }, x, y) {
  const [[i, a], [j, b]] = [x, y].map((place, axis) => {
    const u = (place - start[axis]) / step[axis], inside = wraps && axis === 0 ? u : Math.min(Math.max(u, 0), counts[axis] - 1), k = Math.floor(inside), s = inside - k;
    return [k, [(-s * (1 - s) ** 2) / 2, 1 + s * s * (1.5 * s - 2.5), (s * (1 + s * (4 - 3 * s))) / 2, (s * s * (s - 1)) / 2]];
  });
  let sum = 0;
  for (let p = 0; p < 4; p++) {
    const row = wraps ? (((i + p - 1) % counts[0]) + counts[0]) % counts[0] : Math.min(Math.max(i + p - 1, 0), counts[0] - 1);
    for (let q = 0; q < 4; q++) sum += a[p] * b[q] * heights[row * counts[1] + Math.min(Math.max(j + q - 1, 0), counts[1] - 1)];
  }
  return sum;
}

/** Grass in squares of 10 m with a line at each metre of height, and a road with lines; colours depend on the position in the model's axes. */
const GROUND = `#include <color_fragment>
{ vec2 p = vPlace.xy, w = max(fwidth(p), 1e-4);
  float h = vPlace.z, dh = fwidth(h) + 1e-4, check = mod(floor(p.x / 10.0) + floor(p.y / 10.0), 2.0);
  vec3 c = mix(vec3(0.36, 0.47, 0.25), vec3(0.42, 0.53, 0.29), check);
  c = mix(c, vec3(0.22, 0.30, 0.15), 0.5 * clamp(1.5 - abs(fract(h + 0.5) - 0.5) / dh, 0.0, 1.0) * step(dh, 0.3));
  vec3 road = vec3(0.27, 0.28, 0.30) + 0.025 * mod(floor(p.x), 2.0);
  road = mix(road, vec3(0.62, 0.47, 0.20), clamp(40.0 * vRaised, 0.0, 0.85));
  float edge = clamp((0.06 - abs(abs(p.y) - 3.2)) / w.y + 0.5, 0.0, 1.0) * min(1.0, 0.12 / w.y);
  float dash = clamp((0.06 - abs(p.y)) / w.y + 0.5, 0.0, 1.0) * min(1.0, 0.12 / w.y) * step(mod(p.x, 12.0), 6.0);
  road = mix(road, vec3(0.9), max(edge, dash));
  c = mix(c, road, clamp((3.5 - abs(p.y)) / w.y + 0.5, 0.0, 1.0));
  for (int i = 0; i < PATCHES; i++) if (p.x > patches[i].x && p.x < patches[i].y && p.y > patches[i].z && p.y < patches[i].w) c = mix(c, vec3(0.55, 0.75, 0.9), 0.6);
  diffuseColor.rgb = c * light; }`;

/** The ground as grids about a point, a fine one within a coarse one. */
function drawGround(road) {
  clearGround();
  Object.assign(ground, { road, at: undefined });
  const patches = [...road.patches.map((patch) => new Vector4(...patch.slice(0, 4))), new Vector4()];
  ground.light = { value: 0.72 };
  const material = new MeshLambertMaterial({ color: 0xffffff });
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, { patches: { value: patches }, light: ground.light });
    const passed = 'varying vec3 vPlace; varying float vRaised;\n';
    shader.vertexShader = `attribute float raised; ${passed}${shader.vertexShader.replace('#include <begin_vertex>', '#include <begin_vertex>\nvPlace = position; vRaised = raised;')}`;
    shader.fragmentShader = `#define PATCHES ${patches.length}\nuniform vec4 patches[PATCHES]; uniform float light; ${passed}${shader.fragmentShader.replace('#include <color_fragment>', GROUND)}`;
  };
  for (const grid of [FINE, COARSE]) {
    const n = 2 * grid.half + 1, geometry = new BufferGeometry(), faces = [];
    for (const [name, size] of [['position', 3], ['normal', 3], ['raised', 1]]) geometry.setAttribute(name, new Float32BufferAttribute(new Float32Array(size * n * n), size));
    for (let i = 0; i < n - 1; i++) for (let k = 0; k < n - 1; k++) { const at = i * n + k; faces.push(at, at + n, at + n + 1, at, at + n + 1, at + 1); }
    geometry.setIndex(faces);
    addPart(geometry, material).userData = grid;
  }
  ground.posts = addPart(new BufferGeometry(), new MeshLambertMaterial({ color: 0xf4f4f0, side: 2 }));
}

function addPart(geometry, material) {
  const part = new Mesh(geometry, material);
  part.frustumCulled = false;
  part.receiveShadow = true;
  model.children[0].add(part);
  ground.parts.push(part);
  return part;
}

function clearGround() {
  for (const part of ground.parts) { part.removeFromParent(); part.geometry.dispose(); }
  ground.parts = [];
}

/** Moves the grids to a point in the model's axes, by whole cells of the coarse one. */
function moveGround(x, y) {
  const at = [x, y].map((place) => AWAY * Math.round(place / AWAY));
  if (!ground.road || (ground.at && at[0] === ground.at[0] && at[1] === ground.at[1])) return;
  ground.at = at;
  for (const part of ground.parts.slice(0, 2)) shapeGrid(part.geometry, part.userData, at);
  const posts = [];
  for (let i = Math.ceil((at[0] - 200) / 25); i <= (at[0] + 200) / 25; i++) for (const side of [-4, 4]) {
    const z = heightAt(25 * i, side);
    for (const [dx, dy] of [[0.06, 0], [0, 0.06]]) posts.push(25 * i - dx, side - dy, z, 25 * i + dx, side + dy, z, 25 * i + dx, side + dy, z + 0.9, 25 * i - dx, side - dy, z, 25 * i + dx, side + dy, z + 0.9, 25 * i - dx, side - dy, z + 0.9);
  }
  ground.posts.geometry.setAttribute('position', new Float32BufferAttribute(posts, 3));
  ground.posts.geometry.computeVertexNormals();
}

const heightAt = (x, y) => profile(ground.road, x, y) + (ground.road.field ? surfaceAt(ground.road.field, x, y) : 0);

function shapeGrid(geometry, { cell, half, below }, [x0, y0]) {
  const n = 2 * half + 1, { position, normal, raised } = geometry.attributes, { road } = ground, inner = FINE.cell * FINE.half - COARSE.cell;
  const heights = new Float32Array(n * n);
  for (let i = 0; i < n; i++) for (let k = 0; k < n; k++) {
    const x = x0 + cell * (i - half), y = y0 + cell * (k - half), at = i * n + k, hidden = below && Math.max(Math.abs(x - x0), Math.abs(y - y0)) <= inner;
    raised.array[at] = road.lines ? profile(road, x, y) : 0;
    heights[at] = (road.lines ? raised.array[at] : profile(road, x, y)) + (road.field ? surfaceAt(road.field, x, y) : 0);
    position.array.set([x, y, heights[at] - below - (hidden ? 1 : 0)], 3 * at);
  }
  for (let i = 0; i < n; i++) for (let k = 0; k < n; k++) {
    const [left, right, back, ahead] = [Math.max(k - 1, 0), Math.min(k + 1, n - 1), Math.max(i - 1, 0), Math.min(i + 1, n - 1)];
    const dx = (heights[ahead * n + k] - heights[back * n + k]) / (cell * (ahead - back)), dy = (heights[i * n + right] - heights[i * n + left]) / (cell * (right - left)), size = Math.hypot(dx, dy, 1);
    normal.array.set([-dx / size, -dy / size, 1 / size], 3 * (i * n + k));
  }
  for (const each of [position, normal, raised]) each.needsUpdate = true;
}
