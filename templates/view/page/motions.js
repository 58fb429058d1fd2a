// Motions other than runs, played repeatedly: modes, the search for an equilibrium, free directions.
const { motions } = about;

function chooseMotion(name) {
  const motion = motions.find((m) => m.name === name), clip = clips.find((c) => c.name === name);
  by('motion').value = name;
  mixer?.stopAllAction();
  action = clip && mixer.clipAction(clip);
  action?.play();
  by('facts').replaceChildren(...motion.facts.map((fact) => tableLine(fact)));
  setTime(state.time);
}

function showMotions() {
  by('motions').hidden = !motions.length;
  if (!motions.length) return;
  document.body.classList.add('swinging');
  fill(by('motion'), motions.map((m) => [m.name, m.name]), motions[0].name);
  by('motion').addEventListener('change', (e) => chooseMotion(e.target.value));
  chooseMotion(motions[0].name);
  home();
  play(!matchMedia('(prefers-reduced-motion: reduce)').matches);
}
