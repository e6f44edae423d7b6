// Machine: the block diagram with formats and utilisation, a unit's stalls, ranges and area, units over time, the roofline.
'use strict';

const machinePage = (report, datapaths, cycles, tiles) => {
  const { total, units } = cycles;
  const described = report?.machine.description;
  const base = unit => unit.name.replace(/\.\d+$/, '');
  const kinds = [...new Set(units.map(base))];
  const of = kind => units.filter(unit => base(unit) === kind);
  const sum = (kind, what) => of(kind).reduce((all, unit) => all + unit[what], 0);
  const STATES = ['busy', 'starved', 'blocked', 'memory'];
  const SHADES = { busy: 'var(--c0)', starved: 'var(--line)', blocked: 'var(--c1)', memory: 'var(--c4)' };
  const DOES = {
    fetch: 'reads splats from memory', project: 'world point → camera → pixel', ellipse: 'normal and radius, or three axes → ellipse, box, depth slopes', sort: 'sorts splats by depth', colour: 'colours from harmonics',
    bin: 'lists splats tile by tile', list: 'reads the lists of tiles', raster: 'walks the box: radial index and depth per pixel', gauss: 'radial index → weight', cache: 'keeps lines of the frame buffer',
    fragment: 'at most l fragments per pixel: accumulate, insert, merge, evict', shade: 'divides by the weight, normalises, lights', resolve: 'blends front to back into the frame word',
  };
  // Words on the wires to a unit.
  const WIRES = { project: ['splat.position', 'splat.radius'], ellipse: ['project.pixel', 'project.depth'], raster: ['ellipse.conic', 'ellipse.amplitude'], gauss: ['gauss.radial_index'], fragment: ['gauss.weight', 'fragment.depth'], shade: ['fragment.weight_sum', 'fragment.colour_sum'], resolve: ['shade.premultiplied'], frame: ['resolve.frame'] };
  const formatOf = path => { const value = path.split('.').reduce((at, name) => at?.[name], described); return typeof value === 'string' ? value : value?.format; };
  const wires = to => (WIRES[to] ?? []).map(path => [path, formatOf(path)]).filter(([, format]) => format).map(([path, format]) => `${path.split('.')[1]} ${format}`);
  const fifo = to => report?.machine.timing.storage?.fifos?.find(one => one.to === to && one.places > 0);

  // ---- The diagram ----

  const detail = h('div', { class: 'panel', id: 'unit', 'aria-live': 'polite' });
  let chosen = kinds.includes(cycles.bottleneck) ? cycles.bottleneck : kinds[0];
  const diagram = h('div', { id: 'diagram' });
  const drawDiagram = () => {
    const chain = [...kinds.filter(kind => kind !== 'shade'), 'frame'], BOX = 122, GAP = 108, HIGH = 66, ROW = 164;
    const across = Math.max(1, Math.floor((diagram.clientWidth + GAP - 30) / (BOX + GAP)));
    const upright = across === 1, wide = upright ? diagram.clientWidth : across * (BOX + GAP) - GAP + 30;
    const hasShade = kinds.includes('shade');
    const at = nth => upright ? [12, 12 + nth * 126] : [14 + (nth % across) * (BOX + GAP), 26 + Math.floor(nth / across) * ROW];
    const rows = Math.ceil(chain.length / across);
    const isLast = hasShade && Math.floor(chain.indexOf('fragment') / across) === rows - 1;
    const high = upright ? chain.length * 126 - 50 : 26 + (rows - 1) * ROW + (isLast ? 170 : 74);
    const picture = svg('svg', { viewBox: `0 0 ${wide} ${high}`, width: wide, height: high, role: 'group', 'aria-label': 'block diagram' },
      svg('defs', {}, svg('marker', { id: 'head', viewBox: '0 0 8 8', refX: 7, refY: 4, markerWidth: 7, markerHeight: 7, orient: 'auto' }, svg('path', { d: 'M0,0L8,4L0,8Z', fill: 'var(--faint)' }))));
    const line = d => svg('path', { d, fill: 'none', stroke: 'var(--faint)', 'stroke-width': 1.5, 'marker-end': 'url(#head)' });
    const words = (to, x, y, anchor) => {
      const queue = fifo(to);
      return [...wires(to), queue ? `FIFO ${queue.places} × ${queue.bits} bit` : null].filter(Boolean).map((text, nth) => textAt(x, y + 13 * nth, text, 'faint', anchor));
    };
    chain.forEach((kind, nth) => {
      const [x, y] = at(nth);
      if (nth) {
        const [fromX, fromY] = at(nth - 1);
        if (upright) picture.append(line(`M${x + 26},${fromY + HIGH}V${y - 1}`), ...words(kind, x + 38, fromY + HIGH + 16, 'start'));
        else if (fromY === y) picture.append(line(`M${fromX + BOX},${y + HIGH / 2}H${x - 1}`), ...words(kind, x - GAP / 2, y + HIGH / 2 - 20 + (wires(kind).length < 2 ? 13 : 0), 'middle').map((text, at, all) => { if (at === all.length - 1 && fifo(kind)) text.setAttribute('y', y + HIGH / 2 + 16); return text; }));
        else {
          const turn = y - 56;
          picture.append(line(`M${fromX + BOX / 2},${fromY + HIGH}V${turn}H${x + BOX / 2}V${y - 1}`), ...words(kind, x + BOX / 2 + 8, turn + 14, 'start'));
        }
      }
      picture.append(kind === 'frame' ? svg('g', {}, textAt(x + 8, y + HIGH / 2 + 5, 'frame')) : box(kind, x, y, BOX, HIGH));
      if (kind === 'fragment' && hasShade && !upright) {
        picture.append(line(`M${x + BOX / 2 - 14},${y + HIGH}V${y + 103}`), line(`M${x + BOX / 2 + 14},${y + 104}V${y + HIGH + 1}`), ...words('shade', x + BOX / 2 + 22, y + HIGH + 14, 'start'), box('shade', x, y + 104, BOX, HIGH - 8));
      }
    });
    if (upright && hasShade) {
      const [x, y] = at(chain.indexOf('fragment'));
      picture.append(line(`M${x + BOX},${y + 26}H${x + BOX + 34}`), line(`M${x + BOX + 35},${y + 42}H${x + BOX + 1}`), box('shade', x + BOX + 36, y, BOX, HIGH));
    }
    diagram.replaceChildren(picture);
  };
  const box = (kind, x, y, wide, high) => {
    const copies = of(kind).length, parts = STATES.map(state => sum(kind, state) / Math.max(1, copies * total));
    const group = svg('g', { class: 'unit', tabindex: 0, role: 'button', 'aria-pressed': String(kind === chosen), 'aria-label': `${kind}, busy ${share(parts[0], 1)}`, 'data-unit': kind },
      svg('rect', { x, y, width: wide, height: high, rx: 6, fill: 'var(--raised)', stroke: kind === cycles.bottleneck ? 'var(--c1)' : 'var(--line)', 'stroke-width': kind === cycles.bottleneck ? 2.5 : 1 }),
      textAt(x + 9, y + 20, kind + (copies > 1 ? ` ×${copies}` : '')), textAt(x + 9, y + 37, `busy ${share(parts[0], 1)}`, 'faint'));
    let left = x + 8;
    parts.forEach((part, nth) => {
      const long = (wide - 16) * part;
      group.append(svg('rect', { x: left, y: y + high - 17, width: Math.max(0, long), height: 9, fill: SHADES[STATES[nth]] }));
      left += long;
    });
    group.addEventListener('click', () => choose(kind));
    group.addEventListener('keydown', event => { if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); choose(kind); diagram.querySelector(`[data-unit="${kind}"]`)?.focus(); } });
    return group;
  };

  // ---- A unit ----

  const choose = kind => {
    chosen = kind;
    diagram.querySelectorAll('.unit').forEach(unit => unit.setAttribute('aria-pressed', String(unit.dataset.unit === kind)));
    detail.replaceChildren(...unitOf(kind));
  };
  const unitOf = kind => {
    const cost = report?.cost.units.find(unit => unit.name === kind), area = report?.cost.area;
    const signals = report?.signals.filter(signal => signal.unit === kind) ?? [];
    const timing = report?.machine.timing[kind];
    const stalls = of(kind).map(unit => [unit.name, readable(unit.items), ...STATES.map(state => `${readable(unit[state])} (${share(unit[state], total)})`), unit.starved_by ?? '–', unit.blocked_by.map(one => `${one.by} ${readable(one.cycles)}`).join(', ') || '–']);
    const deepest = of(kind).map(unit => unit.occupancy ?? []).reduce((a, b) => a.length > b.length ? a : b, []);
    return [h('h2', {}, kind), h('p', { class: 'faint' }, DOES[kind] ?? ''),
      timing ? h('p', {}, `Latency ${readable(timing.latency)} cycles, initiation interval ${readable(timing.interval)}${timing.units > 1 ? `, ${timing.units} in parallel` : ''}.`) : null,
      h('h3', {}, 'Stalls'), table(['', 'items', ...STATES, 'starved by', 'blocked by'], stalls),
      deepest.length > 1 ? [h('h3', {}, 'Occupancy of its output FIFO'), bars(deepest.map((count, nth) => [String(nth), count]))] : [],
      cost ? [h('h3', {}, 'Area'), h('p', {}, `${readable(Math.round(cost.area))} LUT equivalents, ${share(cost.area, area)} of the machine: ${['multiplier', 'adder', 'multiplexer', 'register', 'rom'].map(part => `${part} ${readable(cost[part])}`).join(', ')} bits; ${readable(cost.blocks_18)} blocks of 18×18.`)] : [],
      datapathsOf(kind),
      signals.length ? [h('h3', {}, 'Ranges'), h('p', { class: 'faint' }, 'Words by powers of two of their magnitude; zeros at the left. Lines mark the range of the format.'), ...signals.map(rangeOf)] : [],
    ].flat().filter(Boolean);
  };
  // The words of each graph of a unit, each below those that it is made from.
  const datapathsOf = kind => {
    const graphs = datapaths.filter(one => one.unit === kind);
    if (!graphs.length) return [];
    const attributed = report?.attribution ? ' dB: the error of the picture if this word alone is rounded.' : ' With run --attribute each word also shows its error.';
    return [h('h3', {}, 'Datapath'), h('p', { class: 'faint' }, `Words from top to bottom, each below those that it is made from. The bar shows how many of its bits the frame needs, from the right; an orange frame marks words out of range.${attributed} A click shows the range of a word.`),
      ...graphs.flatMap(graph => [graphs.length > 1 ? h('h4', {}, graph.name) : null, datapathOf(kind, graph)])];
  };
  const datapathOf = (kind, graph) => {
    const BOX = 138, HIGH = 46, [wide, high] = graph.size_px, all = graph.words, named = new Map(all.map(word => [word.name, word]));
    const edges = all.flatMap(word => word.from.map(name => [named.get(name), word])).filter(([from]) => from).map(([from, to]) => {
      const [x, y, u, v] = [from.x, from.y + HIGH, to.x, to.y], bend = Math.max(18, Math.abs(v - y) / 2);
      return { from, to, line: svg('path', { d: `M${x},${y}C${x},${y + bend} ${u},${v - bend} ${u},${v - 1}`, fill: 'none', stroke: 'var(--faint)', 'stroke-width': 1, opacity: 0.45 }) };
    });
    const light = word => edges.forEach(({ from, to, line }) => { const on = from === word || to === word; line.setAttribute('stroke', on ? 'var(--c0)' : 'var(--faint)'); line.setAttribute('stroke-width', on ? 2 : 1); line.setAttribute('opacity', on ? 1 : word ? 0.15 : 0.45); });
    const boxes = all.map(word => {
      const [unit, ...rest] = word.name.split('.'), name = unit === kind ? rest.join('.') : word.name;
      const signal = report?.signals.find(one => `${one.unit}.${one.name}` === word.name || `${one.unit}.${one.name}` === word.name + '.result');
      const error = report?.attribution?.words.find(one => one.name === word.name)?.alone, exact = error && !(error.psnr_db < 200);
      const outside = signal ? signal.saturated_low + signal.saturated_high + signal.wrapped : 0;
      const [, signed, integer, fraction] = /^([UI])(-?\d+)F(-?\d+)$/.exec(word.format ?? '') ?? [];
      const places = Number(integer) + Number(fraction) - (signed === 'I' ? 1 : 0);
      // Bits from the least place to the top of the greatest word.
      const top = signal?.histogram.counts.length ? signal.histogram.first_log2 + signal.histogram.counts.length + Number(fraction) : 0;
      const used = places > 0 ? Math.min(1, Math.max(0, top / places)) : 0;
      const facts = [signal ? `${readable(signal.words)} words` : word.from.length ? 'not used in this frame' : 'input', top ? `${Math.min(places, top)} of ${places} bits used` : null, outside ? `${readable(outside)} out of range` : null, error ? (exact ? 'no error alone' : `${error.psnr_db.toFixed(1)} dB alone`) : null].filter(Boolean);
      const shown = name.length > 20 ? name.slice(0, 19) + '…' : name;
      const group = svg('g', { class: 'word', tabindex: 0, role: 'button', 'aria-label': `${word.name} ${word.format ?? ''}: ${facts.join(', ')}`, 'data-word': word.name },
        svg('rect', { x: word.x - BOX / 2, y: word.y, width: BOX, height: HIGH, rx: 6, fill: word.from.length ? 'var(--raised)' : 'var(--ground)', stroke: outside ? 'var(--c1)' : 'var(--line)', 'stroke-width': outside ? 2 : 1, 'stroke-dasharray': !word.from.length || signal ? '' : '4 3' }),
        textAt(word.x - BOX / 2 + 7, word.y + 16, shown), textAt(word.x - BOX / 2 + 7, word.y + 31, `${word.format ?? ''}${word.wires > 1 ? ` ×${word.wires}` : ''}`, 'faint'),
        !error || exact ? null : textAt(word.x + BOX / 2 - 7, word.y + 31, `${error.psnr_db.toFixed(0)} dB`, 'faint', 'end'),
        svg('rect', { x: word.x - BOX / 2 + 7, y: word.y + 36, width: BOX - 14, height: 4, fill: 'var(--line)', opacity: top ? 1 : 0 }),
        svg('rect', { x: word.x + BOX / 2 - 7 - (BOX - 14) * used, y: word.y + 36, width: (BOX - 14) * used, height: 4, fill: 'var(--c0)' }));
      const show = () => { const curve = detail.querySelector(`[data-signal="${CSS.escape(word.name)}"]`) ?? detail.querySelector(`[data-signal="${CSS.escape(word.name + '.result')}"]`); if (curve) { curve.open = true; curve.scrollIntoView({ block: 'center' }); } };
      group.addEventListener('pointerenter', () => light(word));
      group.addEventListener('focus', () => light(word));
      group.addEventListener('pointermove', event => tip.show(event.clientX, event.clientY, h('b', {}, word.name), facts.join('; ')));
      group.addEventListener('pointerleave', () => { light(null); tip.hide(); });
      group.addEventListener('click', show);
      group.addEventListener('keydown', event => { if (event.key === 'Enter' || event.key === ' ') { event.preventDefault(); show(); } });
      return group;
    });
    return svg('svg', { viewBox: `0 0 ${wide} ${high}`, width: wide, height: high, role: 'group', 'aria-label': `datapath of ${graph.name}`, class: 'datapath' }, edges.map(edge => edge.line), boxes);
  };
  const bars = entries => {
    const most = Math.max(...entries.map(([, count]) => count), 1), step = Math.min(26, 700 / entries.length), wide = step * entries.length + 20;
    return svg('svg', { viewBox: `0 0 ${wide} 92`, width: wide, height: 92, role: 'img', 'aria-label': 'histogram' }, entries.map(([name, count], nth) => {
      const high = 66 * count / most, made = svg('g', {}, svg('rect', { x: 10 + nth * step, y: 72 - high, width: Math.max(1, step - 2), height: high, fill: 'var(--c0)' }), step > 16 || nth % 4 === 0 ? textAt(10 + nth * step + step / 2 - 1, 86, name, 'faint', 'middle') : null);
      made.addEventListener('pointermove', event => tip.show(event.clientX, event.clientY, `${name}: ${readable(count)}`));
      made.addEventListener('pointerleave', tip.hide);
      return made;
    }));
  };
  const rangeOf = signal => {
    const { counts, first_log2: first, zeros } = signal.histogram;
    const [, signed, integer, fraction] = /^([UI])(-?\d+)F(-?\d+)$/.exec(signal.format) ?? [];
    const low = -Number(fraction), high = Number(integer) - (signed === 'I' ? 1 : 0);
    const outside = signal.saturated_low + signal.saturated_high + signal.wrapped;
    const facts = [`${readable(signal.words)} words`, signal.min === null ? null : `${readable(signal.min)} to ${readable(signal.max)}`, signal.narrowest && signal.narrowest !== signal.format ? `${signal.narrowest} is enough` : null, outside ? `${readable(outside)} out of range` : null].filter(Boolean).join('; ');
    const head = h('summary', {}, h('b', {}, signal.name), ` ${signal.format}: ${facts}`);
    if (!counts.length && !zeros) return h('div', {}, head.textContent);
    const from = Math.min(low, first), to = Math.max(high, first + counts.length), places = to - from, step = Math.min(22, 620 / places), most = Math.max(zeros, ...counts);
    const tall = count => count ? Math.max(1, 54 * Math.log(1 + count) / Math.log(1 + most)) : 0;
    const bar = (nth, count, caption) => {
      const made = svg('rect', { x: 34 + nth * step, y: 62 - tall(count), width: Math.max(1, step - 1.5), height: tall(count), fill: nth < 0 ? 'var(--c6)' : 'var(--c0)' });
      made.addEventListener('pointermove', event => tip.show(event.clientX, event.clientY, `${caption}: ${readable(count)}`));
      made.addEventListener('pointerleave', tip.hide);
      return made;
    };
    const edge = power => svg('line', { x1: 34 + (power - from) * step - 1, x2: 34 + (power - from) * step - 1, y1: 4, y2: 66, stroke: 'var(--c1)', 'stroke-width': 1.5 });
    const wide = 44 + places * step + 20;
    const picture = svg('svg', { viewBox: `0 0 ${wide} 84`, width: wide, height: 84, role: 'img', 'aria-label': `range of ${signal.name}` }, bar(-1.2, zeros, 'zero'), counts.map((count, nth) => bar(first - from + nth, count, `2^${first + nth}`)), edge(low), edge(high),
      textAt(34, 80, `2^${from}`, 'faint'), textAt(34 + places * step, 80, `2^${to}`, 'faint', 'end'), textAt(4, 80, '0', 'faint'));
    return h('details', { open: outside > 0, 'data-signal': `${signal.unit}.${signal.name}` }, head, picture);
  };

  // ---- States of each unit ----

  const stacks = width => {
    const W = Math.min(width, 860), ROW = 22, LEFT = 86;
    const picture = svg('svg', { viewBox: `0 0 ${W} ${ROW * units.length + 22}`, width: W, height: ROW * units.length + 22, role: 'img', 'aria-label': 'states of each unit' });
    units.forEach((unit, nth) => {
      const y = nth * ROW + 4;
      let left = LEFT;
      picture.append(textAt(LEFT - 8, y + 13, unit.name, '', 'end'));
      STATES.forEach(state => {
        const long = (W - LEFT - 8) * unit[state] / Math.max(1, total), made = svg('rect', { x: left, y, width: long, height: ROW - 6, fill: SHADES[state] });
        made.addEventListener('pointermove', event => tip.show(event.clientX, event.clientY, h('b', {}, unit.name), `${state}: ${readable(unit[state])} cycles, ${share(unit[state], total)}`));
        made.addEventListener('pointerleave', tip.hide);
        picture.append(made);
        left += long;
      });
    });
    [0, 50, 100].forEach(part => picture.append(textAt(LEFT + (W - LEFT - 8) * part / 100, ROW * units.length + 18, part + '%', 'faint', part === 100 ? 'end' : part ? 'middle' : 'start')));
    return picture;
  };
  const legend = h('div', { class: 'legend' }, STATES.map(state => { const swatch = h('i'); swatch.style.background = SHADES[state]; return h('span', {}, swatch, state); }));

  // ---- Over time ----

  const timed = units.filter(unit => unit.over_time?.busy.length);
  const timeline = h('div', { id: 'timeline' });
  let plot = null;
  const drawTimeline = () => {
    if (!timeline.clientWidth || !timed.length) return;
    plot?.destroy();
    const POINTS = 600, x = Array.from({ length: POINTS }, (_, nth) => total * (nth + 0.5) / POINTS);
    const busy = timed.map(({ over_time: { window, busy } }) => x.map(cycle => 100 * (busy[Math.floor(cycle / window)] ?? 0) / window));
    const axis = { stroke: ink('ink'), grid: { stroke: ink('line'), width: 1 }, ticks: { stroke: ink('line') } };
    const dashes = [[], [6, 3], [2, 2]];
    plot = new uPlot({
      width: timeline.clientWidth, height: 300, scales: { x: { time: false }, y: { range: [0, 100] } },
      axes: [{ ...axis, label: 'cycle', values: (_, ticks) => ticks.map(tick => readable(tick)) }, { ...axis, label: '% of cycles busy', size: 56 }],
      series: [{ label: 'cycle', value: (_, value) => value === null ? '' : readable(Math.round(value)) }, ...timed.map((unit, nth) => ({ label: unit.name, stroke: colour(nth % 7), dash: dashes[Math.floor(nth / 7) % 3], width: 1.6, show: sum(base(unit), 'busy') / total > 0.02, value: (_, value) => value === null ? '' : value.toFixed(0) + '%' }))],
    }, [x, ...busy], timeline);
  };

  // ---- Roofline ----

  const roofline = width => {
    const { memory } = cycles, contributions = report?.scene.fragments ?? sum('gauss', 'items');
    if (!memory?.bytes || !contributions || !total) return null;
    const rate = contributions * cycles.clock_hz / total, intensity = contributions / memory.bytes;
    const roofs = kinds.map(kind => [kind, sum(kind, 'busy') && contributions * cycles.clock_hz * of(kind).length / sum(kind, 'busy')]).filter(([, roof]) => roof).sort((a, b) => a[1] - b[1]).slice(0, 3);
    const peak = memory.peak_bytes_per_second;
    const W = Math.min(width, 860), H = 330, box = { left: 74, right: W - 20, top: 16, bottom: H - 42 };
    const xs = [intensity / 30, intensity * 30].map(Math.log10), tops = [rate, ...roofs.map(([, roof]) => roof), peak ? peak * intensity : rate];
    const ys = [Math.log10(Math.min(...tops) / 12), Math.log10(Math.max(...tops) * 2.5)];
    const X = value => box.left + (box.right - box.left) * (Math.log10(value) - xs[0]) / (xs[1] - xs[0]), Y = value => box.bottom - (box.bottom - box.top) * (Math.log10(value) - ys[0]) / (ys[1] - ys[0]);
    const picture = svg('svg', { viewBox: `0 0 ${W} ${H}`, width: W, height: H, role: 'img', 'aria-label': 'roofline' }, svg('clipPath', { id: 'inside' }, svg('rect', { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top })), svg('rect', { x: box.left, y: box.top, width: box.right - box.left, height: box.bottom - box.top, fill: 'none', stroke: 'var(--line)' }));
    const decades = ([from, to]) => Array.from({ length: Math.floor(to) - Math.ceil(from) + 1 }, (_, nth) => Math.pow(10, Math.ceil(from) + nth));
    decades(xs).forEach(value => picture.append(textAt(X(value), box.bottom + 15, readable(value, 2), 'faint', 'middle')));
    decades(ys).forEach(value => picture.append(textAt(box.left - 6, Y(value) + 4, value.toExponential(0), 'faint', 'end'), svg('line', { x1: box.left, x2: box.right, y1: Y(value), y2: Y(value), stroke: 'var(--line)', opacity: 0.6 })));
    const [least, most] = xs.map(power => Math.pow(10, power));
    if (peak) picture.append(svg('line', { x1: X(least), y1: Y(least * peak), x2: X(most), y2: Y(most * peak), stroke: 'var(--c4)', 'stroke-width': 2.5, 'clip-path': 'url(#inside)' }), textAt(box.left + 8, box.top + 16, `slope: memory, ${readable(peak / 1e9, 3)} GB/s`, 'faint'));
    roofs.forEach(([kind, roof], nth) => picture.append(svg('line', { x1: box.left, x2: box.right, y1: Y(roof), y2: Y(roof), stroke: `var(--c${[0, 2, 3][nth]})`, 'stroke-width': 2, 'stroke-dasharray': nth ? '6 4' : '' }), textAt(nth === 1 ? box.left + 8 : box.right - 6, Y(roof) + (nth < 2 ? 14 : -5), `${kind} always busy: ${readable(roof / 1e6, 3)} M/s`, 'faint', nth === 1 ? 'start' : 'end')));
    picture.append(svg('circle', { cx: X(intensity), cy: Y(rate), r: 6, fill: 'var(--c1)' }), textAt(X(intensity), Y(rate) + 22, `this frame: ${readable(rate / 1e6, 3)} M/s at ${readable(intensity, 3)} per byte`, '', 'middle'));
    picture.append(textAt((box.left + box.right) / 2, H - 8, 'contributions per byte of memory', 'faint', 'middle'), textAt(4, 12, 'contributions/s', 'faint'));
    return picture;
  };
  const roof = roofline(600) && fitted(roofline);

  // ---- Tiles over time ----

  const tiled = h('div');
  tiles?.then(tiles => {
    if (!tiles) return;
    const make = () => tiled.replaceChildren(h('h2', {}, 'Tiles over time'), h('p', { class: 'faint' }, 'States of each unit over the cycles of the second pass. A click selects a tile, the wheel and + or − zoom, dragging and arrows move.'), legend.cloneNode(true), attempt(() => tilesTimeline(tiles)));
    make();
    const look = () => { if (lookedAtTile) { make(); tiled.scrollIntoView(); } };
    document.addEventListener('tile', () => setTimeout(look));
    setTimeout(look);
  }, error => tiled.replaceChildren(h('p', { class: 'wrong' }, `No tiles: ${error.message}.`)));

  choose(chosen);
  onWidth(diagram, drawDiagram);
  onWidth(timeline, drawTimeline);
  onColours(drawTimeline);
  const area = report ? `; ${readable(Math.round(report.cost.area))} LUT equivalents, ${readable(1e3 * report.cost.energy.total, 3)} mJ per frame` : '';
  return [
    h('p', {}, `${described ? described.name + ': ' : ''}${readable(total)} cycles at ${readable(cycles.clock_hz / 1e6)} MHz, ${readable(cycles.frames_per_second, 4)} frames/s; limited by ${cycles.bottleneck}${area}.`),
    h('p', { class: 'faint' }, 'Wires have the formats of their words; the bar in a box shows the unit’s states in the frame’s cycles. A click shows a unit below.'), legend.cloneNode(true), diagram, detail,
    h('h2', {}, 'States of each unit'), legend, fitted(stacks),
    ...(timed.length ? [h('h2', {}, 'Units over time'), h('p', { class: 'faint' }, 'Dragging from left to right zooms in, a double click shows all; a click on a name hides its line.'), timeline] : []),
    tiled,
    ...(roof ? [h('h2', {}, 'Roofline'), h('p', { class: 'faint' }, 'The slope is the limit of memory, and each line the limit of a unit. No frame is above either.'), roof] : []),
    ...(described ? [h('h2', {}, 'Machine description'), h('p', {}, h('button', { onclick: () => save(described.name.replace(/[^\w.-]/g, '_') + '.json', JSON.stringify(described, null, 2)) }, 'save as a file'))] : []),
  ];
};
