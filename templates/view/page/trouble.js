// What a page says where it cannot show what it holds: the notice that stands there until all is ready.
const by = (id) => document.getElementById(id);

function tellTrouble(error) {
  const notice = by('notice') ?? document.body.appendChild(document.createElement('p'));
  document.body.dataset.ready = 'no';
  notice.id = 'notice';
  notice.setAttribute('role', 'alert');
  notice.textContent = `This page cannot be shown: ${String(error).replace(/\.$/, '')}. Write it anew.`;
}

// Events without an error are no script's, such as a notice that sizes will be observed in the next frame.
for (const [name, thrown] of [['error', (e) => e.error], ['unhandledrejection', (e) => e.reason]]) {
  addEventListener(name, (e) => {
    if (!thrown(e)) return;
    e.preventDefault();
    tellTrouble(thrown(e));
  });
}
