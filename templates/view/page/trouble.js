// The notice of a page that cannot show its content, present until all is ready.
function showError(error) {
  const notice = by('notice') ?? document.body.appendChild(document.createElement('p'));
  document.body.dataset.ready = 'no';
  notice.id = 'notice';
  notice.setAttribute('role', 'alert');
  notice.textContent = `This page cannot be shown: ${String(error).replace(/\.$/, '')}. Write it anew.`;
}

// Events without an error are not from scripts, such as the ResizeObserver's loop notice.
for (const [name, thrown] of [['error', (e) => e.error], ['unhandledrejection', (e) => e.reason]]) {
  addEventListener(name, (e) => {
    if (!thrown(e)) return;
    e.preventDefault();
    showError(thrown(e));
  });
}
