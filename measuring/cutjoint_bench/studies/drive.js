// Seconds of steps of modules in turns, in slices that a busy machine seldom interrupts: FILE of the host's code, slices, steps of a slice, modules.
const { readFileSync } = require('node:fs');
const [host, slices, steps, ...files] = process.argv.slice(2);
const instantiate = new Function(`${readFileSync(host, 'utf8')}\nreturn instantiate;`)();

async function measure() {
  const runs = [];
  for (const file of files) {
    const model = await instantiate(readFileSync(file)), sim = model.create(), begun = process.cpuUsage();
    sim.start();
    const { user, system } = process.cpuUsage(begun);
    if (model.inputs.some(({ name }) => name === 'throttle')) { sim.setInput('throttle', 0.4); sim.setInput('steer', 0.5); }
    runs.push({ sim, dt: model.facts.dt, start: (user + system) / 1e6, seconds: [] });
  }
  for (let slice = 0; slice < Number(slices); slice++)
    for (const { sim, seconds } of runs) {
      const begun = performance.now();
      for (let i = 0; i < Number(steps); i++) sim.step();
      seconds.push((performance.now() - begun) / 1000 / Number(steps));
    }
  console.log(JSON.stringify(runs.map(({ dt, start, seconds, sim }) => ({ dt, start, seconds, end: sim.time }))));
}

measure();
