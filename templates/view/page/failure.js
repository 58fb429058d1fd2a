// A failed run: the cause, the element, and its last steps in slow motion.
const { failure } = about;

/** Duration of the last steps in slow motion, s. */
const SLOWLY = 8;

function sayStopped(text, place, advice) {
  by('failure').hidden = false;
  for (const [id, textContent] of [['stopped', text], ['place', place], ['advice', advice]]) by(id).textContent = textContent;
}

function showFailure() {
  if (!failure) return;
  sayStopped(failure.text, failure.place, failure.advice);
  by('advice').hidden = !failure.advice;
  by('slowly').hidden = !(last > failure.since);
  by('slowly').addEventListener('click', () => {
    const speed = (last - failure.since) / SLOWLY, list = by('speed');
    if (![...list.options].some((o) => Number(o.value) === speed)) list.prepend(new Option(`${+speed.toPrecision(1)} x`, String(speed)));
    list.value = String(speed);
    setTime(failure.since);
    play(true);
  });
  const own = failure.bodies.flatMap(columnsOf);
  if (own.length) chooseColumns([own[0].name]);
  setTime(last);
}
