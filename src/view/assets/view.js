// View: builds a page for each result in the folder, and shows one at a time.
'use strict';

(async () => {
  const main = document.getElementById('main');
  let folder;
  try {
    folder = await source.folder();
  } catch (error) {
    main.append(h('p', { class: 'wrong' }, 'The folder cannot be read: ' + error.message));
    return;
  }
  document.getElementById('name').textContent = folder.name;
  document.title = folder.name + ' · splatsim view';
  document.getElementById('footer').textContent = `splatsim ${folder.version}` + (source.live ? '' : '; an exported page: exact values, counts per pixel and pixel traces need splatsim view');

  const pages = [];
  if (folder.compare) pages.push(['compare', 'Compare', () => comparePage(folder)]);
  if (folder.run?.pictures.length) pages.push(['frame', 'Frame', () => framePage(folder)]);
  if (folder.sequence) pages.push(['sequence', 'Frames', () => sequencePage(folder)]);
  const cycles = folder.run?.report.cycles ?? folder.cycles;
  if (cycles) pages.push(['machine', 'Machine', () => machinePage(folder.run?.report ?? null, folder.run?.datapaths ?? [], cycles, folder.tiles ? foldersTiles(folder) : null)]);
  folder.tables.forEach((rows, nth) => pages.push(['rows' + nth, rows.title === 'frames' ? 'Rows' : rows.title[0].toUpperCase() + rows.title.slice(1), () => rowsPage(rows)]));
  if (folder.charts.length && !folder.compare) pages.push(['charts', 'Charts', () => chartsPage(folder)]);

  const tabs = document.getElementById('tabs');
  const shown = new Map();
  const open = name => {
    const [key, , make] = pages.find(([key]) => key === name) ?? pages[0];
    if (!shown.has(key)) {
      const page = h('section', { id: key, role: 'tabpanel' });
      main.append(page);
      shown.set(key, page);
      page.append(...[attempt(make)].flat());
    }
    shown.forEach((page, other) => { page.hidden = other !== key; });
    [...tabs.children].forEach(tab => {
      const is = tab.dataset.page === key;
      tab.setAttribute('aria-selected', String(is));
      tab.tabIndex = is ? 0 : -1;
    });
    if (location.hash.slice(1) !== key) history.replaceState(null, '', '#' + key);
    tip.hide();
  };
  tabs.append(...pages.map(([key, title]) => h('button', { role: 'tab', 'data-page': key, 'aria-controls': key, onclick: () => open(key) }, title)));
  tabs.addEventListener('keydown', event => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = [...tabs.children].indexOf(document.activeElement);
    const next = tabs.children[(at + step + tabs.children.length) % tabs.children.length];
    open(next.dataset.page);
    next.focus();
    event.preventDefault();
    event.stopPropagation();
  });
  addEventListener('hashchange', () => open(location.hash.slice(1)));
  open(location.hash.slice(1));
})();

const chartsPage = folder => [
  h('p', { class: 'faint' }, 'Charts that the folder has as files.'),
  h('div', { class: 'charts' }, folder.charts.map(name => [h('h3', {}, name), h('img', { src: source.file(name), alt: 'chart ' + name, loading: 'lazy' })]).flat()),
];
