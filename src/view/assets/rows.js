// Rows: results of a sweep or a search, as plots and a table with a common selection; a click shows a machine.
'use strict';

const rowsPage = ({ columns, machine, title }) => {
  const count = columns.length ? columns[0].rows ?? columns[0].values.length : 0;
  const value = new Map(columns.map(column => {
    // A field that was set is text; if all its values are numbers, the column is numeric.
    const values = column.values ?? Array(count).fill(column.same);
    const numeric = column.kind === 'number' || (values.some(cell => cell !== null) && values.every(cell => cell === null || (typeof cell === 'string' && cell.trim() !== '' && Number.isFinite(Number(cell)))));
    return [column.name, { numeric, values: numeric ? values.map(cell => cell === null ? null : Number(cell)) : values, same: 'same' in column }];
  }));
  const cell = (name, row) => value.get(name).values[row];
  const hidden = name => name === 'key' || name.startsWith('host_');
  const varied = columns.map(column => column.name).filter(name => !value.get(name).same && !hidden(name));
  const shown = varied.length ? varied : columns.map(column => column.name).filter(name => !hidden(name));
  const same = columns.map(column => column.name).filter(name => value.get(name).same && !hidden(name) && cell(name, 0) !== null);
  const axes = columns.map(column => column.name).filter(name => value.get(name).numeric && !value.get(name).same);

  // 1: more is better; −1: less is better; 0: neither.
  const better = name => /psnr|ssim|frames_per_second/.test(name) ? 1 : /area|gates|sram_kbit|latency|cycles|energy|bytes|_bits|error|over_1|saturated|wrapped|flips|violations|blocks|seconds|starved|blocked|_memory$|unexplained/.test(name) ? -1 : 0;
  // Equal pictures have no PSNR and no error: none is best. A row that was never drawn has neither.
  const errorOf = name => name.replace(/psnr(_covered)?_db$/, 'max_error');
  const isEqual = (name, row) => /psnr(_covered)?_db$/.test(name) && value.has(errorOf(name)) && cell(errorOf(name), row) === 0;
  const numbers = (names, row) => names.map(name => {
    const number = cell(name, row);
    return typeof number === 'number' && Number.isFinite(number) ? better(name) * number : number === null && isEqual(name, row) ? Infinity : NaN;
  });
  // Pareto front: rows for which no other row is as good in all and better in one.
  const front = names => {
    const places = Array.from({ length: count }, (_, row) => [row, numbers(names, row)]).filter(([, place]) => !place.some(Number.isNaN));
    places.sort(([, a], [, b]) => { const at = a.findIndex((number, nth) => number !== b[nth]); return at < 0 ? 0 : b[at] - a[at]; });
    const kept = [];
    if (names.length === 2) {
      // In the order of the first column, best first: the following rows must be better in the second than all so far, or equal to the best.
      let best = [-Infinity, -Infinity];
      for (const [row, place] of places) {
        if (place[1] > best[1] || (place[0] === best[0] && place[1] === best[1])) { kept.push(row); best = place; }
      }
      return kept;
    }
    for (const [row, place] of places) {
      const beaten = kept.some(([, other]) => other.every((number, nth) => number >= place[nth]) && other.some((number, nth) => number > place[nth]));
      if (!beaten) kept.push([row, place]);
    }
    return kept.map(([row]) => row);
  };

  const state = { brush: null, words: '', by: null, falling: false, shown: 200, picked: [], beside: false, three: false };
  let selected = new Uint8Array(count).fill(1), left = count;
  const THREE = [['fixed_vs_ideal_psnr_db', 'psnr_db'], ['area'], ['frames_per_second']].map(names => names.find(name => axes.includes(name)));
  const hasThree = THREE.every(Boolean);
  const frontOfThree = new Set(hasThree ? front(THREE) : []);

  // ---- Selection ----

  const texts = [];
  const textOf = row => texts[row] ??= shown.map(name => cell(name, row)).join(' ').toLowerCase();
  const tests = () => state.words.toLowerCase().split(/\s+/).filter(Boolean).map(word => {
    const [, name, sign, limit] = /^([\w.]+)([<>=])(-?[\d.e+-]+)$/.exec(word) ?? [];
    if (!name || !value.has(name)) return row => textOf(row).includes(word);
    const number = Number(limit);
    return row => { const own = cell(name, row); return own !== null && (sign === '<' ? own < number : sign === '>' ? own > number : Number(own) === number); };
  });
  const select = () => {
    const words = tests(), { brush } = state;
    left = 0;
    for (let row = 0; row < count; row += 1) {
      let is = words.every(test => test(row)) && (!state.three || frontOfThree.has(row));
      if (is && brush) {
        const [x, y] = [cell(brush.x, row), cell(brush.y, row)];
        is = x !== null && y !== null && x >= brush.from[0] && x <= brush.to[0] && y >= brush.from[1] && y <= brush.to[1];
      }
      selected[row] = is ? 1 : 0;
      left += is ? 1 : 0;
    }
    state.shown = 200;
    countText.textContent = left === count ? `${readable(count)} rows` : `${readable(left)} of ${readable(count)} rows`;
    clear.disabled = !brush && !state.words && !state.three;
    plots.forEach(plot => plot.redraw());
    fill();
  };

  // ---- Plots ----

  const plots = [];
  const plotOf = (xName, yName) => {
    const names = [xName, yName], logs = [false, false];
    const holder = h('div');
    let plot = null, places = [], onFront = [];
    const picker = axis => {
      const chooser = h('select', { 'aria-label': axis ? 'vertical axis' : 'horizontal axis', onchange: () => { names[axis] = chooser.value; make(); } }, axes.map(name => h('option', { value: name, selected: name === names[axis] }, name)));
      const log = h('button', { 'aria-pressed': 'false', title: 'log scale', onclick: () => { logs[axis] = !logs[axis]; log.setAttribute('aria-pressed', String(logs[axis])); make(); } }, 'log');
      return [chooser, log];
    };
    const make = () => {
      if (!holder.clientWidth) return;
      plot?.destroy();
      const fits = (axis, number) => typeof number === 'number' && Number.isFinite(number) && (!logs[axis] || number > 0);
      places = [];
      for (let row = 0; row < count; row += 1) {
        const place = names.map(name => cell(name, row));
        if (place.every((number, axis) => fits(axis, number))) places.push([row, ...place]);
      }
      onFront = names[0] !== names[1] && names.every(better) ? front(names) : [];
      const range = axis => {
        let [low, high] = [Infinity, -Infinity];
        places.forEach(place => { low = Math.min(low, place[axis + 1]); high = Math.max(high, place[axis + 1]); });
        if (low > high) return logs[axis] ? [1, 10] : [0, 1];
        if (logs[axis]) return [low / 1.1, high * 1.1];
        const margin = high > low ? 0.04 * (high - low) : Math.abs(high) * 0.05 || 1;
        return [low - margin, high + margin];
      };
      const ends = [range(0), range(1)];
      const look = { stroke: ink('ink'), grid: { stroke: ink('line'), width: 1 }, ticks: { stroke: ink('line') } };
      const compact = new Intl.NumberFormat('en', { notation: 'compact', maximumSignificantDigits: 4 });
      const short = ticks => ticks.map(tick => tick === null ? '' : Math.abs(tick) >= 1e4 ? compact.format(tick) : tick && Math.abs(tick) < 1e-3 ? Number(tick.toPrecision(4)).toExponential() : String(Number(tick.toPrecision(6))));
      plot = new uPlot({
        width: holder.clientWidth, height: 320, legend: { show: false },
        scales: { x: { time: false, distr: logs[0] ? 3 : 1, range: () => ends[0] }, y: { distr: logs[1] ? 3 : 1, range: () => ends[1] } },
        axes: [{ ...look, label: names[0], values: (_, ticks) => short(ticks) }, { ...look, label: names[1], size: 62, values: (_, ticks) => short(ticks) }],
        cursor: { drag: { x: true, y: true, setScale: false, dist: 5 }, points: { show: false } },
        series: [{}, { paths: () => null, points: { show: false } }],
        hooks: {
          draw: [paint],
          setSelect: [self => {
            const { left: at, top, width, height } = self.select;
            if (width < 2 || height < 2) return;
            plots.forEach(other => { if (other.names !== names) other.unselect(); });
            state.brush = { x: names[0], y: names[1], from: [self.posToVal(at, 'x'), self.posToVal(top + height, 'y')], to: [self.posToVal(at + width, 'x'), self.posToVal(top, 'y')] };
            select();
          }],
        },
      }, [ends[0], ends[1]], holder);
      plot.over.addEventListener('pointermove', event => {
        const row = nearest(event);
        if (row === null) tip.hide(); else tip.show(event.clientX, event.clientY, ...summary(row));
      });
      plot.over.addEventListener('pointerleave', tip.hide);
      plot.over.addEventListener('click', event => { const row = nearest(event); if (row !== null) pick(row, event.shiftKey); });
    };
    const nearest = event => {
      const box = plot.over.getBoundingClientRect(), [px, py] = [event.clientX - box.left, event.clientY - box.top];
      let [best, least] = [null, 144];
      for (const [row, x, y] of places) {
        const distance = (plot.valToPos(x, 'x') - px) ** 2 + (plot.valToPos(y, 'y') - py) ** 2;
        // Selected points have priority.
        const weighted = selected[row] ? distance : distance + 72;
        if (weighted < least) [best, least] = [row, weighted];
      }
      return best;
    };
    const paint = self => {
      const { ctx: context } = self, ratio = devicePixelRatio || 1, box = self.bbox;
      context.save();
      context.beginPath();
      context.rect(box.left, box.top, box.width, box.height);
      context.clip();
      const at = row => [self.valToPos(cell(names[0], row), 'x', true), self.valToPos(cell(names[1], row), 'y', true)];
      const size = (count > 3000 ? 1.8 : 3.2) * ratio;
      for (const [pass, style, alpha] of [[0, ink('c6'), 0.35], [1, colour(0), count > 3000 ? 0.55 : 0.85]]) {
        context.fillStyle = style;
        context.globalAlpha = alpha;
        for (const [row] of places) {
          if (selected[row] !== pass) continue;
          const [x, y] = at(row);
          context.fillRect(x - size, y - size, 2 * size, 2 * size);
        }
      }
      context.globalAlpha = 1;
      const drawn = new Set(places.map(([row]) => row));
      const ends = onFront.filter(row => drawn.has(row)).map(at).sort((a, b) => a[0] - b[0] || b[1] - a[1]);
      context.strokeStyle = colour(1);
      context.lineWidth = 1.5 * ratio;
      context.beginPath();
      ends.forEach(([x, y], nth) => nth ? context.lineTo(x, y) : context.moveTo(x, y));
      context.stroke();
      ends.forEach(([x, y]) => { context.beginPath(); context.arc(x, y, 6 * ratio, 0, 7); context.stroke(); });
      context.strokeStyle = colour(3);
      frontOfThree.forEach(row => { if (drawn.has(row)) { const [x, y] = at(row), side = 7.5 * ratio; context.beginPath(); context.moveTo(x, y - side); context.lineTo(x + side, y); context.lineTo(x, y + side); context.lineTo(x - side, y); context.closePath(); context.stroke(); } });
      context.fillStyle = ink('ink');
      context.font = `bold ${14 * ratio}px system-ui, sans-serif`;
      state.picked.forEach((row, nth) => { if (drawn.has(row)) { const [x, y] = at(row); context.fillText('AB'[nth], x + 8 * ratio, y - 6 * ratio); } });
      context.restore();
    };
    const made = { names, redraw: () => plot?.redraw(false), unselect: () => plot?.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false), make, select: box => plot?.setSelect(box, true), uplot: () => plot, front: () => onFront };
    const [xChooser, xLog] = picker(0), [yChooser, yLog] = picker(1);
    plots.push(made);
    onWidth(holder, make);
    onColours(make);
    return h('div', { class: 'plot' }, h('div', { class: 'tools' }, yChooser, yLog, h('span', { class: 'faint' }, 'by'), xChooser, xLog), holder);
  };

  // ---- A machine ----

  const LISTED = ['scene', 'changes', 'name', 'machine', 'rule', 'layers', 'misfit', 'fixed_vs_ideal_psnr_db', 'psnr_db', 'area', 'frames_per_second', 'cycles', 'energy_j'];
  const nameOf = row => value.has('point') ? `point ${cell('point', row)}` : `row ${row + 1}`;
  const summary = row => [h('b', {}, nameOf(row)), ...LISTED.filter(name => value.has(name) && cell(name, row) !== null && cell(name, row) !== '').map(name => h('div', {}, `${name}: ${readable(cell(name, row))}`)), h('div', { class: 'faint' }, 'a click shows all values')];
  const changesOf = row => machine && value.has('changes') ? String(cell('changes', row) ?? '').split(' ').filter(change => /^[\w.*]+=/.test(change)).map(change => { const at = change.indexOf('='); return [change.slice(0, at), change.slice(at + 1)]; }) : [];
  const flagsOf = row => changesOf(row).map(([path, text]) => '--set ' + quoted(`${path}=${text}`)).join(' ');
  // Applies a change to a machine like --set.
  const described = row => {
    const made = structuredClone(machine);
    for (const [path, text] of changesOf(row)) {
      let leaf;
      try { leaf = JSON.parse(text); } catch { leaf = text; }
      const names = path.split('.'), last = names.pop();
      let at = made;
      for (const name of names) {
        if (typeof at[name] === 'string') at[name] = { format: at[name] };
        else if (typeof at[name] !== 'object' || at[name] === null) at[name] = {};
        at = at[name];
      }
      if (typeof leaf === 'string' && at[last]?.format) at[last].format = leaf;
      else if (typeof leaf === 'object' && leaf && !Array.isArray(leaf)) at[last] = { ...(typeof at[last] === 'string' ? { format: at[last] } : at[last]), ...leaf };
      else at[last] = leaf;
    }
    made.name = `${machine.name}-${value.has('point') ? cell('point', row) : row}`;
    return made;
  };
  const detail = h('div', { id: 'machine-of-row', 'aria-live': 'polite' });
  const pick = (row, beside = false) => {
    const both = (beside || state.beside) && state.picked.length && state.picked[0] !== row;
    state.picked = both ? [state.picked[0], row] : [row];
    state.beside = false;
    show();
    plots.forEach(plot => plot.redraw());
    fill();
  };
  const show = () => {
    const { picked } = state;
    if (!picked.length) { detail.replaceChildren(); return; }
    const isExact = row => value.has('exact') && cell('exact', row) && cell('exact', row) !== '[]';
    const about = picked.map((row, nth) => {
      const flags = flagsOf(row), name = machine ? `${machine.name}-${value.has('point') ? cell('point', row) : row}.json`.replace(/[^\w.-]/g, '_') : '';
      return [h('h3', {}, `${picked.length > 1 ? 'AB'[nth] + ': ' : ''}${nameOf(row)}`), ...(machine ? [
        h('div', { class: 'code flags' }, flags || '(the machine unchanged)'), flags ? copying(flags) : null, ' ',
        isExact(row) ? h('span', { class: 'faint' }, 'with units in f64, which a machine file cannot describe') : h('button', { class: 'save', onclick: () => save(name, JSON.stringify(described(row), null, 2)) }, 'save description')] : [])];
    });
    const differs = name => picked.length > 1 && cell(name, picked[0]) !== cell(name, picked[1]);
    const names = columns.map(column => column.name).filter(name => !hidden(name) && picked.some(row => cell(name, row) !== null));
    const rows = [...names.filter(differs), ...names.filter(name => !differs(name))].map(name => {
      const cells = picked.map(row => readable(cell(name, row), 6)), [a, b] = picked.map(row => cell(name, row));
      const step = picked.length > 1 && typeof a === 'number' && typeof b === 'number' && a !== b ? `${b > a ? '+' : '−'}${readable(Math.abs(b - a), 4)}${a ? ` (${b > a ? '+' : '−'}${readable(Math.abs(100 * (b - a) / a), 3)}%)` : ''}` : '';
      return h('tr', { class: differs(name) ? 'flip' : null }, h('td', {}, name), ...cells.map(text => h('td', { class: 'long' }, text)), picked.length > 1 ? h('td', { class: 'n' }, step) : null);
    });
    // The command that compares both machines. There is none for a machine with units in f64.
    const command = () => {
      const changed = (row, flag) => changesOf(row).map(([path, text]) => ` --set-${flag} ${quoted(`${path}=${text}`)}`).join('');
      const scenes = value.has('scene') ? picked.map(row => cell('scene', row)) : [];
      const [a, b] = picked;
      return `splatsim compare ${quoted(machine.name)} ${quoted(machine.name)}${changed(a, 'a')}${changed(b, 'b')}${scenes.length && scenes[0] === scenes[1] ? ` --scene ${quoted(String(scenes[0]))}` : ''}`;
    };
    const compare = machine && picked.length > 1 && !picked.some(isExact) ? h('div', { class: 'tools' }, h('div', { class: 'code', id: 'compare-command' }, command()), copying(command())) : null;
    const next = h('button', { 'aria-pressed': String(state.beside), onclick: () => { state.beside = !state.beside; next.setAttribute('aria-pressed', String(state.beside)); } }, 'compare with the next one');
    const folded = h('details', { open: true }, h('summary', {}, picked.length > 1 ? 'Comparison; differences come first' : 'All figures'), h('div', { class: 'figures', tabindex: '0' }, h('table', { id: 'figures' }, h('thead', {}, h('tr', {}, h('th', {}, ''), ...picked.map((row, nth) => h('th', {}, picked.length > 1 ? 'AB'[nth] : nameOf(row))), picked.length > 1 ? h('th', { class: 'n' }, 'B − A') : null)), h('tbody', {}, rows))));
    const close = h('button', { onclick: () => { state.picked = []; show(); plots.forEach(plot => plot.redraw()); fill(); } }, 'close');
    detail.replaceChildren(h('div', { class: 'panel' }, ...about.flat().filter(Boolean), ...(compare ? [compare] : []), h('div', { class: 'tools' }, next, close), folded));
  };

  // ---- The table ----

  const body = h('tbody');
  const more = h('button', { onclick: () => { state.shown += 1000; fill(); } }, 'more rows');
  const heads = shown.map(name => {
    const button = h('button', { onclick: () => { state.falling = state.by === name && !state.falling; state.by = name; fill(); } }, name);
    return h('th', { 'data-column': name, 'aria-sort': 'none' }, button);
  });
  const fill = () => {
    const rows = [];
    for (let row = 0; row < count; row += 1) if (selected[row]) rows.push(row);
    if (state.by) {
      const { values } = value.get(state.by), sign = state.falling ? -1 : 1;
      rows.sort((a, b) => values[a] === values[b] ? a - b : values[a] === null ? 1 : values[b] === null ? -1 : (values[a] < values[b] ? -1 : 1) * sign);
    }
    heads.forEach(head => head.setAttribute('aria-sort', head.dataset.column !== state.by ? 'none' : state.falling ? 'descending' : 'ascending'));
    body.replaceChildren(...rows.slice(0, state.shown).map(row => h('tr', { tabindex: '0', 'data-row': String(row), 'aria-selected': String(state.picked.includes(row)) },
      shown.map(name => { const own = cell(name, row); return h('td', { class: value.get(name).numeric ? 'n' : null, title: own === null ? '' : String(own) }, own === null ? '' : value.get(name).numeric ? readable(own) : String(own)); }))));
    more.hidden = rows.length <= state.shown;
  };
  body.addEventListener('click', event => { const line = event.target.closest('tr'); if (line) pick(Number(line.dataset.row), event.shiftKey); });
  body.addEventListener('keydown', event => {
    const line = event.target.closest('tr');
    if (!line) return;
    if (event.key === 'ArrowDown' || event.key === 'ArrowUp') (event.key === 'ArrowDown' ? line.nextElementSibling : line.previousElementSibling)?.focus();
    else if (event.key === 'Enter' || event.key === ' ') { const { row } = line.dataset; pick(Number(row), event.shiftKey || event.key === ' '); body.querySelector(`[data-row="${row}"]`)?.focus(); } else return;
    event.preventDefault();
  });

  const words = h('input', { type: 'search', placeholder: 'words, or area<150000', 'aria-label': 'keep rows with these words', oninput: () => { state.words = words.value; select(); } });
  const countText = h('span', { id: 'count', role: 'status' });
  const three = hasThree ? h('button', { 'aria-pressed': 'false', title: THREE.join(', '), onclick: () => { state.three = !state.three; three.setAttribute('aria-pressed', String(state.three)); select(); } }, `front of three (${frontOfThree.size})`) : null;
  const clear = h('button', { onclick: () => reset() }, 'all rows');
  const reset = () => {
    state.brush = null;
    state.words = words.value = '';
    state.three = false;
    three?.setAttribute('aria-pressed', 'false');
    plots.forEach(plot => plot.unselect());
    select();
  };
  document.addEventListener('keydown', event => { if (event.key === 'Escape' && body.offsetParent) reset(); });

  const pairs = [['area', 'fixed_vs_ideal_psnr_db'], ['frames_per_second', 'fixed_vs_ideal_psnr_db'], ['area', 'frames_per_second'], ['area', 'psnr_db'], ['pixel_bytes', 'area'], ['value', 'drawn.fixed_vs_golden.psnr_db'], ['value', 'drawn.golden_vs_ideal.psnr_db'], ['value', 'drawn.lockstep.max_error']].filter(pair => pair.every(name => axes.includes(name)));
  while (pairs.length < 2 && axes.length > 1) pairs.push([axes[0], axes[Math.min(axes.length - 1, 1 + pairs.length)]]);
  const page = [
    h('p', {}, `${readable(count)} rows${machine ? `, machines made from ${machine.name}` : ''}.`),
    h('p', { class: 'faint' }, 'Dragging in a plot selects in all plots and in the table; Escape selects all again. A click on a point or a row shows its machine; with Shift it is compared with the first one. ○ on a line: Pareto front of both axes. ◇: Pareto front of accuracy, area and speed.'),
    h('div', { class: 'plots' }, pairs.slice(0, 3).map(([x, y]) => plotOf(x, y))),
    h('div', { class: 'tools' }, words, three, clear, countText), detail,
    h('div', { class: 'rows', tabindex: '-1' }, h('table', {}, h('thead', {}, h('tr', {}, heads)), body)), more,
    same.length ? h('details', {}, h('summary', {}, `Equal in all rows (${same.length})`), table(['', ''], same.map(name => [name, String(cell(name, 0))]), 9)) : null,
  ].filter(Boolean);
  select();
  // For tests: position of a value on the screen.
  page.plots = plots;
  window.rowsPlots = plots;
  return page;
};
