// A generated simulator in WebAssembly: the C interface of its export, called from JavaScript.  All values are in SI units.
const KINDS = ['parameter', 'input', 'coordinate', 'speed', 'equation', 'start_coordinate', 'start_speed', 'output', 'pose'];
const NUMBERS_OF_POSE = 16, PAGE = 65536, TEXT = 1000;

/** A rejected call, or a motion that cannot continue: the core's message, its `status`, and the `time` of the simulation, s. */
class SimulationError extends Error {
  constructor(message, status, time) {
    super(message);
    Object.assign(this, { name: 'SimulationError', status, time });
  }
}

/** A compiled model: facts about it, names and units of its numbers, and the memory of its simulations. */
class Model {
  #blocks = [];
  #room = { at: 0, bytes: 0 };
  #tables = {};

  constructor(module, instance) {
    const [section] = WebAssembly.Module.customSections(module, 'cutjoint');
    if (!section) throw new Error('the module is none that cutjoint has compiled');
    this.facts = Object.freeze(JSON.parse(new TextDecoder().decode(section)));
    this.exports = instance.exports;
    this.exports._initialize();
    for (const kind of KINDS) this.#tables[kind] = this[`${kind.replace(/_(.)/, (_, letter) => letter.toUpperCase())}s`] = this.#table(kind);
  }

  /** Whether the core has a function of the C interface, by its name without the prefix. */
  has(name) { return `${this.facts.name}_${name}` in this.exports; }

  /** Calls a function of the C interface. */
  call(name, ...values) {
    const found = this.exports[`${this.facts.name}_${name}`];
    if (!found) throw new Error(`the model '${this.facts.name}' has no function '${name}'`);
    return found(...values);
  }

  /** A simulation with the settings, parameters and start of the scene; `free` gives its memory back. */
  create() {
    const at = this.#blocks.pop() ?? this.take(this.facts.size), sim = this.call('create', at, this.facts.size);
    if (!sim) throw new Error('the simulation does not fit the memory that the module says');
    return new Simulation(this, sim, () => this.#blocks.push(at));
  }

  /** The index of a name of a kind such as 'input'; a number is returned as it is. */
  find(kind, name) {
    const known = this.#tables[kind], index = typeof name === 'number' ? name : known.findIndex((each) => each.name === name);
    if (index >= 0) return index;
    throw new Error(`the model '${this.facts.name}' has no ${kind.replace('_', ' ')} '${name}'; it has ${known.map((each) => each.name).join(', ') || 'none'}`);
  }

  /** A view of doubles in the module's memory; creating a simulation may invalidate it. */
  doubles(at, length) { return new Float64Array(this.exports.memory.buffer, at, length); }

  bytes(at, length) { return new Uint8Array(this.exports.memory.buffer, at, length); }

  /** The zero-terminated text at an address; '' for a null pointer. */
  text(at) {
    if (!at) return '';
    const all = new Uint8Array(this.exports.memory.buffer, at);
    return new TextDecoder().decode(all.subarray(0, all.indexOf(0)));
  }

  /** Scratch memory for one call. */
  room(bytes) {
    if (this.#room.bytes < bytes) this.#room = { at: this.take(2 * bytes), bytes: 2 * bytes };
    return this.#room.at;
  }

  /** The address of new memory, which begins a page and is permanent. */
  take(bytes) { return this.exports.memory.grow(Math.ceil(bytes / PAGE)) * PAGE; }

  #table(kind) {
    const entries = [];
    if (!this.has(`${kind}_name`)) return entries;
    for (let i = 0, at; (at = this.call(`${kind}_name`, i)); i++) entries.push({ name: this.text(at), unit: this.has(`${kind}_unit`) ? this.text(this.call(`${kind}_unit`, i)) : '' });
    return entries;
  }
}

/** One simulation.  Names may be used wherever the C interface has an index. */
class Simulation {
  #model;
  #sim;
  #release;

  constructor(model, sim, release) { [this.#model, this.#sim, this.#release] = [model, sim, release]; }

  /** Frees the memory; no call may follow. */
  free() {
    this.#release();
    this.#sim = 0;
  }

  /** Finds a consistent state at time 0. */
  start() { this.#do('start'); }
  /** One step. */
  step() { this.#do('step'); }
  /** Steps up to a time, s. */
  advance(time) { this.#do('advance', time); }

  /** Takes steps; returns the outputs at the end of each, row by row. */
  run(steps) {
    const count = steps * this.#model.outputs.length, at = this.#model.room(8 * count);
    this.#do('run', steps, at);
    return this.#model.doubles(at, count).slice();
  }

  setStep(dt) { this.#do('set_step', dt); }
  setIterations(number) { this.#do('set_iterations', number); }
  setTolerance(relative, absolute = relative) { this.#do('set_tolerance', relative, absolute); }
  /** Sets whether a start is an equilibrium. */
  setEquilibrium(wanted) { this.#do('set_equilibrium', Number(wanted)); }
  setParameter(name, value) { this.#do('set_parameter', this.#model.find('parameter', name), value); }
  /** Sets an input's value, and the derivatives by which it continues until set again. */
  setInput(name, value, rate = 0, acceleration = 0) { this.#do('set_input', this.#model.find('input', name), value, rate, acceleration); }
  /** An input follows its scene again. */
  releaseInput(name) { this.#do('release_input', this.#model.find('input', name)); }
  input(name) { return this.#call('input', this.#model.find('input', name)); }
  setStartCoordinate(name, value) { this.#do('set_start_coordinate', this.#model.find('start_coordinate', name), value); }
  setStartSpeed(name, value) { this.#do('set_start_speed', this.#model.find('start_speed', name), value); }
  /** Clears given coordinates and velocities. */
  resetStart() { this.#do('reset_start'); }

  get time() { return this.#call('time'); }
  /** The present values, as views that the next call changes: copy to keep them. */
  get outputs() { return this.#values('outputs', this.#model.outputs); }
  get coordinates() { return this.#values('coordinates', this.#model.coordinates); }
  get speeds() { return this.#values('speeds', this.#model.speeds); }
  get accelerations() { return this.#values('accelerations', this.#model.speeds); }
  get multipliers() { return this.#values('multipliers', this.#model.equations); }
  get parameters() { return this.#values('parameters', this.#model.parameters); }
  output(name) { return this.outputs[this.#model.find('output', name)]; }

  /** For each body and marker 16 numbers: position (3), attitude (w, x, y, z), velocity (3), angular velocity (3), design position (3). */
  get poses() { return this.#values('poses', { length: NUMBERS_OF_POSE * this.#model.poses.length }); }

  /** The complete state. */
  save() {
    const bytes = this.#model.call('snapshot_size'), at = this.#model.room(bytes);
    this.#do('save', at);
    return this.#model.bytes(at, bytes).slice();
  }

  /** Continues from a `save`, bit by bit. */
  restore(snapshot) {
    const bytes = this.#model.call('snapshot_size');
    if (snapshot.length !== bytes) throw new Error(`a snapshot has ${bytes} bytes, not ${snapshot.length}`);
    const at = this.#model.room(bytes);
    this.#model.bytes(at, bytes).set(snapshot);
    this.#do('restore', at, bytes);
  }

  /** What failed last, and its line in the model file. */
  failureText() {
    const at = this.#model.room(TEXT);
    this.#call('failure_text', at, TEXT);
    return this.#model.text(at);
  }

  #call(name, ...values) {
    if (!this.#sim) throw new Error('the simulation has been given back');
    return this.#model.call(name, this.#sim, ...values);
  }

  #do(name, ...values) {
    const status = this.#call(name, ...values);
    if (status === 0) return;
    const said = status > 0 ? this.failureText() : '';
    throw new SimulationError(said || this.#model.text(this.#model.call('status_text', status)), status, this.time);
  }

  #values(name, { length }) {
    const at = this.#call(name);
    if (!at) throw new Error('the simulation has not been started');
    return this.#model.doubles(at, length);
  }
}

/** The model of a module, from its bytes or its compiled form. */
async function instantiate(source) {
  const module = source instanceof WebAssembly.Module ? source : await WebAssembly.compile(source);
  return new Model(module, await WebAssembly.instantiate(module, {}));
}
