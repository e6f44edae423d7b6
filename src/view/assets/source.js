// Source: origin of the page's data: the server, or the page itself. Also small helpers.
'use strict';

const source = (() => {
  const embedded = document.getElementById('folder');
  const all = embedded ? JSON.parse(embedded.textContent) : null;
  const asked = async path => {
    const response = await fetch(path);
    if (!response.ok) throw new Error((await response.text()).trim());
    return response;
  };
  return {
    // Whether data that is computed on demand is available.
    live: !embedded,
    folder: async () => all ?? (await asked('folder')).json(),
    file: name => all ? all.files[name] : 'file/' + encodeURIComponent(name),
    json: async path => (await asked(path)).json(),
    // For a file that has changed since the start, the response is a sentence, which an image element would not show.
    picture: async name => {
      if (!all) return createImageBitmap(await (await asked('file/' + encodeURIComponent(name))).blob());
      const image = new Image();
      image.src = all.files[name];
      await image.decode();
      return createImageBitmap(image);
    },
    text: async name => all ? all.texts[name] : (await asked('file/' + encodeURIComponent(name))).text(),
    floats: async path => new Float32Array(await (await asked(path)).arrayBuffer()),
  };
})();

// A part of the page, or a sentence about why it cannot be shown.
const attempt = make => {
  try {
    return make();
  } catch (error) {
    return h('p', { class: 'wrong' }, `This cannot be shown: ${error.message}. Was it written by another version?`);
  }
};

// An element: properties by name, `on…` as listeners, then children.
const h = (name, properties = {}, ...children) => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else if (key in made && typeof value !== 'string') made[key] = value;
    else made.setAttribute(key, value);
  }
  made.append(...children.flat().filter(child => child !== null && child !== undefined && child !== false));
  return made;
};

const svg = (name, attributes = {}, ...children) => {
  const made = document.createElementNS('http://www.w3.org/2000/svg', name);
  Object.entries(attributes).forEach(([key, value]) => made.setAttribute(key, value));
  made.append(...children.flat().filter(child => child));
  return made;
};

// A number in a few digits, with thousands separators.
const readable = (value, digits = 5) => {
  if (value === null || value === undefined) return '–';
  if (typeof value !== 'number') return String(value);
  if (!Number.isFinite(value)) return value > 0 ? '∞' : '–';
  if (Number.isInteger(value)) return Math.abs(value) < 1e15 ? value.toLocaleString('en') : Number(value.toPrecision(digits)).toExponential();
  const size = Math.abs(value);
  return size >= 1e-3 && size < 1e7 ? String(Number(value.toPrecision(digits))) : Number(value.toPrecision(digits)).toExponential();
};

const share = (part, whole) => whole ? (100 * part / whole).toFixed(part && part < whole / 100 ? 1 : 0) + '%' : '–';
const colour = nth => getComputedStyle(document.documentElement).getPropertyValue('--c' + nth % 8).trim();
const ink = name => getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim();
const quoted = text => /^[\w./:=,+@%-]+$/.test(text) ? text : "'" + text.replaceAll("'", "'\\''") + "'";
const table = (heads, rows, numbersFrom = 1) => h('div', { class: 'scroll', tabindex: '0' }, h('table', {},
  h('thead', {}, h('tr', {}, heads.map((head, at) => h('th', { class: at >= numbersFrom ? 'n' : null }, head)))),
  h('tbody', {}, rows.map(row => h('tr', {}, row.map((cell, at) => h('td', { class: at >= numbersFrom ? 'n' : null }, cell)))))));
// Golden and fixed against a photograph, or means over frames, which are infinite if one figure is.
const againstTable = ({ golden, fixed, fixed_minus_golden: loss }, none = 'equal') => {
  const row = (name, { psnr_db: db, ssim, flip, not_finite: broken }) => [name, broken ? 'NaN' : db === null ? none : db.toFixed(3), ssim.toFixed(5), flip.toFixed(5)];
  const step = (value, digits) => value === null ? '–' : (value < 0 ? '−' : '+') + Math.abs(value).toFixed(digits);
  return table(['', 'PSNR dB', 'SSIM', 'FLIP'], [row('golden', golden), row('fixed', fixed), ['fixed − golden', step(loss.psnr_db, 3), step(loss.ssim, 5), step(loss.flip, 5)]]);
};
const save = (name, text) => {
  const link = h('a', { href: URL.createObjectURL(new Blob([text], { type: 'application/json' })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
const copying = text => h('button', { onclick: async event => {
  try { await navigator.clipboard.writeText(text); event.target.textContent = 'copied'; } catch { event.target.textContent = 'cannot copy here'; }
} }, 'copy');
// Drawings that depend on the device's colours are redrawn when these change.
const onColours = draw => matchMedia('(prefers-color-scheme: dark)').addEventListener('change', draw);
const onWidth = (element, draw) => {
  let width = 0;
  new ResizeObserver(() => {
    const now = element.clientWidth;
    if (now && now !== width) { width = now; requestAnimationFrame(draw); }
  }).observe(element);
};

// A drawing that is fitted to the available width.
const fitted = draw => {
  const holder = h('div');
  onWidth(holder, () => holder.replaceChildren(attempt(() => draw(Math.min(holder.clientWidth, 1100)) ?? "")));
  return holder;
};

const tip = (() => {
  const box = h('div', { class: 'tip', hidden: true, role: 'tooltip' });
  document.body.append(box);
  return {
    show: (x, y, ...content) => {
      box.replaceChildren(...content);
      box.hidden = false;
      const { width, height } = box.getBoundingClientRect();
      box.style.left = Math.max(4, Math.min(x + 14, innerWidth - width - 6)) + 'px';
      box.style.top = (y + height + 18 > innerHeight ? Math.max(4, y - height - 10) : y + 14) + 'px';
    },
    hide: () => { box.hidden = true; },
  };
})();
