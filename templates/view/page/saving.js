// Saves the table, the picture or a video as files.
/** The rows of the page, with its digits. */
function tableText() {
  const all = [{ name: 't', values: t, unit: 's' }, ...columns];
  const head = all.map((c) => quoted(heading(c))).join(',');
  return [head, ...Array.from(t, (_, i) => all.map((c) => (Number.isFinite(c.values[i]) ? +c.values[i].toPrecision(7) : '')).join(','))].join('\n') + '\n';
}

function savePicture() {
  render();
  renderer.domElement.toBlob((blob) => save(`${stem()}.png`, blob), 'image/png');
}

/** Plays the run once at the chosen speed and saves the video. */
function saveVideo() {
  const kind = ['video/webm;codecs=vp9', 'video/webm', 'video/mp4'].find((each) => MediaRecorder.isTypeSupported(each));
  const recorder = new MediaRecorder(renderer.domElement.captureStream(30), { mimeType: kind, videoBitsPerSecond: 8e6 }), parts = [];
  recorder.addEventListener('dataavailable', (e) => parts.push(e.data));
  recorder.addEventListener('stop', () => save(`${stem()}.${kind.slice(6, kind.includes('mp4') ? 9 : 10)}`, new Blob(parts, { type: kind })));
  play(false);
  setTime(first);
  recorder.start();
  play(true);
  const wait = () => (state.playing ? setTimeout(wait, 50) : setTimeout(() => recorder.stop(), 200));
  wait();
}

const SAVING = { table: () => save(`${stem()}.csv`, new Blob([about.drive ? driveTable() : tableText()], { type: 'text/csv' })), log: () => { save(`${stem()}.json`, new Blob([driveLog()], { type: 'application/json' })); say(`Replay: ${about.drive.replay} --replay ${stem()}.json`); }, picture: savePicture, video: saveVideo };
by('save').addEventListener('change', (e) => { const how = SAVING[e.target.value]; e.target.value = ''; how?.(); });
