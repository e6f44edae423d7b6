// Pixel trace, as pictures: contributions along depth, slots over time, decisions of machine and golden side by side.
'use strict';

const traceOf = (story, repeated) => {
  const { pixel, contributions, layers, slots } = story;
  const title = h('h2', {}, `Pixel ${pixel.join(',')}: ${contributions.length} contributions`);
  if (!contributions.length) return [title, h('p', {}, 'No splat touches this pixel: it is background.'), repeated];
  const flips = contributions.filter(one => one.flip).length;
  const kindOf = decision => decision === undefined ? 'none' : /^add/.test(decision) ? 'add' : /^open|^blend/.test(decision) ? 'open' : /^merge|^sum|^close/.test(decision) ? 'merge' : /^late|^inside/.test(decision) ? 'late' : 'drop';
  const KINDS = { open: 'opens a slot', add: 'adds to a slot', merge: 'merges two slots', late: 'blended into a closed slot', drop: 'evicted, replaced or dropped' };
  const tint = arrival => arrival.slot === null ? 'var(--c6)' : `var(--c${arrival.slot % 6})`;
  const mark = (x, y, arrival, size = 5) => {
    const fill = tint(arrival);
    switch (kindOf(arrival.decision)) {
      case 'open': return svg('rect', { x: x - size, y: y - size, width: 2 * size, height: 2 * size, fill });
      case 'merge': return svg('path', { d: `M${x},${y - size - 1}L${x + size + 1},${y + size}H${x - size - 1}Z`, fill });
      case 'drop': return svg('path', { d: `M${x - size},${y - size}L${x + size},${y + size}M${x + size},${y - size}L${x - size},${y + size}`, stroke: 'var(--c6)', 'stroke-width': 2.5 });
      case 'late': return svg('path', { d: `M${x},${y - size - 1}L${x + size + 1},${y}L${x},${y + size + 1}L${x - size - 1},${y}Z`, fill });
      default: return svg('circle', { cx: x, cy: y, r: size - 1, fill });
    }
  };
  const tooltip = (one, nth) => [h('b', {}, `splat ${one.splat}, number ${nth + 1}${one.flip ? ': flip' : ''}`), ...['fixed', 'golden'].map(whose => h('div', {}, one[whose] ? `${whose}: ${one[whose].decision}, w ${readable(one[whose].weight)}, z ${readable(one[whose].z)}` : `${whose}: none`))];
  const tipped = (group, one, nth) => {
    group.addEventListener('pointermove', event => tip.show(event.clientX, event.clientY, ...tooltip(one, nth)));
    group.addEventListener('pointerleave', tip.hide);
    return group;
  };
  const flipped = (x, y) => svg('circle', { cx: x, cy: y, r: 9, fill: 'none', stroke: 'var(--c1)', 'stroke-width': 2, class: 'flip' });

  // ---- Along depth: the machine above, golden below ----
  const H = 300, LEFT = 62, RIGHT = 16, MIDDLE = 150, TALL = 112;
  const arrivals = contributions.flatMap(one => [one.fixed, one.golden].filter(Boolean));
  const depths = arrivals.map(one => one.z);
  const [near, far] = [Math.min(...depths), Math.max(...depths)];
  const margin = far > near ? 0.03 * (far - near) : Math.max(Math.abs(near) * 1e-3, 1e-6);
  const heaviest = Math.max(...arrivals.map(one => one.weight), 1e-12);
  const alongDepth = fitted(W => {
  const x = z => LEFT + (W - LEFT - RIGHT) * (z - near + margin) / (far - near + 2 * margin);
  const stem = (one, nth, whose, sign) => {
    const arrival = one[whose];
    if (!arrival) return null;
    const [px, py] = [x(arrival.z), MIDDLE - sign * (TALL * arrival.weight / heaviest)];
    return tipped(svg('g', {}, svg('line', { x1: px, x2: px, y1: MIDDLE, y2: py, stroke: tint(arrival), 'stroke-width': 1.5 }), one.flip ? flipped(px, py) : null, mark(px, py, arrival)), one, nth);
  };
  const ticks = [0, 0.25, 0.5, 0.75, 1].map(part => near - margin + part * (far - near + 2 * margin));
  const layerLines = (whose, from, to) => layers[whose].map(layer => svg('line', { x1: x(layer.z), x2: x(layer.z), y1: from, y2: to, stroke: 'var(--c7)', 'stroke-dasharray': '3 4', opacity: 0.55 }));
  return svg('svg', { viewBox: `0 0 ${W} ${H}`, width: W, height: H, role: 'img', 'aria-label': 'contributions along depth, fixed above and golden below' },
    svg('line', { x1: LEFT, x2: W - RIGHT, y1: MIDDLE, y2: MIDDLE, stroke: 'var(--faint)' }),
    textAt(8, 70, 'fixed'), textAt(8, 236, 'golden'), textAt(8, MIDDLE + 4, 'w = 0', 'faint'),
    layerLines('fixed', 22, MIDDLE), layerLines('golden', MIDDLE, H - 24),
    contributions.map((one, nth) => stem(one, nth, 'fixed', 1)), contributions.map((one, nth) => stem(one, nth, 'golden', -1)),
    ticks.filter((_, nth) => W > 600 || nth % 2 === 0).map((z, nth, all) => textAt(x(z), H - 6, readable(z, 5), 'faint', nth === 0 ? 'start' : nth === all.length - 1 ? 'end' : 'middle')),
    textAt(4, H - 22, 'depth z', 'faint'), textAt(W - RIGHT, 14, `greatest w ${readable(heaviest, 4)}`, 'faint', 'end'));
  });

  // ---- Over time: the slot of each contribution ----
  const lanes = [...Array(slots).keys()].map(String).concat('–');
  const ROW = 20, TOP = 18, high = TOP + 2 * lanes.length * ROW + 34;
  const overTime = fitted(W => {
  const step = Math.min(34, (W - LEFT - RIGHT) / contributions.length);
  const lane = (arrival, whose) => TOP + (whose === 'golden' ? lanes.length * ROW + 12 : 0) + ROW * (arrival.slot === null ? lanes.length - 1 : Math.min(arrival.slot, lanes.length - 1)) + ROW / 2;
  return svg('svg', { viewBox: `0 0 ${W} ${high}`, width: W, height: high, role: 'img', 'aria-label': 'slots over time, fixed above and golden below' },
    ['fixed', 'golden'].map(whose => [
      ...lanes.map((name, nth) => { const y = lane({ slot: nth }, whose); return svg('g', {}, svg('line', { x1: LEFT, x2: W - RIGHT, y1: y, y2: y, stroke: 'var(--line)' }), textAt(LEFT - 8, y + 4, name, 'faint', 'end')); }),
      textAt(4, lane({ slot: 0 }, whose) + 4, whose),
    ]).flat(),
    contributions.flatMap((one, nth) => ['fixed', 'golden'].map(whose => {
      if (!one[whose]) return null;
      const [px, py] = [LEFT + step * (nth + 0.5), lane(one[whose], whose)];
      return tipped(svg('g', {}, one.flip ? flipped(px, py) : null, mark(px, py, one[whose])), one, nth);
    })),
    textAt(LEFT, high - 4, 'order of arrival →', 'faint'), textAt(4, TOP - 6, 'slot; – if it has no number', 'faint'));
  });

  const used = new Set(arrivals.map(arrival => kindOf(arrival.decision)));
  const legend = h('div', { class: 'legend' }, Object.entries(KINDS).filter(([kind]) => used.has(kind)).map(([kind, text]) => {
    const sample = { open: 'open 0', add: 'add', merge: 'merge', late: 'late', drop: 'drop' }[kind];
    const box = svg('svg', { width: 16, height: 16, viewBox: '0 0 16 16' }, mark(8, 8, { decision: sample, slot: null }));
    return h('span', { class: 'legend' }, box, text);
  }), h('span', {}, 'colour: slot'), flips ? h('span', { class: 'legend' }, svg('svg', { width: 20, height: 20, viewBox: '0 0 20 20' }, flipped(10, 10)), 'flip') : null, h('span', {}, 'dashed: layers at the end'));

  const MOST = 500, cells = arrival => arrival ? [arrival.radial_index.toFixed(5), arrival.weight.toFixed(6), arrival.z.toFixed(5), arrival.decision] : ['–', '–', '–', 'none'];
  const lines = contributions.slice(0, MOST).map((one, nth) => h('tr', { class: one.flip ? 'flip' : null, 'data-splat': String(one.splat) },
    [nth + 1, one.splat, ...cells(one.fixed), ...cells(one.golden), one.flip ? '◄ flip' : ''].map((cell, at) => h('td', { class: at === 5 || at >= 9 ? null : 'n' }, String(cell)))));
  const heads = ['', 'splat', 'r', 'w', 'z', 'fixed', 'golden r', 'w', 'z', 'golden', ''];
  const all = h('div', { class: 'scroll long-table', tabindex: '0' }, h('table', { id: 'contributions' }, h('thead', {}, h('tr', {}, heads.map(head => h('th', {}, head)))), h('tbody', {}, lines)));
  const more = contributions.length > MOST ? [h('p', { class: 'faint' }, `The first ${MOST} of ${contributions.length} contributions.`)] : [];
  const kept = ['fixed', 'golden'].flatMap(whose => layers[whose].map((layer, nth) => [`${whose} ${nth}`, String(layer.slot), layer.z.toFixed(5), layer.weight === null ? 'merged' : layer.weight.toFixed(5), ...layer.rgb.map(value => value.toFixed(5)), layer.opacity.toFixed(5)]));
  const end = [['fixed', ...story.fixed.map(value => value.toFixed(6))], ['golden', ...story.golden.map(value => value.toFixed(6))],
    [`word, ${story.frame_format}`, ...story.frame_words.map(word => word.toString(16))]];
  return [title, h('p', {}, flips ? `${flips} decided differently by the machine and by golden: marked.` : 'All decisions are equal in the machine and in golden.'), repeated, legend,
    h('h3', {}, 'Contributions along depth'), alongDepth, h('h3', {}, 'Slots over time'), overTime,
    h('h3', {}, 'Decisions'), all, ...more, h('h3', {}, 'Layers at the end, front to back'),
    table(['layer', 'slot', 'z', 'weight', 'red', 'green', 'blue', 'opacity'], kept), h('h3', {}, 'Blended'), table(['', 'red', 'green', 'blue', 'alpha'], end)];
};

const textAt = (x, y, text, kind = '', anchor = 'start') => {
  const made = svg('text', { x, y, 'text-anchor': anchor, class: kind });
  made.textContent = text;
  return made;
};
