// Elements of pages, what pages hold, and files that they save.
const by = (id) => document.getElementById(id);

/** An element with properties and what it holds. */
function make(tag, properties = {}, ...inside) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...inside);
  return made;
}

/** A line of a table: texts, each in its cell. */
const tableLine = (texts, tag = 'td') => make('tr', {}, ...texts.map((textContent) => make(tag, { textContent })));

const colourOf = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The bytes of a text in base 64. */
function decoded(base64) {
  const text = atob(base64), all = new Uint8Array(text.length);
  for (let i = 0; i < all.length; i++) all[i] = text.charCodeAt(i);
  return all.buffer;
}

/** A cell of a CSV file, and the heading of a column. */
const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
const heading = ({ name, unit }) => (unit ? `${name} [${unit}]` : name);

function save(name, content) {
  const link = make('a', { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

/** The name of files without what some systems have not in names. */
const stem = () => about.title.replace(/[^\w.-]+/g, '_');
