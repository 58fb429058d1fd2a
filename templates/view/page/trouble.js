// What a page says where it cannot show what it holds: the notice that stands there until all is ready.
function tellTrouble(reason) {
  const notice = document.getElementById('notice') ?? document.body.appendChild(document.createElement('p'));
  document.body.dataset.ready = 'no';
  notice.id = 'notice';
  notice.setAttribute('role', 'alert');
  notice.textContent = `This page cannot be shown: ${reason}. Write it anew.`;
}

for (const [event, reasonOf] of [['error', (e) => e.error ?? e.message], ['unhandledrejection', (e) => e.reason]]) {
  addEventListener(event, (e) => {
    e.preventDefault();
    tellTrouble(String(reasonOf(e)).replace(/\.$/, ''));
  });
}
